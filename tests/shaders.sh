#!/bin/bash
# shaders.sh ROOT: every shader of the tree, in each of its variants, is GLSL that glslangValidator compiles to SPIR-V which
# spirv-val finds valid: compilers that nobody here wrote, and stricter than most drivers.
set -euo pipefail
cd "$1"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
count=0 status=0
while read -r shader; do
  # As it stands, and with each name that it asks for.
  variants=$(grep -oE '(defined\(|#ifdef )[A-Z_]+' "$shader" | grep -oE '[A-Z_]+$' | sort -u || true)
  for variant in "" $variants; do
    source=$scratch/shader.${shader##*.}
    # What comes before all shaders of a folder.
    common=$(find "$(dirname "$shader")" -maxdepth 1 -name '*.glsl')
    { echo "#version 450 core"; for name in $variant; do echo "#define $name"; done; cat $common <(echo "#line 1") "$shader"; } >"$source"
    if ! { glslangValidator -G100 --target-env opengl -o "$scratch/shader.spv" "$source" &&
           spirv-val --target-env opengl4.5 "$scratch/shader.spv"; } >"$scratch/log" 2>&1; then
      echo "$shader${variant:+ with $variant} is not valid:" >&2
      cat "$scratch/log" >&2
      status=1
    fi
    count=$((count + 1))
  done
done < <(find drr registration -name '*.comp' -o -name '*.vert' -o -name '*.frag' | sort)
[ "$count" -ge 13 ] || { echo "only $count variants of shaders were found" >&2; status=1; }
[ "$status" -ne 0 ] || echo "$count variants of shaders are valid SPIR-V"
exit $status
