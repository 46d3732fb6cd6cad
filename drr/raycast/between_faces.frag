// between_faces.frag: line integral of attenuation from the first front face to the last back face that a ray meets.
// Sampled trilinearly at the middle of equal steps of at most step_mm, as in raycast.comp. Output pixel n is the n-th of
// the list of pixels, or of all.

layout(binding = 0) uniform sampler3D attenuation;
layout(binding = 1) uniform sampler2D front;  // positions in continuous voxel indices, alpha 0 where there is no face
layout(binding = 2) uniform sampler2D back;

layout(std430, binding = 0) readonly buffer Pixels { uint pixels[]; };

layout(location = 0) uniform mat4 voxel_from_pixel;  // as in raycast.comp
layout(location = 4) uniform mat3 mm_from_voxel_axes;
layout(location = 7) uniform float step_mm;
layout(location = 8) uniform float unit_per_mm;
layout(location = 9) uniform uint columns;         // of the view
layout(location = 10) uniform uint output_columns;
layout(location = 11) uniform uint pixel_count;
layout(location = 12) uniform uint has_pixel_list;

layout(location = 0) out float line_integral;

void main() {
  line_integral = 0.0;
  uint n = uint(gl_FragCoord.y) * output_columns + uint(gl_FragCoord.x);
  if (n >= pixel_count) return;
  uint pixel = has_pixel_list != 0u ? pixels[n] : n;
  ivec2 position = ivec2(pixel % columns, pixel / columns);
  vec4 first = texelFetch(front, position, 0);
  vec4 last = texelFetch(back, position, 0);
  if (last.a == 0.0) return;

  // How far on the way from source (0) to pixel (1) the faces lie; what is behind the receptor does not count.
  vec3 source = voxel_from_pixel[3].xyz;
  vec3 way = mat3(voxel_from_pixel) * vec3(position, 1.0);
  // A source inside the structure has no front face.
  float begin = first.a == 0.0 ? 0.0 : max(dot(first.xyz - source, way) / dot(way, way), 0.0);
  float end = min(dot(last.xyz - source, way) / dot(way, way), 1.0);
  if (!(begin < end)) return;

  float way_mm = length(mm_from_voxel_axes * way);
  int steps = max(1, int(ceil((end - begin) * way_mm / step_mm)));
  float step_t = (end - begin) / float(steps);
  vec3 scale = 1.0 / vec3(textureSize(attenuation, 0));
  vec3 middle = (source + (begin + 0.5 * step_t) * way + 0.5) * scale;
  vec3 step_texture = step_t * way * scale;
  float sum = 0.0;
  for (int k = 0; k < steps; ++k) sum += textureLod(attenuation, middle + float(k) * step_texture, 0.0).r;
  line_integral = sum * step_t * way_mm * unit_per_mm;
}
