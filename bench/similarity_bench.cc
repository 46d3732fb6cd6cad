// One comparison of an X-ray's pixels with a DRR's, per kind of similarity: 3,000 pixels are those of a coarse stage,
// 40,000 the whole field of two thirds of a 768 x 768 view at 1.2 mm, 590,000 a view of 768 x 768.

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <cmath>
#include <numeric>
#include <random>

#include "registration/similarity/similarity.h"

namespace isoshift {
namespace {

// Smooth structure and noise, as a row of pixels 256 long would have.
std::vector<float> pixels_of(int count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<float> noise(0.0F, 0.05F);
  std::vector<float> pixels;
  pixels.reserve(static_cast<std::size_t>(count));
  for (int n = 0; n < count; ++n)
    pixels.push_back(2.0F + std::sin(0.05F * static_cast<float>(n % 256)) + noise(random));
  return pixels;
}

void compare(benchmark::State& state, SimilarityKind kind) {
  const auto count = static_cast<int>(state.range(0));
  const std::vector<float> drr = pixels_of(count, 2);
  std::vector<Neighbors> neighbors;
  for (std::uint32_t n = 256; n + 256 < drr.size(); ++n) neighbors.push_back({n - 1, n + 1, n - 256, n + 256});
  const Comparison comparison(kind, pixels_of(count, 1), neighbors, range_of(drr));
  for (auto _ : state) benchmark::DoNotOptimize(comparison.of(drr));
  state.counters["pixels/s"] =
      benchmark::Counter(static_cast<double>(count), benchmark::Counter::kIsIterationInvariantRate);
}

const bool kRegistered = [] {
  for (const SimilarityKind kind : kSimilarityKinds)
    benchmark::RegisterBenchmark(fmt::format("similarity/{}", to_string(kind)).c_str(), compare, kind)
        ->Arg(3000)
        ->Arg(40000)
        ->Arg(590000)
        ->UseRealTime()
        ->Unit(benchmark::kMicrosecond);
  return true;
}();

}  // namespace
}  // namespace isoshift
