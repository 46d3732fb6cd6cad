#!/bin/bash
# Installs the libraries that were built, builds tests/consumer with them alone, and lets it register a study:
# consumer.sh SOURCE BUILD
set -euo pipefail
source=$1 build=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cmake --install "$build" --prefix "$work/prefix" --component development >/dev/null
# No warning flags, and no folder of this machine but those of the system.
if grep -rn -e '-W[a-z]' -e "$source" -e "$build" "$work/prefix/lib/cmake"; then
  echo "error: the installed package names what only the build may know" >&2
  exit 1
fi
# Every header that is installed can be included.
(cd "$work/prefix/include/isoshift" && find . -name '*.h' -printf '#include "%P"\n' | sort) >"$work/headers.cc"
g++ -std=c++20 -fsyntax-only -I "$work/prefix/include/isoshift" -isystem /usr/include/eigen3 "$work/headers.cc"
cmake -S "$source/tests/consumer" -B "$work/build" -G Ninja -DCMAKE_PREFIX_PATH="$work/prefix" -DCMAKE_BUILD_TYPE=Release >"$work/log" 2>&1 &&
  cmake --build "$work/build" >>"$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
cp -r "$source/testdata/small/1" "$work/study"
rm -r "$work/study/RTIMAGE/F02"
"$work/build/consumer" "$work/study" "$work/object.dcm" | tee "$work/found"
# The library and the program give one answer.
"$build/cli/isoshift" register "$work/study" -o "$work/result" --renderer cpu >"$work/log"
/usr/bin/python3 - "$work/result/result.json" "$work/found" <<'END'
import json, sys
result, found = json.load(open(sys.argv[1])), open(sys.argv[2]).read().splitlines()
translation = ", ".join(f"{value:.4f}" for value in result["setup_error"]["known_translation_mm"])
expected = [f"{result['verdict']} ({translation})", *result["reasons"]]
sys.exit(0 if found == expected else f"error: the library found {found}, the program {expected}")
END
"$build/cli/isoshift" check "$work/object.dcm" --plan "$work/study/RTPLAN.dcm"
