#include "bodies/disc_comb.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

namespace isoshift {
namespace {

// Vertebrae with their discs are 13 to 45 mm high, from the neck to the loin.
constexpr int kLeast = 13, kMost = 45;

using Profile = std::vector<float>;

// NaN counts as nothing.
Profile blurred(const Profile& values, double sigma_mm) {
  const int reach = static_cast<int>(std::ceil(3.0 * sigma_mm)), size = static_cast<int>(values.size());
  Profile result(values.size(), std::numeric_limits<float>::quiet_NaN());
  for (int s = 0; s < size; ++s) {
    double sum = 0.0, weights = 0.0;
    for (int n = std::max(0, s - reach); n <= std::min(size - 1, s + reach); ++n) {
      if (std::isnan(values[n])) continue;
      const double weight = std::exp(-0.5 * (n - s) * (n - s) / (sigma_mm * sigma_mm));
      sum += weight * values[n];
      weights += weight;
    }
    if (weights > 0.0 && !std::isnan(values[s])) result[s] = static_cast<float>(sum / weights);
  }
  return result;
}

// How much darker a place is than what lies a few mm above and below, for the best of several thicknesses of the disc.
struct Dips {
  Profile hu;
  std::vector<int> lean;
};

Dips dips_of(const LeaningProfiles& profiles, std::span<const int> half_thicknesses_mm) {
  const int size = static_cast<int>(profiles.front().size());
  Dips dips{Profile(size, 0.0F), std::vector<int>(size, static_cast<int>(profiles.size()) / 2)};
  for (int lean = 0; lean < static_cast<int>(profiles.size()); ++lean) {
    const Profile& p = profiles[lean];
    for (int s = 0; s < size; ++s)
      for (const int g : half_thicknesses_mm) {
        if (s - g < 0 || s + g >= size) continue;
        // The smaller side counts most: the end of a row of bones is a step, not a dip.
        const float low = std::min(p[s - g], p[s + g]), high = std::max(p[s - g], p[s + g]);
        const float dip = 0.75F * low + 0.25F * high - p[s];
        if (dip > dips.hu[s]) dips.hu[s] = dip, dips.lean[s] = lean;
      }
  }
  return dips;
}

// The best teeth: a sum of what each is worth, less for spacings that change. Dynamic programming over the place of a
// tooth and its distance from the one before.
std::vector<int> best_comb(const std::vector<double>& worth, const std::vector<double>& expected_mm) {
  const int size = static_cast<int>(worth.size()), spacings = kMost - kLeast + 1;
  constexpr double kChangeMm = 2.5;  // from one vertebra to the next, that costs as much as a tooth brings
  const double none = -1e9;
  std::vector<std::vector<double>> best(size, std::vector<double>(spacings, none));
  std::vector<std::vector<int>> from(size, std::vector<int>(spacings, -1));
  double most = none;
  int at = -1, with = 0;
  for (int s = 0; s < size; ++s)
    for (int p = 0; p < spacings; ++p) {
      const int before = s - (p + kLeast);
      if (before < 0) continue;
      // Unlike what is expected there, in units of a fifth.
      const double unlike = expected_mm[s] > 0.0 ? 5.0 * std::log((p + kLeast) / expected_mm[s]) : 0.0;
      const double cost = 0.5 * unlike * unlike;
      double value = worth[before] - cost;  // the first tooth
      for (int q = std::max(0, p - 7); q <= std::min(spacings - 1, p + 7); ++q) {
        const double change = (p - q) / kChangeMm / (0.04 * (p + kLeast));
        const double candidate = best[before][q] - 0.5 * change * change - cost;
        if (candidate > value) value = candidate, from[s][p] = q;
      }
      best[s][p] = value + worth[s];
      if (best[s][p] > most) most = best[s][p], at = s, with = p;
    }
  std::vector<int> teeth;
  while (at >= 0 && with >= 0) {
    teeth.push_back(at);
    const int next = at - (with + kLeast), q = from[at][with];
    at = next, with = q;
    if (q < 0) teeth.push_back(at);
  }
  std::ranges::reverse(teeth);
  return teeth;
}

// The share of the spine between the teeth that is darker than half-way from what is darkest to what is brightest
// between two teeth.
double dark_share(const Profile& profile, const std::vector<int>& teeth) {
  int dark = 0, all = 0;
  for (std::size_t n = 0; n + 1 < teeth.size(); ++n) {
    const auto [low, high] = std::minmax_element(profile.begin() + teeth[n], profile.begin() + teeth[n + 1]);
    const float middle = 0.5F * (*low + *high);
    for (int s = teeth[n]; s < teeth[n + 1]; ++s, ++all) dark += profile[s] < middle ? 1 : 0;
  }
  return all > 0 ? static_cast<double>(dark) / all : 0.0;
}

}  // namespace

std::vector<CombTooth> find_discs(const LeaningProfiles& profiles, int first, int end,
                                  const std::vector<double>& expected_mm) {
  const Profile& straight = profiles[profiles.size() / 2];
  const Profile near = blurred(straight, 2.5), wide = blurred(straight, 12.0);
  double sum = 0.0, count = 1e-9;
  for (int s = first; s < end; ++s)
    if (!std::isnan(near[s])) sum += std::abs(straight[s] - wide[s]), ++count;
  const double unit = std::max(20.0, sum / count);
  const auto comb_with = [&](const Dips& dips, double sign) {
    std::vector<double> worth(straight.size(), -10.0);
    for (int s = first; s < end; ++s)
      if (!std::isnan(near[s]))
        worth[s] = 0.8 * std::min(2.0, dips.hu[s] / unit) + sign * (near[s] - wide[s]) / unit - 0.7;
    return best_comb(worth, expected_mm);
  };
  const Dips thin = dips_of(profiles, std::array{3, 4}), thick = dips_of(profiles, std::array{3, 4, 5, 7});
  const std::vector<int> bright = comb_with(thin, 1.0), dark = comb_with(thick, -1.0);
  // Discs are thinner than vertebrae. Where the dark stretches are the longer ones, they are brittle vertebrae between
  // bright end plates.
  constexpr double kThinShare = 0.45;
  const bool is_dark = dark_share(straight, dark) < kThinShare;
  const Dips& dips = is_dark ? thick : thin;
  const std::vector<int>& teeth = is_dark ? dark : bright;
  constexpr float kLeastDipHu = 20.0F;  // of half of them; noise alone makes less, and the end of a bone is one step
  std::vector<float> dip_hu;
  dip_hu.reserve(teeth.size());
  for (const int s : teeth) dip_hu.push_back(dips.hu[s]);
  std::ranges::sort(dip_hu);
  if (dip_hu.empty() || dip_hu[(dip_hu.size() - 1) / 2] < kLeastDipHu) return {};
  std::vector<CombTooth> result;
  result.reserve(teeth.size());
  for (const int s : teeth) result.push_back({.at = s, .lean = dips.lean[s], .dip_hu = dips.hu[s], .is_dark = is_dark});
  return result;
}

}  // namespace isoshift
