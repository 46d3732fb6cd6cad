#include "io/dicom/ct_doubts.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>

#include "base/parallel.h"

namespace isoshift {
namespace {

constexpr float kMostHu = 32767.0F;  // scanners keep HU as signed numbers of 16 bits
constexpr float kMetalHu = 4000.0F;  // no bone or tooth has more
constexpr float kMostAirHu = -200.0F;

// Whether there is air in the rows before and behind a voxel, and in the slices beside it. Metal blurs into these;
// bytes that were lost lie along a row.
bool lies_in_air(const Volume<float>& hu, int i, int j, int k) {
  const auto is_air = [&](int row, int slice) {
    const bool is_inside = row >= 0 && row < hu.size.y() && slice >= 0 && slice < hu.size.z();
    return !is_inside || hu.at(i, row, slice) < kMostAirHu;
  };
  return is_air(j - 1, k) && is_air(j + 1, k) && is_air(j, k - 1) && is_air(j, k + 1);
}

}  // namespace

std::vector<std::string> ct_doubts(const Volume<float>& hu) {
  std::atomic<int> too_large = 0, in_air = 0;
  parallel_for(0, hu.size.z(), [&](int k) {
    for (int j = 0; j < hu.size.y(); ++j)
      for (int i = 0; i < hu.size.x(); ++i) {
        const float value = hu.at(i, j, k);
        if (value <= kMetalHu) continue;
        if (value > kMostHu) ++too_large;
        if (lies_in_air(hu, i, j, k)) ++in_air;
      }
  });
  std::vector<std::string> doubts;
  if (too_large > 0)
    doubts.push_back(
        fmt::format("{} voxels of the CT have more than {} HU: no scanner writes such numbers, and its "
                    "pixels may be damaged",
                    too_large.load(), kMostHu));
  if (in_air > 0)
    doubts.push_back(
        fmt::format("{} voxels of the CT have more than {} HU in the midst of air: its pixels may be damaged",
                    in_air.load(), kMetalHu));
  return doubts;
}

}  // namespace isoshift
