#include "workflow/track/track_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

#include "base/median.h"
#include "io/report/line_chart.h"
#include "registration/motion/score.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

struct TruthErrors {
  PredictionScore measured;         // in the directions that were seen
  PredictionScore predicted, held;  // held: the last measurement, one latency later
};

// Over the second half of the time: the filters have learned by then.
TruthErrors beside_truth(const TrackRecord& record) {
  std::vector<double> measured, predicted, held;
  const double from_s = 0.5 * (record.rows.front().frame.time_s + record.rows.back().frame.time_s);
  std::optional<Eigen::Vector3d> last_mm;
  for (const auto& [frame, processing_s] : record.rows) {
    if (frame.measured_mm) last_mm = frame.measured_mm;
    if (frame.time_s < from_s || !frame.is_known) continue;
    const auto now = position_at(record.truth, frame.time_s);
    const auto later = position_at(record.truth, frame.time_s + record.tracking.latency_s);
    if (now && frame.measured_mm) {
      Eigen::Vector3d error_mm = *frame.measured_mm - *now;
      for (const Eigen::Vector3d& direction : frame.unseen_room) error_mm -= direction.dot(error_mm) * direction;
      measured.push_back(error_mm.norm());
    }
    if (!later) continue;
    predicted.push_back((frame.predicted_mm - *later).norm());
    held.push_back((*last_mm - *later).norm());
  }
  return {score_of(measured), score_of(predicted), score_of(held)};
}

Json errors_json(const PredictionScore& errors) {
  if (errors.samples == 0) return {{"median_mm", nullptr}, {"rmse_mm", nullptr}, {"p95_mm", nullptr}, {"samples", 0}};
  return {{"median_mm", errors.median_mm},
          {"rmse_mm", errors.rmse_mm},
          {"p95_mm", errors.p95_mm},
          {"samples", errors.samples}};
}

// When the beam would have to wait: the target, as predicted, farther from its plan than the tolerance, or lost. From
// the moment that says so to the one that ends it.
std::vector<std::pair<double, double>> holds_of(const TrackRecord& record, double tolerance_mm) {
  std::vector<std::pair<double, double>> holds;
  bool is_holding = false;
  for (const auto& [frame, processing_s] : record.rows) {
    const bool must_hold = !frame.is_known || frame.is_lost || frame.predicted_mm.norm() > tolerance_mm;
    const double at_s = frame.time_s + record.tracking.latency_s;
    if (must_hold && !is_holding) holds.emplace_back(at_s, at_s);
    if (must_hold || is_holding) holds.back().second = at_s;
    is_holding = must_hold;
  }
  return holds;
}

Json phases_json(const std::vector<Eigen::VectorXd>& phases_mm) {
  Json json = Json::array();
  for (const Eigen::VectorXd& mm : phases_mm) json.push_back({mm.x(), mm.y(), mm.z()});
  return json;
}

}  // namespace

Json track_json(const TrackRecord& record) {
  std::vector<double> times_s;
  std::map<std::string_view, std::size_t> by_status;
  std::size_t over_budget = 0;
  Json warm_from_s;  // null: it never was
  for (const auto& [frame, processing_s] : record.rows) {
    times_s.push_back(processing_s);
    ++by_status[to_string(frame.status)];
    over_budget += processing_s > record.budget_s;
    if (frame.is_warm && warm_from_s.is_null()) warm_from_s = frame.time_s;
  }
  const auto moments = static_cast<double>(times_s.size());
  Json json = {
      {"schema", 1},
      {"frames", record.rows.size()},
      {"imagers", record.imagers},
      {"status", by_status},
      {"predictor", to_string(record.tracking.predictor)},
      {"predictor_warm_from_s", warm_from_s},
      {"latency_ms", 1000.0 * record.tracking.latency_s},
      {"dof", record.tracking.dof == Dof::kRigid ? "rigid" : "translation"},
      {"processing_s",
       {{"median", quantile(times_s, 0.5)},
        {"p95", quantile(times_s, 0.95)},
        {"max", std::ranges::max(times_s)},
        {"budget", record.budget_s}}},
      {"share_in_time", 1.0 - static_cast<double>(over_budget) / moments},
      {"over_budget", over_budget},
      {"files", {{"repeated", record.files.repeated}, {"late", record.files.late}, {"broken", record.files.broken}}}};
  if (const auto& phases_mm = record.tracking.predictor_options.phases_mm; !phases_mm.empty())
    json["phases_mm"] = phases_json(phases_mm);
  if (record.tolerance_mm) {
    json["tolerance_mm"] = *record.tolerance_mm;
    json["beam_holds_s"] = Json::array();
    for (const auto& [from, to] : holds_of(record, *record.tolerance_mm)) json["beam_holds_s"].push_back({from, to});
  }
  if (!record.truth.empty()) {
    const TruthErrors errors = beside_truth(record);
    json["beside_truth"] = {{"scored", "second half of the time"},
                            {"measured", errors_json(errors.measured)},
                            {"predicted", errors_json(errors.predicted)},
                            {"hold_last", errors_json(errors.held)}};
  }
  return json;
}

std::string trace_csv(const TrackRecord& record) {
  std::string csv =
      "t_s,measured_x_mm,measured_y_mm,measured_z_mm,filtered_x_mm,filtered_y_mm,filtered_z_mm,predicted_x_mm,"
      "predicted_y_mm,predicted_z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm,similarity,latency_s,status\n";
  const auto three = [](const Eigen::Vector3d& v) { return fmt::format("{:.4f},{:.4f},{:.4f}", v.x(), v.y(), v.z()); };
  std::vector<double> late_s = record.late_s;
  std::ranges::sort(late_s);
  auto late = late_s.begin();
  const auto add_late_until = [&](double time_s) {
    for (; late != late_s.end() && *late <= time_s; ++late) csv += fmt::format("{:.4f},,,,,,,,,,,,,,,late\n", *late);
  };
  for (const TraceRow& row : record.rows) {
    const TrackedFrame& frame = row.frame;
    add_late_until(frame.time_s);
    const auto if_known = [&](const Eigen::Vector3d& v) { return frame.is_known ? three(v) : ",,"; };
    csv += fmt::format("{:.4f},{},{},{},{},{:.5f},{:.4f},{}\n", frame.time_s,
                       frame.measured_mm ? three(*frame.measured_mm) : ",,", if_known(frame.filtered_mm),
                       if_known(frame.predicted_mm), if_known(frame.sigma_mm), frame.similarity, row.processing_s,
                       to_string(frame.status));
  }
  add_late_until(record.rows.back().frame.time_s);
  return csv;
}

std::string trace_svg(const TrackRecord& record) {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e300), high = -low;
  for (const TraceRow& row : record.rows) {
    low = low.cwiseMin(row.frame.filtered_mm);
    high = high.cwiseMax(row.frame.filtered_mm);
  }
  int axis = 0;
  (high - low).maxCoeff(&axis);
  LineChart chart{.title = fmt::format("Target along {}, from where it was planned", "xyz"[axis]),
                  .x_label = "time, s",
                  .y_label = "mm, IEC 61217 fixed",
                  .curves = {},
                  .from_zero = false};
  LineChart::Curve measured{.name = "measured", .points = {}}, predicted{.name = "predicted", .points = {}},
      true_one{.name = "true", .points = {}};
  for (const auto& [frame, processing_s] : record.rows) {
    if (frame.measured_mm) measured.points.emplace_back(frame.time_s, (*frame.measured_mm)[axis]);
    if (frame.is_known)
      predicted.points.emplace_back(frame.time_s + record.tracking.latency_s, frame.predicted_mm[axis]);
  }
  for (const MotionSample& sample : record.truth) true_one.points.emplace_back(sample.time_s, sample.position_mm[axis]);
  chart.curves = {measured, predicted};
  if (!record.truth.empty()) chart.curves.push_back(true_one);
  return line_chart_svg(chart, 1000.0, 360.0);
}

std::string track_text(const Json& track) {
  std::string status;
  for (const auto& [name, count] : track["status"].items())
    status += fmt::format("{}{} {}", status.empty() ? "" : ", ", count.get<std::size_t>(), name);
  const auto imagers = track["imagers"].get<std::size_t>();
  const Json& seconds = track["processing_s"];
  std::string text = fmt::format(
      "{} moments of {} imager{}: {}\ntime per moment: median {:.3f} s, 95th percentile {:.3f} s; {:.1f} % within "
      "{:.0f} ms\n",
      track["frames"].get<std::size_t>(), imagers, imagers == 1 ? "" : "s", status, seconds["median"].get<double>(),
      seconds["p95"].get<double>(), 100.0 * track["share_in_time"].get<double>(),
      1000.0 * seconds["budget"].get<double>());
  const std::string predictor = track["predictor"];
  text +=
      track["predictor_warm_from_s"].is_null()
          ? fmt::format("predictor {}: never saw enough samples; it answered with the last position\n", predictor)
          : fmt::format(
                "predictor {}: had seen enough samples at {:.1f} s; until then it answered with the last position\n",
                predictor, track["predictor_warm_from_s"].get<double>());
  if (track.contains("beside_truth"))
    for (const auto& [key, words] : {std::pair("measured", "measured"), std::pair("predicted", "predicted"),
                                     std::pair("hold_last", "hold-last")}) {
      const Json& errors = track["beside_truth"][key];
      if (errors["samples"] == 0) {
        text +=
            fmt::format("{:<10} beside the truth: not compared; the truth does not tell of the second half\n", words);
        continue;
      }
      text += fmt::format("{:<10} beside the truth: median {:.2f}, RMSE {:.2f}, 95th percentile {:.2f} mm\n", words,
                          errors["median_mm"].get<double>(), errors["rmse_mm"].get<double>(),
                          errors["p95_mm"].get<double>());
    }
  if (track.contains("beam_holds_s"))
    text += fmt::format("the target was farther off than {} mm, so that the beam should wait, {} times\n",
                        track["tolerance_mm"].get<double>(), track["beam_holds_s"].size());
  return text;
}

}  // namespace isoshift
