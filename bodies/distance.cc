#include "bodies/distance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/parallel.h"

namespace isoshift {
namespace {

constexpr float kNone = 1e18F;  // squared, where there is no target

// The lower envelope of the parabolas (x - q)^2 + f(q), sampled at every x.
class Envelope {
 public:
  explicit Envelope(int most) : values_(most), places_(most), from_(most + 1) {}

  void transform(float* line, std::ptrdiff_t stride, int size) {
    for (int q = 0; q < size; ++q) values_[q] = line[q * stride];
    int last = -1;
    for (int q = 0; q < size; ++q) {
      if (values_[q] >= kNone) continue;
      double begin = -std::numeric_limits<double>::infinity();
      while (last >= 0) {
        begin = crossing(places_[last], q);
        if (begin > from_[last]) break;
        --last;
      }
      if (last < 0) begin = -std::numeric_limits<double>::infinity();
      ++last;
      places_[last] = q;
      from_[last] = begin;
    }
    if (last < 0) return;
    int n = 0;
    for (int x = 0; x < size; ++x) {
      while (n < last && from_[n + 1] < x) ++n;
      const auto away = static_cast<float>(x - places_[n]);
      line[x * stride] = away * away + values_[places_[n]];
    }
  }

 private:
  double crossing(int p, int q) const {
    return (values_[q] + static_cast<double>(q) * q - values_[p] - static_cast<double>(p) * p) / (2.0 * (q - p));
  }
  std::vector<float> values_;
  std::vector<int> places_;
  std::vector<double> from_;
};

}  // namespace

Volume<float> distance_mm(const Volume<std::uint8_t>& is_target) {
  const Eigen::Vector3i& size = is_target.size;
  Volume<float> squared(size, is_target.patient_from_voxel);
  std::ranges::transform(is_target.voxels, squared.voxels.begin(),
                         [](std::uint8_t value) { return value != 0 ? 0.0F : kNone; });
  const int most = size.maxCoeff();
  const std::ptrdiff_t row = size.x(), slice = row * size.y();
  parallel_for(0, size.z(), [&](int k) {
    Envelope envelope(most);
    for (int j = 0; j < size.y(); ++j) envelope.transform(&squared.at(0, j, k), 1, size.x());
    for (int i = 0; i < size.x(); ++i) envelope.transform(&squared.at(i, 0, k), row, size.y());
  });
  parallel_for(0, size.y(), [&](int j) {
    Envelope envelope(most);
    for (int i = 0; i < size.x(); ++i) envelope.transform(&squared.at(i, j, 0), slice, size.z());
  });
  const auto edge_mm = static_cast<float>(is_target.spacing_mm().x());
  for (float& value : squared.voxels) value = value >= kNone ? 1e9F : edge_mm * std::sqrt(value);
  return squared;
}

Volume<float> depth_mm(const Volume<std::uint8_t>& mask) {
  Volume<std::uint8_t> outside = mask;
  for (std::uint8_t& value : outside.voxels) value = value == 0 ? 1 : 0;
  return distance_mm(outside);
}

}  // namespace isoshift
