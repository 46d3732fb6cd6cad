#!/bin/bash
# Makes testdata/ again and compares it with what is committed: remake.sh SOURCE_DIR ISOSHIFT
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$1/testdata/make.sh" "$2" "$folder/testdata"
/usr/bin/python3 "$1/tests/testdata/compare.py" "$1/testdata" "$folder/testdata"
