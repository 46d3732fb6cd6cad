// correlation_sums.comp: what the models of correlations need of a view (correlation_model.h), as similarity_model.cc defines
// them: sums, over the pixels compared, of all products of two of nine numbers: 1, the X-ray's value, the DRR's, and how
// the DRR's changes with the six motions of the patient. A work group adds up a tile of pixels; the host adds up the tiles,
// in double precision. Sums run in one order: the same input gives the same numbers.
//
// Stands behind comparison.glsl. One of NCC, GRADIENT_CORRELATION and RANK_CORRELATION is defined; or RANK_MIDDLES, which
// comes before the last of them: a work group per pose and view leaves what the bins of its histogram make of pixels.

layout(std430, binding = 5) readonly buffer Derivatives { float derivatives[]; };  // [pose][view][pixel][6]

const uint kMotions = 6u;

float derivative(uint n, uint motion) { return derivatives[kMotions * (first_line_integral + n) + motion]; }

#if defined(RANK_CORRELATION) || defined(RANK_MIDDLES)

// The rank at the middle of a bin, and how it changes with the motions.
struct Middle {
  float rank;
  float by_motion[kMotions];
};

// How far a value moves among the bins, per unit; 0 beyond their range.
float bins_per_unit(float value) {
  float share = (value - view.low) * view.per_unit;
  return share > 0.0 && share < 1.0 ? view.per_unit * float(kRankBins - 1) : 0.0;
}

#endif

#ifdef RANK_MIDDLES

layout(std430, binding = 7) writeonly buffer Middles { Middle middles[]; };  // [pose][view][bin]

shared int moved[kRankBins * int(kMotions)];  // shares of pixels from each bin to the next, by every motion, in units

vec2 most_of_group(vec2 own) {
  uint me = gl_LocalInvocationIndex;
  wait_for_group();
  of_invocation[me] = own;
  wait_for_group();
  for (uint others = kGroupSize / 2u; others > 0u; others /= 2u) {
    if (me < others) of_invocation[me] = max(of_invocation[me], of_invocation[me + others]);
    wait_for_group();
  }
  return of_invocation[0];
}

void main() {
  uint me = gl_LocalInvocationIndex;
  uint pose = first_pose + gl_WorkGroupID.x;
  view = views[gl_WorkGroupID.y];
  first_line_integral = pose * pixels_per_pose + view.first_pixel;
  rank_bins();

  // Sums of integers do not depend on their order. The unit is as small as no sum can exceed: of translations and rotations.
  vec2 most = vec2(0.0);
  for (uint n = me; n < view.compared; n += kGroupSize) {
    float bins = bins_per_unit(drr(n));
    for (uint motion = 0u; motion < kMotions; ++motion)
      most[motion / 3u] = max(most[motion / 3u], abs(bins * derivative(n, motion)));
  }
  most = max(most_of_group(most), vec2(1e-30));
  vec2 per_unit = exp2(30.0) / (most * float(max(1u, view.compared)));

  for (uint motion = 0u; motion < kMotions; ++motion) moved[kMotions * me + motion] = 0;
  wait_for_group();
  for (uint n = me; n < view.compared; n += kGroupSize) {
    float bins = bins_per_unit(drr(n));
    uint lower = place_of(drr(n), kRankBins).lower;
    for (uint motion = 0u; motion < kMotions; ++motion)
      atomicAdd(moved[kMotions * lower + motion], int(round(bins * derivative(n, motion) * per_unit[motion / 3u])));
  }
  wait_for_group();

  // A share that moves from bin b to the next lowers the ranks at the middles of both by half of that.
  Middle middle;
  middle.rank = rank_of_bin[me];
  for (uint motion = 0u; motion < kMotions; ++motion) {
    float from_here = float(moved[kMotions * me + motion]);
    float to_here = me > 0u ? float(moved[kMotions * (me - 1u) + motion]) : 0.0;
    middle.by_motion[motion] = -0.5 * (from_here + to_here) / per_unit[motion / 3u];
  }
  middles[(pose * view_count + gl_WorkGroupID.y) * uint(kRankBins) + me] = middle;
}

#else

struct Tile {
  uint view, list;
  uint first, end;  // among the pixels compared
};

layout(std430, binding = 4) writeonly buffer Sums { float sums[]; };  // [pose][tile][kProducts]
layout(std430, binding = 6) readonly buffer Tiles { Tile tiles[]; };
#ifdef RANK_CORRELATION
layout(std430, binding = 7) readonly buffer Middles { Middle middles[]; };  // [pose][view][bin]
#endif

layout(location = 3) uniform uint tile_count;

const uint kNumbers = 9u;
const uint kProducts = kNumbers * (kNumbers + 1u) / 2u;
const uint kParts = 4u, kOfPart = kGroupSize / kParts;  // a part of the work group takes a part of the pixels

// Of as many pixels as the work group has invocations. Odd rows fall into different banks of memory.
shared float numbers[kNumbers][kGroupSize + 1u];
shared float of_part[kGroupSize];

#if defined(GRADIENT_CORRELATION)

float value(uint list, uint n) {
  uvec2 pair = pairs[view.first_compared + list * view.compared + n];
  return drr(pair.y) - drr(pair.x);
}

float slope(uint list, uint n, uint motion) {
  uvec2 pair = pairs[view.first_compared + list * view.compared + n];
  return derivative(pair.y, motion) - derivative(pair.x, motion);
}

#elif defined(RANK_CORRELATION)

uint first_middle;

float value(uint list, uint n) {
  Place place = place_of(drr(n), kRankBins);
  return mix(middles[first_middle + place.lower].rank, middles[first_middle + place.lower + 1u].rank, place.beyond);
}

// A pixel that moves among the bins changes its own rank, and the middles between which it lies change, too.
float slope(uint list, uint n, uint motion) {
  Place place = place_of(drr(n), kRankBins);
  uint lower = first_middle + place.lower;
  float own = bins_per_unit(drr(n)) * derivative(n, motion) * (middles[lower + 1u].rank - middles[lower].rank);
  return own + mix(middles[lower].by_motion[motion], middles[lower + 1u].by_motion[motion], place.beyond);
}

#else  // NCC

float value(uint list, uint n) { return drr(n); }
float slope(uint list, uint n, uint motion) { return derivative(n, motion); }

#endif

// Row and column of a product in the lower triangle.
uvec2 factors_of(uint product) {
  uint row = 0u;
  while ((row + 1u) * (row + 2u) / 2u <= product) ++row;
  return uvec2(row, product - row * (row + 1u) / 2u);
}

void main() {
  uint me = gl_LocalInvocationIndex;
  uint pose = first_pose + gl_WorkGroupID.x;
  Tile tile = tiles[gl_WorkGroupID.y];
  view = views[tile.view];
  first_line_integral = pose * pixels_per_pose + view.first_pixel;
#ifdef RANK_CORRELATION
  first_middle = (pose * view_count + tile.view) * uint(kRankBins);
#endif
  uint product = me % kOfPart, part = me / kOfPart;
  uvec2 factors = factors_of(min(product, kProducts - 1u));
  // Counted from the first value: squares of large line integrals would cancel.
  float origin = value(tile.list, 0u);
  float sum = 0.0;
  for (uint first = tile.first; first < tile.end; first += kGroupSize) {
    uint n = first + me;
    bool is_there = n < tile.end;
    wait_for_group();  // until the numbers before are read
    numbers[0][me] = is_there ? 1.0 : 0.0;
    numbers[1][me] = is_there ? xray[view.first_compared + tile.list * view.compared + n] : 0.0;
    numbers[2][me] = is_there ? value(tile.list, n) - origin : 0.0;
    for (uint motion = 0u; motion < kMotions; ++motion)
      numbers[3u + motion][me] = is_there ? slope(tile.list, n, motion) : 0.0;
    wait_for_group();
    for (uint at = part * kOfPart; at < (part + 1u) * kOfPart; ++at)
      sum += numbers[factors.x][at] * numbers[factors.y][at];
  }
  of_part[me] = sum;
  wait_for_group();
  if (me >= kProducts) return;
  float all = 0.0;
  for (uint n = 0u; n < kParts; ++n) all += of_part[n * kOfPart + me];
  sums[(pose * tile_count + gl_WorkGroupID.y) * kProducts + me] = all;
}

#endif
