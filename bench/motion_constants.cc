// motion_constants TRACE.csv...: chooses the predictors' constants leaving one session out each time, as docs/motion.md
// reports. A session is what a file's name says up to the first '-'. The figure is the RMSE as a share of hold-last's,
// mean RMSE over traces, mean over 200, 300 and 500 ms.

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "io/study/motion_trace.h"
#include "registration/motion/score.h"

namespace {

using namespace isoshift;

constexpr std::array kLatenciesS = {0.2, 0.3, 0.5};

struct Candidate {
  std::string name;
  PredictorKind kind;
  PredictorOptions options;
};

std::vector<Candidate> candidates() {
  std::vector<Candidate> list;
  for (const double noise : {400.0, 600.0, 900.0, 1400.0, 2000.0})
    list.push_back(
        {fmt::format("acceleration noise {:g}", noise), PredictorKind::kKalman, {.acceleration_noise = noise}});
  for (const int taps : {4, 5, 6, 8, 12})
    for (const double forgetting : {0.999, 0.9995, 1.0})
      list.push_back({fmt::format("{} taps, forgetting {}", taps, forgetting),
                      PredictorKind::kRls,
                      {.taps = taps, .forgetting = forgetting}});
  for (const double phase : {0.5, 1.0, 2.0})
    for (const double offset : {3.0, 10.0, 30.0})
      list.push_back({fmt::format("phase noise {}, offset noise {}", phase, offset),
                      PredictorKind::kModel,
                      {.phase_noise = phase, .offset_noise = offset}});
  return list;
}

}  // namespace

// Long because it is one measurement, read from top to bottom.
int main(int argc, char** argv) {
  std::vector<std::vector<MotionSample>> traces;
  std::vector<std::string> sessions;
  Notes notes;
  for (int n = 1; n < argc; ++n) {
    const std::filesystem::path path = argv[n];
    traces.push_back(read_motion_trace(path, notes));
    const std::string name = path.stem().string();
    sessions.push_back(name.substr(0, name.find('-')));
  }
  if (traces.empty()) return std::fputs("motion_constants TRACE.csv...\n", stderr), 2;
  std::vector<Candidate> all = candidates();
  all.push_back({"", PredictorKind::kHoldLast, {}});
  // RMSE by candidate, latency and trace.
  std::vector<std::vector<std::vector<double>>> rmse(all.size());
  parallel_for(std::size_t{0}, all.size(), [&](std::size_t c) {
    for (const double latency_s : kLatenciesS) {
      rmse[c].emplace_back();
      for (const auto& trace : traces)
        rmse[c].back().push_back(score(all[c].kind, all[c].options, trace, latency_s, {}).rmse_mm);
    }
  });
  // Share of hold-last over some traces, by latency.
  const auto share = [&](std::size_t c, std::size_t latency, const std::set<std::string>& of_sessions) {
    double sum = 0.0, hold = 0.0;
    for (std::size_t t = 0; t < traces.size(); ++t)
      if (of_sessions.contains(sessions[t])) {
        sum += rmse[c][latency][t];
        hold += rmse.back()[latency][t];
      }
    return sum / hold;
  };
  const std::set<std::string> every(sessions.begin(), sessions.end());
  for (const PredictorKind kind : {PredictorKind::kKalman, PredictorKind::kRls, PredictorKind::kModel}) {
    const auto best_on = [&](const std::set<std::string>& of_sessions) {
      std::size_t best = 0;
      double least = 1e300;
      for (std::size_t c = 0; c + 1 < all.size(); ++c) {
        if (all[c].kind != kind) continue;
        double mean = 0.0;
        for (std::size_t latency = 0; latency < kLatenciesS.size(); ++latency)
          mean += share(c, latency, of_sessions) / 3.0;
        if (mean < least) {
          least = mean;
          best = c;
        }
      }
      return best;
    };
    fmt::print("{}\n", to_string(kind));
    std::array<double, kLatenciesS.size()> sum{}, hold{};
    for (const std::string& left_out : every) {
      std::set<std::string> others = every;
      others.erase(left_out);
      const std::size_t best = best_on(others);
      fmt::print("  without {}: {}\n", left_out, all[best].name);
      for (std::size_t latency = 0; latency < kLatenciesS.size(); ++latency)
        for (std::size_t t = 0; t < traces.size(); ++t)
          if (sessions[t] == left_out) {
            sum[latency] += rmse[best][latency][t];
            hold[latency] += rmse.back()[latency][t];
          }
    }
    fmt::print("  left-out sessions, share of hold-last at 200, 300, 500 ms: {:.3f} {:.3f} {:.3f}\n", sum[0] / hold[0],
               sum[1] / hold[1], sum[2] / hold[2]);
    const std::size_t best = best_on(every);
    fmt::print("  on all: {}: {:.3f} {:.3f} {:.3f}\n", all[best].name, share(best, 0, every), share(best, 1, every),
               share(best, 2, every));
  }
}
