// raycast.comp: line integrals of attenuation along source-to-pixel rays, for all poses, views and pixels of one call.
// Positions are continuous voxel indices, lengths mm, attenuation 1/mm. The volume is sampled trilinearly at the middle
// of equal steps of at most step_mm; outside of it the texture's border is 0. Blocks in which every sample would be 0 are
// passed over by a walk from block to block (Amanatides and Woo, Eurographics 1987) (docs/renderers.md, "Ray casting").
// With DERIVATIVES also how every line integral changes if the patient moves (docs/algorithms.md, "Derivatives").

layout(local_size_x = 64) in;

layout(binding = 0) uniform sampler3D kv_attenuation;
layout(binding = 1) uniform sampler3D mv_attenuation;
layout(binding = 2) uniform sampler3D occupied;  // block b covers the positions from b * kBlockEdge - 1, as many again

struct View {
  uint first_pixel;  // where the view's pixels begin among those of one pose
  uint columns;
  uint is_mv;
  uint in_squares;   // whether its pixels can be taken in squares of 8 x 8
};

// Columns 0 to 2 take (column, row, 1) to the way from source to pixel; column 3 is the source, of row 0 in a line scan,
// whose source moves on by row_step from row to row.
struct Camera {
  mat4 voxel_from_pixel;
  vec4 row_step;
};
layout(std430, binding = 0) readonly buffer Cameras { Camera cameras[]; };         // [pose][view]
layout(std430, binding = 1) readonly buffer Views { View views[]; };
layout(std430, binding = 2) readonly buffer Pixels { uint pixels[]; };             // of one pose, where a list is given
layout(std430, binding = 3) writeonly buffer Result { float line_integrals[]; };   // [pose][pixel]
#ifdef DERIVATIVES
// As the cameras, but of the room, mm; and how directions of voxels turn into those of the room for gradients.
struct Room {
  mat4 room_from_pixel;
  mat4 room_from_gradient;
  vec4 row_step;
};
layout(std430, binding = 4) readonly buffer Rooms { Room rooms[]; };                // [pose][view]
layout(std430, binding = 5) writeonly buffer Derivatives { float derivatives[]; };  // [pose][pixel][6]
#endif

layout(location = 0) uniform uvec2 poses;  // of this dispatch: the first, and the end
layout(location = 1) uniform uint view_count;
layout(location = 2) uniform uint pixels_per_pose;
layout(location = 3) uniform uint has_pixel_list;
layout(location = 4) uniform float step_mm;
layout(location = 5) uniform mat3 mm_from_voxel_axes;
layout(location = 6) uniform vec3 box_low;   // outside of this box, in voxel indices, every sample is 0
layout(location = 7) uniform vec3 box_high;
layout(location = 8) uniform vec2 units_per_mm;  // attenuation of a texture value of 1: kV, MV
layout(location = 9) uniform uvec2 rays;        // of this dispatch, among those of a pose: the first, and the end

const int kBlockEdge = 8;
const int kAtOnce = 4;

#ifdef EIGHT_BIT_WEIGHTS
// What the texture units of GPUs do: weights of 8 bits.
float sampled(sampler3D volume, vec3 voxel) {
  vec3 below = floor(voxel);
  vec3 share = floor((voxel - below) * 256.0 + 0.5) / 256.0;
  float value = 0.0;
  for (int n = 0; n < 8; ++n) {
    ivec3 offset = ivec3(n & 1, n >> 1 & 1, n >> 2);
    ivec3 at = ivec3(below) + offset;
    if (any(lessThan(at, ivec3(0))) || any(greaterThanEqual(at, textureSize(volume, 0)))) continue;
    vec3 weights = mix(1.0 - share, share, equal(offset, ivec3(1)));
    value += weights.x * weights.y * weights.z * texelFetch(volume, at, 0).r;
  }
  return value;
}
#else
float sampled(sampler3D volume, vec3 voxel) {
  return textureLod(volume, (voxel + 0.5) / vec3(textureSize(volume, 0)), 0.0).r;
}
#endif

// What a ray adds up: attenuation, its gradient, and the gradient times t. Of the plain variant only the first.
struct Sums {
  float value;
#ifdef DERIVATIVES
  vec3 by_source, by_way;
#endif
};

#ifdef DERIVATIVES
// The gradient of the trilinear interpolation: along each axis the difference between the faces of the cell.
vec3 gradient(sampler3D volume, vec3 voxel) {
  vec3 low = floor(voxel), high = low + 1.0;
  return vec3(sampled(volume, vec3(high.x, voxel.yz)) - sampled(volume, vec3(low.x, voxel.yz)),
              sampled(volume, vec3(voxel.x, high.y, voxel.z)) - sampled(volume, vec3(voxel.x, low.y, voxel.z)),
              sampled(volume, vec3(voxel.xy, high.z)) - sampled(volume, vec3(voxel.xy, low.z)));
}
#endif

Sums nothing() {
  Sums sums;
  sums.value = 0.0;
#ifdef DERIVATIVES
  sums.by_source = sums.by_way = vec3(0.0);
#endif
  return sums;
}

void add_sample(vec3 source, vec3 way, float t, sampler3D volume, inout Sums sums) {
  vec3 voxel = source + t * way;
  sums.value += sampled(volume, voxel);
#ifdef DERIVATIVES
  vec3 slope = gradient(volume, voxel);
  sums.by_source += slope;
  sums.by_way += t * slope;
#endif
}

void scale(float factor, inout Sums sums) {
  sums.value *= factor;
#ifdef DERIVATIVES
  sums.by_source *= factor;
  sums.by_way *= factor;
#endif
}

// The line integral, and its derivatives by the source and the way in voxels.
Sums along(vec3 source, vec3 way, sampler3D volume, float unit_per_mm) {
  // The part of the ray inside the box. A component of 0 gives infinities, which min and max put in their place.
  vec3 at_low = (box_low - source) / way;
  vec3 at_high = (box_high - source) / way;
  vec3 enters = min(at_low, at_high);
  vec3 leaves = max(at_low, at_high);
  float begin = max(max(enters.x, enters.y), max(enters.z, 0.0));
  float end = min(min(leaves.x, leaves.y), min(leaves.z, 1.0));
  if (!(begin < end)) return nothing();

  float way_mm = length(mm_from_voxel_axes * way);
  int steps = max(1, int(ceil((end - begin) * way_mm / step_mm)));
  float step_t = (end - begin) / float(steps);

  // The walk: t at which the ray enters the next block along each axis.
  vec3 entry = (source + begin * way + 1.0) / float(kBlockEdge);
  ivec3 last_block = textureSize(occupied, 0) - 1;
  ivec3 block = clamp(ivec3(floor(entry)), ivec3(0), last_block);
  ivec3 direction = ivec3(sign(way));
  vec3 t_per_block = float(kBlockEdge) / max(abs(way), vec3(1e-20));
  vec3 next_face = (vec3(block + max(direction, ivec3(0))) * float(kBlockEdge) - 1.0 - source) / way;
  vec3 next_t = mix(next_face, vec3(1e30), equal(way, vec3(0.0)));

  // Whole runs of occupied blocks are sampled in one loop: neighboring rays then stay together for most of their way.
  Sums sums = nothing();
  int next = 0;  // the first sample behind the blocks walked through; the middle of step n lies at begin + (n + 1/2) step_t
  while (next < steps) {
    bool run = texelFetch(occupied, block, 0).r > 0.0;
    int first = next;
    do {
      float exit = min(next_t.x, min(next_t.y, next_t.z));
      next = clamp(int(ceil((exit - begin) / step_t - 0.5)), next, steps);
      bvec3 leaving = lessThanEqual(next_t, vec3(exit));
      block += direction * ivec3(leaving);
      next_t += t_per_block * vec3(leaving);
      if (any(lessThan(block, ivec3(0))) || any(greaterThan(block, last_block))) next = steps;
    } while (next < steps && (texelFetch(occupied, block, 0).r > 0.0) == run);
    if (!run) continue;
    // The texture units fetch several samples at once where a loop's end is known when it is compiled.
    for (; first + kAtOnce <= next; first += kAtOnce)
      for (int n = 0; n < kAtOnce; ++n)
        add_sample(source, way, begin + (float(first + n) + 0.5) * step_t, volume, sums);
    for (; first < next; ++first) add_sample(source, way, begin + (float(first) + 0.5) * step_t, volume, sums);
  }
  scale(step_t * way_mm * unit_per_mm, sums);
  return sums;
}

#ifdef DERIVATIVES
// A point x of the room meets the voxel that was at x - translation - rotation x x before the patient moved.
void put_derivatives(Sums sums, Room room, vec3 position, uint at) {
  vec3 by_source = mat3(room.room_from_gradient) * sums.by_source;
  vec3 by_way = mat3(room.room_from_gradient) * sums.by_way;
  vec3 source = room.room_from_pixel[3].xyz + position.y * room.row_step.xyz;
  vec3 turned = cross(source, by_source) + cross(mat3(room.room_from_pixel) * position, by_way);
  for (int axis = 0; axis < 3; ++axis) {
    derivatives[6u * at + uint(axis)] = -by_source[axis];
    derivatives[6u * at + 3u + uint(axis)] = -turned[axis];
  }
}
#endif

void main() {
  // Strides instead of one thread per ray: group counts have limits, poses and pixels have none.
  for (uint pose = poses.x + gl_WorkGroupID.y; pose < poses.y; pose += gl_NumWorkGroups.y) {
    for (uint n = rays.x + gl_GlobalInvocationID.x; n < rays.y; n += gl_NumWorkGroups.x * gl_WorkGroupSize.x) {
      uint view = 0u;
      while (view + 1u < view_count && n >= views[view + 1u].first_pixel) ++view;
      uint place = n - views[view].first_pixel;
      uint columns = views[view].columns;
      // The 64 rays of a group read voxels close to each other if they make a square of pixels.
      if (views[view].in_squares != 0u) {
        uint square = place / 64u, inside = place % 64u;
        place = (square / (columns / 8u) * 8u + inside / 8u) * columns + square % (columns / 8u) * 8u + inside % 8u;
      }
      uint pixel = has_pixel_list != 0u ? pixels[n] : place;
      vec3 position = vec3(float(pixel % columns), float(pixel / columns), 1.0);
      Camera camera = cameras[pose * view_count + view];
      vec3 source = camera.voxel_from_pixel[3].xyz + position.y * camera.row_step.xyz;
      vec3 way = mat3(camera.voxel_from_pixel) * position;
      Sums sums;
      if (views[view].is_mv != 0u)
        sums = along(source, way, mv_attenuation, units_per_mm.y);
      else
        sums = along(source, way, kv_attenuation, units_per_mm.x);
      uint at = pose * pixels_per_pose + views[view].first_pixel + place;
      line_integrals[at] = sums.value;
#ifdef DERIVATIVES
      put_derivatives(sums, rooms[pose * view_count + view], position, at);
#endif
    }
  }
}
