// similarity.comp: how alike the DRRs of one call and the X-rays are, one number per pose and view, as similarity.cc
// defines it. A work group per pose (x) and view (y) reads the view's line integrals (dimensionless) where the ray caster
// left them. Sums of floats run in one order, counts are of integers: the same input gives the same number.
//
// Stands behind comparison.glsl. One of NCC, GRADIENT_CORRELATION, RANK_CORRELATION (Birkfellner et al. 2009),
// MUTUAL_INFORMATION and NORMALIZED_MUTUAL_INFORMATION is defined (docs/algorithms.md, "Similarities").

layout(std430, binding = 4) writeonly buffer Result { float similarities[]; };  // [pose][view]

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

#if defined(GRADIENT_CORRELATION)

void prepare() {}

float value(uint list, uint n) {
  uvec2 pair = pairs[view.first_compared + list * view.compared + n];
  return drr(pair.y) - drr(pair.x);
}

#elif defined(RANK_CORRELATION)

void prepare() { rank_bins(); }

float value(uint list, uint n) {
  Place place = place_of(drr(n), kRankBins);
  return mix(rank_of_bin[place.lower], rank_of_bin[place.lower + 1u], place.beyond);
}

#else  // NCC

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
