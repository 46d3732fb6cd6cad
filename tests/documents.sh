#!/bin/bash
# Fails if a document names a test that does not exist, or a file of this repository that is not there.
# documents.sh SOURCE_DIR TEST_PROGRAM...
set -euo pipefail
source_dir=$1
shift
tests=$(for program in "$@"; do
  "$program" --gtest_list_tests | awk '/^[^ ]/ {sub(/ *#.*/, ""); sub(/.*\//, "", $1); sub(/\/.*/, "", $1); suite = $1}
                                       /^  / {sub(/\/.*/, "", $1); print suite $1; print suite "*"; print substr(suite, 1, length(suite) - 1)}'
done
  grep -oE 'add_test\(NAME [A-Za-z0-9.]+' "$source_dir/tests/CMakeLists.txt" | cut -d' ' -f2)
cd "$source_dir"
status=0
complain() {
  echo "$1"
  status=1
}

# `Suite.Test`, `Suite.*`; in the changelog, where every entry names its guard, `Suite` too.
while IFS=: read -r document name; do
  grep -qxF "$name" <<<"$tests" || complain "$document: there is no test $name"
done < <({
  grep -oE '`[A-Z][A-Za-z0-9]+\.([A-Z][A-Za-z0-9]+|\*)`' README.md CHANGELOG.md ARCHITECTURE.md docs/*.md docs/commands/*.md testdata/README.md testdata/*/README.md
  grep -oE '`[A-Z][a-z]+[A-Za-z0-9]*`' CHANGELOG.md | sed 's/^/CHANGELOG.md:/'
} | tr -d '`' | grep -v ':RTImage[.]' | sort -u)

# tests/..., bench/..., docs/..., testdata/... and the like.
while IFS=: read -r document file; do
  [ -e "$file" ] || complain "$document: there is no $file"
done < <(grep -oE '(testdata|tests|bench|docs|packaging|drr|io|registration|workflow|geometry|setup|base|cli|phantom)/[A-Za-z0-9_./-]+\.[a-z]+' \
  README.md docs/*.md docs/commands/*.md testdata/README.md testdata/*/README.md tests/real_data/README.md | sort -u)
exit $status
