#!/bin/bash
# The packages of a section of packages.txt for a release of Debian, "NAME<tab>REASON": packages.sh 12|13 SECTION
set -euo pipefail
awk -v release="($1)" -v section="[$2]" '/^\[/ {inside = $1 == section; next}
  inside && NF && $1 !~ /^#/ && ($2 !~ /^\(/ || $2 == release) {name = $1; sub(/^[^#]*# /, ""); print name "\t" $0}' \
  "$(dirname "$(readlink -f "$0")")/../packages.txt"
