#!/bin/bash
# Fails if a line of packages.txt is none of: a comment, a section, or "NAME [(12)|(13)]  # REASON". A release that no
# Debian here has would drop a package silently. packages.sh SOURCE_DIR
set -euo pipefail
cd "$1"
wrong=$(grep -nvE '^(#.*|\[(run|build|python|test|package)\]|[a-z0-9.+-]+( \((12|13)\))? +# .+|)$' packages.txt || true)
[ -z "$wrong" ] || { echo "packages.txt: expected \"NAME [(12)|(13)]  # REASON\", found"; echo "$wrong"; exit 1; }
