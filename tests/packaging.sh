#!/bin/bash
# Fails if systemd-analyze rates a unit's exposure above 2, with the drop-in for GPUs, too, if a unit keeps the decoder of
# compressed pixels from confining itself (io/dicom/decoder_confinement.cc), or if the software bill of
# materials lacks a package of packages.txt or has one twice. packaging.sh SOURCE_DIR PROGRAM
set -euo pipefail
cd "$1"
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
mkdir "$work/isoshift-watch.service.d"
cp packaging/gpu.conf "$work/isoshift-watch.service.d"
cp packaging/isoshift-watch.service "$work"
for unit in packaging/isoshift-watch.service packaging/isoshift-serve.service "$work/isoshift-watch.service"; do
  systemd-analyze security --offline=true --no-pager --threshold=20 "$unit" >"$work/exposure" || {
    cat "$work/exposure"
    exit 1
  }
  grep -qx 'SystemCallFilter=seccomp prlimit64 setrlimit' "$unit" || { echo "$unit: the decoder cannot confine itself"; exit 1; }
done

# The user and the group that the units name are made.
mkdir -p "$work/root/etc"
systemd-sysusers --root="$work/root" - <packaging/isoshift.sysusers >"$work/made" 2>&1
for unit in packaging/isoshift-*.service; do
  grep -q "^$(sed -n 's/^User=//p' "$unit"):" "$work/root/etc/passwd" || { echo "$unit: nobody makes its user"; exit 1; }
  grep -q "^$(sed -n 's/^Group=//p' "$unit"):" "$work/root/etc/group" || { echo "$unit: nobody makes its group"; exit 1; }
done

packaging/sbom.sh "$2" >"$work/sbom"
. /etc/os-release
wanted=$(for section in run build python test; do packaging/packages.sh "$VERSION_ID" "$section" | cut -f 1; done)
for package in isoshift $wanted libdcmtk17; do
  count=$(grep -cxF "PackageName: $package" "$work/sbom" || true)
  [ "$package" != libdcmtk17 ] || [ "$VERSION_ID" = 12 ] || continue
  [ "$count" = 1 ] || { echo "the software bill of materials names $package $count times"; exit 1; }
done
# Every element has a relationship, and nothing is related that is no element.
diff <(sed -n 's/^SPDXID: //p' "$work/sbom" | sort -u) \
  <(sed -n 's/^Relationship: \([^ ]*\) [A-Z_]* \([^ ]*\)$/\1\n\2/p' "$work/sbom" | sort -u)
