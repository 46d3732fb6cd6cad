#!/bin/bash
# Fails if docs/dicom-rules.md names a test that does not exist. rules.sh SOURCE_DIR TEST_PROGRAM...
set -euo pipefail
source_dir=$1
shift
existing=$(for program in "$@"; do
  "$program" --gtest_list_tests | awk '/^[^ ]/ {sub(/.*\//, "", $1); suite = $1} /^  / {sub(/\/.*/, "", $1); print suite $1}'
done | sort -u)
missing=0
while read -r name; do
  grep -qxF "$name" <<<"$existing" || { echo "docs/dicom-rules.md: there is no test $name"; missing=1; }
done < <(grep -oE '`[A-Za-z0-9]+\.[A-Za-z0-9]+`' "$source_dir/docs/dicom-rules.md" | tr -d '`' | grep -v '\.sh$' | sort -u)
exit $missing
