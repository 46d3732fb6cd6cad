// comparison.glsl: what comes before similarity.comp and correlation_sums.comp: the views, the DRRs' line integrals
// (dimensionless) where the ray caster left them, sums over a work group, and places among the bins of histograms.

layout(local_size_x = 256) in;

struct View {
  uint first_pixel;     // where its line integrals begin among those of one pose
  uint first_compared;  // where what they are compared with begins
  uint compared;        // pixels
  float low, per_unit;  // the range of histograms: Range of histogram.h
};

layout(std430, binding = 0) readonly buffer LineIntegrals { float line_integrals[]; };  // [pose][view][pixel]
layout(std430, binding = 1) readonly buffer Views { View views[]; };

#if !defined(MUTUAL_INFORMATION) && !defined(NORMALIZED_MUTUAL_INFORMATION)
// The X-ray's values, less their mean and divided by their norm; 0 where they are constant.
layout(std430, binding = 2) readonly buffer Xray { float xray[]; };
#endif
#ifdef GRADIENT_CORRELATION
const uint kLists = 2u;  // along rows, then along columns
layout(std430, binding = 3) readonly buffer Pairs { uvec2 pairs[]; };  // the pixels before and behind
#else
const uint kLists = 1u;
#endif

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

#if defined(RANK_CORRELATION) || defined(RANK_MIDDLES)

const int kRankBins = int(kGroupSize);  // 256, as in histogram.h: one for each invocation
shared uint counts[kRankBins];
shared float rank_of_bin[kRankBins];

// The rank at the middle of every bin: that of half its pixels.
void rank_bins() {
  uint me = gl_LocalInvocationIndex;
  counts[me] = 0u;
  wait_for_group();
  for (uint n = me; n < view.compared; n += kGroupSize) {
    Place place = place_of(drr(n), kRankBins);
    atomicAdd(counts[place.lower], kSharesPerPixel - place.shares);
    atomicAdd(counts[place.lower + 1u], place.shares);
  }
  wait_for_group();
  uint below = 0u;
  for (uint bin = 0u; bin < me; ++bin) below += counts[bin];
  rank_of_bin[me] = (float(below) + 0.5 * float(counts[me])) / float(kSharesPerPixel) - 0.5;
  wait_for_group();
}

#endif
