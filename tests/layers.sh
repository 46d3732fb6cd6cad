#!/bin/bash
# Fails if a folder includes one that is not below it, or a library that is not its own (ARCHITECTURE.md, "Layers").
# layers.sh SOURCE_DIR
set -euo pipefail
cd "$1"
status=0

includes() {  # includes FOLDER: "FILE:INCLUDED" for every include of its sources
  grep -rnoE '#include [<"][^>"]+' "$1" --include='*.cc' --include='*.h' | sed -E 's/:[0-9]+:#include [<"]/:/'
}

complain() {
  echo "$1"
  status=1
}

# may_include FOLDER BELOW...: of our own folders FOLDER includes itself and these only.
our_folders='base|geometry|bodies|setup|drr|io|registration|workflow|serve|phantom|cli|tests|bench'
may_include() {
  local folder=$1 allowed
  allowed="($(IFS='|' && echo "$*"))/"
  while IFS=: read -r file included; do
    [[ ! $included =~ ^($our_folders)/ || $included =~ ^$allowed ]] || complain "$file must not include $included"
  done < <(includes "$folder")
}

# only_in LIBRARY PLACE...: includes that match the pattern stand in files whose path begins with one of these.
only_in() {
  local library=$1 folder
  shift
  for folder in base geometry bodies setup drr io registration workflow serve phantom cli; do
    while IFS=: read -r file included; do
      [[ ! $included =~ ^$library || $file =~ ^($(IFS='|' && echo "$*")) ]] || complain "$file must not include $included"
    done < <(includes "$folder")
  done
}

may_include base
may_include geometry base
may_include bodies base geometry
may_include setup base geometry
may_include drr base geometry
may_include io/dicom base geometry setup
may_include io/config base geometry setup io/dicom
may_include io/network base io/dicom io/config
may_include io/study base geometry setup io/dicom io/config
may_include io/objects base geometry setup io/dicom io/config io/study
may_include io/report base geometry setup io/dicom io/config io/study io/objects
may_include registration base geometry bodies setup drr
may_include workflow base geometry bodies setup drr io registration
may_include serve base geometry io/config io/report setup workflow
may_include phantom base geometry setup io/dicom
may_include cli base geometry bodies setup drr io registration workflow serve phantom
# The campaign reads and writes DICOM with isoshift and has a geometry of its own.
may_include phantom/dicom io/dicom
may_include tests/real_data/campaign base io/dicom phantom/dicom tests/support

only_in 'dcmtk/' io phantom
only_in 'opencv2/' registration/preprocess/
only_in 'openjpeg' io/dicom/jpeg2000.cc
only_in 'nlopt' registration/optimizer.cc
only_in 'ceres/' registration/imager/bundle_adjustment.cc
only_in '(EGL|GL|epoxy|glm)/' drr registration/similarity/
only_in 'CLI/' cli
only_in 'curl/' io/network/
only_in 'boost/(asio|beast)' serve/http_server.cc
only_in 'boost/math' base/distributions.cc
# What takes long to compile is compiled once (bench/results/build-time.md).
only_in 'Eigen/(Cholesky|Dense|Eigenvalues|QR|SVD)' geometry/linear_algebra.cc
only_in 'security/' serve/pam.cc
only_in '(cairo|pango)' io/report/ io/objects/image_files.cc

# The phantom shares no geometry with what it tests: a wrong sign would cancel.
while IFS=: read -r file included; do
  [[ ! $included =~ ^(geometry/xray_view|setup/couch) ]] || complain "$file must not include $included"
done < <(includes phantom)

# The libraries name options as option() spells them: only a program knows that its users type flags.
while IFS= read -r found; do
  complain "$found names a flag: option() of base/option_name.h does, as the program wants it"
done < <(grep -rnoE '"[^"]*--[a-z][^"]*"' --include=*.cc --include=*.h base geometry bodies setup drr registration io |
  grep -v 'gdcmconv --raw' | grep -v '^setup/target.h' || true)
exit $status
