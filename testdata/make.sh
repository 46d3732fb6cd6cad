#!/bin/bash
# Makes everything in testdata/ that a program made, in a new folder: make.sh ISOSHIFT FOLDER
#
#   testdata/make.sh build/dev/cli/isoshift /tmp/testdata
#
# Then copy what changed to testdata/. Needs the packages of ./dev test (dcmtk, python3-pydicom). tests/testdata/remake.sh runs
# this script and compares its files with those in testdata/.
set -euo pipefail
[ $# -eq 2 ] || { echo "Usage: make.sh ISOSHIFT FOLDER" >&2; exit 2; }
isoshift=$(realpath "$1")
here=$(dirname "$(realpath "${BASH_SOURCE[0]}")")
mkdir -p "$2"
# Every path below is relative, so that no output names a folder of this machine.
cd "$2"
[ -z "$(ls -A)" ] || { echo "error: $2 is not empty" >&2; exit 1; }

# run EXPECTED_STATUS ARGUMENTS: isoshift, whose output is shown only if it ends otherwise than expected.
run() {
  local expected=$1 status=0 log
  shift
  log=$("$isoshift" "$@" 2>&1) || status=$?
  [ "$status" -eq "$expected" ] || { printf '%s\nerror: isoshift %s: status %s, expected %s\n' "$log" "$*" "$status" "$expected" >&2; exit 1; }
}

phantom() {  # phantom FOLDER [FLAGS]
  run 0 phantom -o "$@"
  rm "$1/.isoshift"  # the list of files by which --overwrite knows its own folders
}

studies() {
  # Every study has a seed of its own, and so its own patient and UIDs.
  phantom head --seed 3 --voxel-mm 2 --image-pixels 192
  phantom spine --seed 4 --anatomy spine --voxel-mm 2 --image-pixels 192
  phantom thorax --seed 5 --anatomy thorax --voxel-mm 2 --image-pixels 192
  /usr/bin/python3 "$here/draw_structures.py" head Head
  /usr/bin/python3 "$here/draw_structures.py" spine Spine
  for seed in 1 2; do
    phantom "small/$seed" --seed $seed --voxel-mm 4 --image-pixels 96 --photons 0 --fractions 2
  done
}

# The object, its plan and the truth of a registration.
keep_registration() {  # keep_registration NAME STUDY EXPECTED_STATUS [FLAGS]
  local name=$1 study=$2 expected=$3
  shift 3
  run "$expected" register "$study" -o registered "$@"
  mkdir -p "registrations/$name"
  mv registered/spatial_registration.dcm "registrations/$name"
  cp "$study/RTPLAN.dcm" "$study/truth.json" "registrations/$name"
  rm -r registered
}

registrations() {
  local position seed=10
  for position in HFS HFP FFS FFP HFDR HFDL FFDR FFDL; do
    phantom lying --seed $((++seed)) --patient-position $position --voxel-mm 2.5 --image-pixels 128 --photons 0
    keep_registration $position lying 0
    [ $position != HFS ] || keep_registration room lying 0 --source-for iec-fixed
    rm -r lying
  done
  keep_registration review spine 3 --preset fast --write-reg-for-review
}

compressed() {
  local slice=small/1/CT/CT0018.dcm
  mkdir compressed
  dcmcjpls +el $slice compressed/jpeg-ls.dcm
  dcmcjpeg +e1 $slice compressed/jpeg-lossless.dcm
  dcmcrle $slice compressed/rle.dcm
  gdcmconv --j2k $slice compressed/jpeg2000.dcm
  dcmconv +td $slice compressed/deflated.dcm
  dcmconv +ti $slice compressed/implicit.dcm
  dcmconv +tb $slice compressed/big-endian.dcm
}

enhanced() {
  mkdir enhanced
  /usr/bin/python3 "$here/enhanced_ct.py" enhanced/plain.dcm small/1/CT/CT00{16..20}.dcm
  dcmcrle enhanced/plain.dcm enhanced/rle.dcm
}

breathing() {
  mkdir breathing
  phantom breathes --anatomy thorax --breathing 60 --rate 4 --gantry-angles 0 --phases 0 --voxel-mm 5 --image-pixels 64 \
    --photons 0 --translation 0,0,0 --rotation 0,0,0
  mv breathes/truth.csv breathing/phantom.csv
  # As a recorder of external markers writes it: ms, semicolons, decimal commas, one time that goes back, padding.
  awk -F, 'BEGIN {printf "\"Frame\";\"Timestamp\";\"x\";\"y\";\"z\"\r\n"}
           NR > 1 {t = NR == 102 ? 1000 * $1 - 700 : 1000 * $1
                   row = sprintf("%d;%.0f;%.1f;%.1f;%.1f", NR - 2, t, $2, $3, $4); gsub(/\./, ",", row); printf "%s\r\n", row}
           END {for (n = 0; n < 5; ++n) printf "0;0;0;0;0\r\n"}' breathing/phantom.csv >breathing/markers.csv
  rm -r breathes
  phantom breathes --anatomy thorax --breathing 6 --phases 0 --voxel-mm 3 --image-pixels 128 --photons 0 \
    --translation 0,0,0 --rotation 0,0,0
  run 0 track breathes --structure Target -o tracked --predictor kalman
  mv tracked/trace.csv breathing/tracked.csv
  rm -r breathes tracked
}

# spoil FILE NAME CHANGE: damaged/NAME, a copy with one attribute changed.
spoil() {
  cp "$1" "damaged/$2"
  dcmodify -nb -nmu -m "$3" "damaged/$2"
}

# One for every reader. damaged/README.md says what is wrong with each.
damaged() {
  local config=$here/config matrix='1.3\0\0\0\0\1.3\0\0\0\0\1.3\0\0\0\0\1'
  mkdir damaged damaged/result
  head -c 4000 small/1/CT/CT0018.dcm >damaged/ct.dcm
  spoil small/1/RTIMAGE/KV_G000.dcm rt-image.dcm "Columns=97"
  spoil small/1/RTPLAN.dcm rt-plan.dcm "BeamSequence[1].ControlPointSequence[0].IsocenterPosition=0\\0\\0"
  spoil thorax/RTSTRUCT.dcm rt-structures.dcm "ROIContourSequence[0].ContourSequence[2].NumberOfContourPoints=35"
  spoil registrations/HFS/spatial_registration.dcm spatial-registration.dcm \
    "RegistrationSequence[1].MatrixRegistrationSequence[0].MatrixSequence[0].FrameOfReferenceTransformationMatrix=$matrix"
  dcmcrle small/1/RTIMAGE/KV_G000.dcm rle.dcm
  spoil rle.dcm compressed.dcm "Rows=120"
  rm rle.dcm
  printf 'case,study\none,../small/1\none,../small/2\n' >damaged/manifest.csv
  sed 's/"translation_mm": 3/"translation_mm": "3 mm"/' "$config/site/linac.json" >damaged/site.json
  sed 's/"spacing_plane"/"spacing_plan"/' "$config/machine/axis-spacing.json" >damaged/machine.json
  sed 's/"port": 4242/"port": 424242/; s|"../site/|"../config/site/|' "$config/watch/orthanc.json" >damaged/watch.json
  sed '7s/,.*$/,oops,0,0/' breathing/phantom.csv >damaged/trace.csv
  sed 's/"schema": 1,/"schema": 99,/' "results/$version/accepted/result.json" >damaged/result/result.json
}

# Result folders of this version; those of earlier ones stay as they are.
results() {
  mkdir -p "results/$version"
  run 0 register head -o "results/$version/accepted"
  run 3 register spine -o "results/$version/review" --preset fast --write-reg-for-review
  run 4 register head -o "results/$version/rejected" --ct spine/CT --allow "patient-mismatch=another patient, on purpose" \
    --allow "for-mismatch=another patient, on purpose"
  run 0 evaluate small/1 --image small/1/RTIMAGE/KV_G000.dcm --image small/1/RTIMAGE/KV_G090.dcm \
    --truth small/1/truth.json -o "results/$version/evaluation" --preset fast --starts 4
}

version=$("$isoshift" --version | cut -d' ' -f2)
studies
registrations
/usr/bin/python3 "$here/rt_image_dialects.py" small/1/RTIMAGE rt-images
compressed
enhanced
breathing
results
damaged
