// similarity.comp: how alike the DRRs of one call and the X-rays are, one number per pose and view, as similarity.cc
// defines it. A work group per pose (x) and view (y) reads the view's line integrals (dimensionless) where the ray caster
// left them. Sums of floats run in one order, counts are of integers: the same input gives the same number.
//
// One of NCC, GRADIENT_CORRELATION, RANK_CORRELATION (Birkfellner et al. 2009), MUTUAL_INFORMATION and
// NORMALIZED_MUTUAL_INFORMATION is defined (docs/algorithms.md, "Similarities").

layout(local_size_x = 256) in;

struct View {
  uint first_pixel;     // where its line integrals begin among those of one pose
  uint first_compared;  // where what they are compared with begins
  uint compared;        // pixels
  float low, per_unit;  // the range of histograms: Range of histogram.h
};

layout(std430, binding = 0) readonly buffer LineIntegrals { float line_integrals[]; };  // [pose][view][pixel]
layout(std430, binding = 1) readonly buffer Views { View views[]; };
layout(std430, binding = 4) writeonly buffer Result { float similarities[]; };          // [pose][view]

layout(location = 0) uniform uint first_pose;
layout(location = 1) uniform uint view_count;
layout(location = 2) uniform uint pixels_per_pose;

const uint kGroupSize = gl_WorkGroupSize.x;

View view;
uint first_line_integral;
float drr(uint n) { return line_integrals[first_line_integral + n]; }

void wait_for_group() {
  memoryBarrierShared();
  barrier();
}

// Sums over the group, in a tree, given to all of it.
shared vec2 of_invocation[kGroupSize];

vec2 sum_over_group(vec2 own) {
  uint me = gl_LocalInvocationIndex;
  wait_for_group();  // until the last result is read
  of_invocation[me] = own;
  wait_for_group();
  for (uint others = kGroupSize / 2u; others > 0u; others /= 2u) {
    if (me < others) of_invocation[me] += of_invocation[me + others];
    wait_for_group();
  }
  return of_invocation[0];
}

// Where a value lies among bins: at `lower` plus a share of the way to the next. The CPU rounds as this does
// (place_of() in histogram.cc), else pixels fall to either side of a bin's middle.
struct Place {
  uint lower;
  float beyond;
  uint shares;  // of the next bin
};

const uint kSharesPerPixel = 256u;  // as in histogram.h

Place place_of(float value, int bins) {
  precise float per_unit = view.per_unit * float(bins - 1);
  precise float place = clamp((value - view.low) * per_unit, 0.0, float(bins - 1));
  int lower = min(bins - 2, int(place));
  precise float beyond = place - float(lower);
  precise float shares = beyond * float(kSharesPerPixel) + 0.5;
  return Place(uint(lower), beyond, uint(shares));
}

#if defined(MUTUAL_INFORMATION) || defined(NORMALIZED_MUTUAL_INFORMATION)

layout(std430, binding = 2) readonly buffer Xray { uint xray_bins[]; };

const int kBins = 32;  // as in similarity.h

shared uint joint[kBins * kBins];  // [X-ray][DRR]

// What a cell adds to an entropy, in nats.
float of_cell(uint count) {
  if (count == 0u) return 0.0;
  float probability = float(count) / (float(view.compared) * float(kSharesPerPixel));
  return -probability * log(probability);
}

float similarity() {
  for (uint n = gl_LocalInvocationIndex; n < uint(kBins * kBins); n += kGroupSize) joint[n] = 0u;
  wait_for_group();
  for (uint n = gl_LocalInvocationIndex; n < view.compared; n += kGroupSize) {
    Place place = place_of(drr(n), kBins);
    uint at = xray_bins[view.first_compared + n] * uint(kBins) + place.lower;
    atomicAdd(joint[at], kSharesPerPixel - place.shares);
    atomicAdd(joint[at + 1u], place.shares);
  }
  wait_for_group();

  vec2 entropies = vec2(0.0);  // of the X-ray plus that of the DRR, and of both together
  for (uint n = gl_LocalInvocationIndex; n < uint(kBins * kBins); n += kGroupSize) entropies.y += of_cell(joint[n]);
  if (gl_LocalInvocationIndex < uint(kBins)) {
    uint of_xray = 0u, of_drr = 0u;
    for (uint n = 0u; n < uint(kBins); ++n) {
      of_xray += joint[gl_LocalInvocationIndex * uint(kBins) + n];
      of_drr += joint[n * uint(kBins) + gl_LocalInvocationIndex];
    }
    entropies.x = of_cell(of_xray) + of_cell(of_drr);
  }
  entropies = sum_over_group(entropies);
#ifdef MUTUAL_INFORMATION
  return entropies.x - entropies.y;
#else
  return entropies.y > 0.0 ? entropies.x / entropies.y : 1.0;
#endif
}

#else

// The X-ray's values, less their mean and divided by their norm; 0 where they are constant.
layout(std430, binding = 2) readonly buffer Xray { float xray[]; };

#if defined(GRADIENT_CORRELATION)

const uint kLists = 2u;  // along rows, then along columns
layout(std430, binding = 3) readonly buffer Pairs { uvec2 pairs[]; };  // the pixels before and behind

void prepare() {}

float value(uint list, uint n) {
  uvec2 pair = pairs[view.first_compared + list * view.compared + n];
  return drr(pair.y) - drr(pair.x);
}

#elif defined(RANK_CORRELATION)

const uint kLists = 1u;
const int kBins = int(kGroupSize);  // 256, as in histogram.h: one for each invocation
shared uint counts[kBins];
shared float rank_of_bin[kBins];

// The rank at the middle of every bin: that of half its pixels.
void prepare() {
  uint me = gl_LocalInvocationIndex;
  counts[me] = 0u;
  wait_for_group();
  for (uint n = me; n < view.compared; n += kGroupSize) {
    Place place = place_of(drr(n), kBins);
    atomicAdd(counts[place.lower], kSharesPerPixel - place.shares);
    atomicAdd(counts[place.lower + 1u], place.shares);
  }
  wait_for_group();
  uint below = 0u;
  for (uint bin = 0u; bin < me; ++bin) below += counts[bin];
  rank_of_bin[me] = (float(below) + 0.5 * float(counts[me])) / float(kSharesPerPixel) - 0.5;
  wait_for_group();
}

float value(uint list, uint n) {
  Place place = place_of(drr(n), kBins);
  return mix(rank_of_bin[place.lower], rank_of_bin[place.lower + 1u], place.beyond);
}

#else  // NCC

const uint kLists = 1u;
void prepare() {}
float value(uint list, uint n) { return drr(n); }

#endif

float correlation(uint list) {
  // Counted from the first value: a list of equal ones then has a variance of exactly 0.
  float origin = value(list, 0u);
  float sum = 0.0;
  for (uint n = gl_LocalInvocationIndex; n < view.compared; n += kGroupSize) sum += value(list, n) - origin;
  float mean = sum_over_group(vec2(sum, 0.0)).x / float(view.compared);
  // A second pass about the mean: sums of squares of large line integrals would cancel.
  vec2 sums = vec2(0.0);  // the variance and the covariance
  for (uint n = gl_LocalInvocationIndex; n < view.compared; n += kGroupSize) {
    float deviation = value(list, n) - origin - mean;
    sums += deviation * vec2(deviation, xray[view.first_compared + list * view.compared + n]);
  }
  sums = sum_over_group(sums);
  return sums.x > 0.0 ? clamp(sums.y / sqrt(sums.x), -1.0, 1.0) : 0.0;
}

float similarity() {
  prepare();
  float sum = 0.0;
  for (uint list = 0u; list < kLists; ++list) sum += correlation(list);
  return sum / float(kLists);
}

#endif

void main() {
  uint pose = first_pose + gl_WorkGroupID.x;
  view = views[gl_WorkGroupID.y];
  first_line_integral = pose * pixels_per_pose + view.first_pixel;
#ifdef NORMALIZED_MUTUAL_INFORMATION
  float result = 1.0;  // where nothing is compared
#else
  float result = 0.0;
#endif
  if (view.compared > 0u) result = similarity();
  if (gl_LocalInvocationIndex == 0u) similarities[pose * view_count + gl_WorkGroupID.y] = result;
}
