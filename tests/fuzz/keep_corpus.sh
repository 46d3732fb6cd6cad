#!/bin/bash
# Makes tests/fuzz/corpus.tar.xz again: of what ./dev fuzz has found (build/fuzz/corpus) and of what was kept before, the
# fewest files that reach as much of each reader. Run it in the project's root, after ./dev fuzz.
set -euo pipefail
kept=build/fuzz/kept/corpus
rm -rf "$kept"
for program in build/fuzz/tests/fuzz_*; do
  reader=${program##*/fuzz_}
  mkdir -p "$kept/$reader"
  # Files on which DCMTK's decoders crash end the attempt at these files alone.
  "$program" -merge=1 -timeout=60 -rss_limit_mb=4096 "$kept/$reader" build/fuzz/{seeds,corpus}/"$reader"
done
tar -C build/fuzz/kept --sort=name --mtime=@0 --owner=0 --group=0 --numeric-owner -cJf tests/fuzz/corpus.tar.xz corpus
