// splat.vert: one voxel falls into one pixel (or, bilinearly, into one of four: instance 0 to 3). No footprint: what
// smooths the image is a wobble of the focal spot, or of the voxel, drawn per voxel (Birkfellner 2005; Spoerk et al. 2012,
// 2.1). Positions are voxel indices, projected to (column w, row w, w) with w the fraction of the way from the source (0)
// to the receptor (1). The weight makes the sum a line integral: mu dV / (w^2 A cos theta) with A the area of a pixel and
// theta the angle to the central axis (docs/renderers.md, "Splatting").

layout(location = 0) in uint voxel;  // its index: (z * size.y + y) * size.x + x
layout(location = 1) in float attenuation;

layout(location = 0) uniform uvec3 size;
layout(location = 1) uniform mat4 pixel_from_voxel;    // rows 0 to 2: column w, row w, w
layout(location = 5) uniform vec3 source_voxel;
layout(location = 6) uniform mat3 mm_from_voxel_axes;
layout(location = 9) uniform float sid_mm;             // along the central axis
layout(location = 10) uniform float weight;            // of a texture value of 1: unit_per_mm dV / A
layout(location = 11) uniform vec2 sigma_px;           // on the receptor, of columns and rows
layout(location = 12) uniform uint focus_wobbles;
layout(location = 13) uniform uint bilinear;
layout(location = 14) uniform vec2 image_size;
layout(location = 15) uniform uint seed;

#ifdef NOISE_TEXTURE
layout(binding = 0) uniform sampler3D noise;  // pairs of Gaussian numbers, tiled over the volume

vec2 gaussian_pair(uvec3 position) { return texelFetch(noise, ivec3(position) % textureSize(noise, 0), 0).rg; }
#else
// PCG (Jarzynski and Olano, JCGT 9(3), 2020).
uint pcg(uint value) {
  uint state = value * 747796405u + 2891336453u;
  uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
  return (word >> 22u) ^ word;
}

// Box and Muller's method, from the two halves of what hashing gives.
vec2 gaussian_pair(uvec3 position) {
  uint first = pcg(voxel ^ pcg(seed));
  uint second = pcg(first);
  float radius = sqrt(-2.0 * log((float(first >> 8u) + 0.5) / 16777216.0));
  float angle = 6.28318530718 * (float(second >> 8u) / 16777216.0);
  return radius * vec2(cos(angle), sin(angle));
}
#endif

layout(location = 0) flat out float deposit;

void main() {
  uvec3 position = uvec3(voxel % size.x, voxel / size.x % size.y, voxel / (size.x * size.y));
  vec3 projected = (pixel_from_voxel * vec4(vec3(position), 1.0)).xyz;
  float w = projected.z;
  deposit = 0.0;
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);  // out of sight
  if (!(w > 0.0 && w < 1.0)) return;       // not between source and receptor

  // A focal spot that moves by d moves the shadow by -d (1 - w) / w; a voxel that moves by d moves it by d / w.
  vec2 wobble = sigma_px * gaussian_pair(position);
  vec2 pixel = projected.xy / w + (focus_wobbles != 0u ? wobble * (w - 1.0) / w : wobble / w);
  float way_mm = length(mm_from_voxel_axes * (vec3(position) - source_voxel));
  float cos_theta = w * sid_mm / way_mm;
  deposit = attenuation * weight / (w * w * cos_theta);
  vec2 center = floor(pixel + 0.5);
  if (bilinear != 0u) {
    vec2 corner = vec2(gl_InstanceID & 1, gl_InstanceID >> 1);
    vec2 part = pixel - floor(pixel);
    vec2 share = mix(1.0 - part, part, corner);
    deposit *= share.x * share.y;
    center = floor(pixel) + corner;
  }
  gl_Position = vec4(2.0 * (center + 0.5) / image_size - 1.0, 0.0, 1.0);
}
