#!/bin/sh
# Fails if a folder includes what lies above it, or a library that is not its own (ARCHITECTURE.md, "Layers").
cd "$1" || exit 1
status=0
forbid() {  # forbid FOLDER PATTERN [EXCEPT]: no file of FOLDER, but those of EXCEPT, includes PATTERN
  found=$(grep -rnE "#include [<\"]($2)" "$1" --include='*.cc' --include='*.h' | grep -v "^${3:-nothing}")
  if [ -n "$found" ]; then
    echo "$1 must not include $2:"
    echo "$found"
    status=1
  fi
}
forbid geometry 'io/|drr/|registration/|phantom/|cli/|tests/|dcmtk|opencv2|nlopt|tbb|GL|epoxy'
forbid drr 'io/|registration/|phantom/|cli/|tests/|dcmtk|opencv2|nlopt'
forbid registration 'io/|phantom/|cli/|tests/|dcmtk'
forbid registration 'opencv2' registration/preprocess/
forbid registration 'nlopt' registration/optimizer.cc
forbid io 'drr/|registration/|phantom/|cli/|tests/|opencv2|nlopt'
forbid phantom 'drr/|registration/|cli/|tests/|geometry/(xray_view|couch_shift)|opencv2'
forbid cli 'tests/|opencv2|nlopt'
exit $status
