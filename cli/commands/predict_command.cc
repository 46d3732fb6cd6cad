// isoshift predict: the motion predictors on recorded traces.

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "base/json_file.h"
#include "base/output_folder.h"
#include "base/parallel.h"
#include "cli/commands/commands.h"
#include "io/report/line_chart.h"
#include "io/study/motion_trace.h"
#include "registration/motion/score.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

struct PredictOptions {
  std::vector<std::filesystem::path> traces;
  std::vector<std::string> methods;
  std::vector<double> latencies_ms = {100, 200, 300, 400, 500, 600};
  ScoreProtocol protocol;
  std::filesystem::path output;
  bool overwrite = false;
  bool as_json = false;
};

// Scores by trace, method and latency, in the order given.
struct Scores {
  std::vector<std::string> names;
  std::vector<PredictorKind> kinds;
  std::vector<double> latencies_ms;
  std::vector<PredictionScore> all;

  const PredictionScore& at(std::size_t trace, std::size_t method, std::size_t latency) const {
    return all[(trace * kinds.size() + method) * latencies_ms.size() + latency];
  }
  // Over the traces.
  double mean(double PredictionScore::* figure, std::size_t method, std::size_t latency) const {
    double sum = 0.0;
    for (std::size_t trace = 0; trace < names.size(); ++trace) sum += at(trace, method, latency).*figure;
    return sum / static_cast<double>(names.size());
  }
};

std::vector<PredictorKind> kinds_of(const std::vector<std::string>& names) {
  std::vector<PredictorKind> kinds;
  kinds.reserve(names.size());
  for (const std::string& name : names) kinds.push_back(predictor_kind_from(name).value());
  if (kinds.empty()) kinds.assign(kPredictorKinds.begin(), kPredictorKinds.end());
  return kinds;
}

// Between positions far apart a prediction would be compared with a straight line.
void expect_scorable(const std::vector<MotionSample>& trace, const std::filesystem::path& path) {
  constexpr double kLongestStepS = 2.0, kShortestStepS = 1e-3;
  if (trace.size() < 2) throw Error(fmt::format("{}: holds fewer than two positions", path.string()));
  for (std::size_t n = 1; n < trace.size(); ++n)
    if (const double step_s = trace[n].time_s - trace[n - 1].time_s; step_s > kLongestStepS)
      throw Error(fmt::format(
          "{}: has no position for {:g} s after {:g} s, expected one every {:g} s at least.\n"
          "       Score the parts before and after a gap alone; times are seconds in t_s and milliseconds in Timestamp",
          path.string(), step_s, trace[n - 1].time_s, kLongestStepS));
  const double length_s = trace.back().time_s - trace.front().time_s;
  if (const double step_s = length_s / static_cast<double>(trace.size() - 1); step_s < kShortestStepS)
    throw Error(fmt::format("{}: has {} positions within {:g} s: are the times of a Timestamp in ms, or of t_s in s?",
                            path.string(), trace.size(), length_s));
}

Scores scores_of(const PredictOptions& options, Console& console) {
  Scores scores{.names = {}, .kinds = kinds_of(options.methods), .latencies_ms = options.latencies_ms, .all = {}};
  for (const double latency_ms : options.latencies_ms)
    if (!(latency_ms > 0.0 && latency_ms <= 5000.0))
      throw UsageError(fmt::format("--latency {}: expected more than 0 and at most 5000 ms", latency_ms));
  std::vector<std::vector<MotionSample>> traces;
  Notes notes;
  for (const std::filesystem::path& path : options.traces) {
    traces.push_back(read_motion_trace(path, notes));
    const auto same_stem = [&](const std::filesystem::path& other) { return other.stem() == path.stem(); };
    scores.names.push_back(std::ranges::count_if(options.traces, same_stem) == 1 ? path.stem().string()
                                                                                 : path.string());
    expect_scorable(traces.back(), path);
  }
  print_warnings(notes.warnings, console);
  const std::size_t per_trace = scores.kinds.size() * scores.latencies_ms.size();
  scores.all.resize(traces.size() * per_trace);
  ProgressBar bar(console, "Predicting");
  std::atomic<std::size_t> done = 0;
  std::mutex mutex;
  parallel_for(std::size_t{0}, scores.all.size(), [&](std::size_t n) {
    const std::size_t trace = n / per_trace, method = n % per_trace / scores.latencies_ms.size();
    scores.all[n] = score(scores.kinds[method], {}, traces[trace],
                          scores.latencies_ms[n % scores.latencies_ms.size()] / 1000.0, options.protocol);
    const std::lock_guard lock(mutex);
    bar.update(++done, scores.all.size());
  });
  for (std::size_t trace = 0; trace < traces.size(); ++trace)
    if (scores.at(trace, 0, 0).samples == 0)
      throw Error(fmt::format(
          "{}: is shorter than the training time, so that nothing can be scored; choose a shorter --train-s",
          options.traces[trace].string()));
  return scores;
}

Json json_of(const Scores& scores) {
  Json json;
  for (std::size_t trace = 0; trace < scores.names.size(); ++trace)
    for (std::size_t method = 0; method < scores.kinds.size(); ++method)
      for (std::size_t latency = 0; latency < scores.latencies_ms.size(); ++latency) {
        const PredictionScore& score = scores.at(trace, method, latency);
        json[scores.names[trace]][std::string(to_string(scores.kinds[method]))][fmt::format(
            "{:g}", scores.latencies_ms[latency])] = {
            {"rmse_mm", score.rmse_mm}, {"p95_mm", score.p95_mm}, {"max_mm", score.max_mm}, {"samples", score.samples}};
      }
  return json;
}

std::string table_of(const Scores& scores) {
  const auto hold = std::ranges::find(scores.kinds, PredictorKind::kHoldLast);
  std::string text = fmt::format(
      "Mean over {} trace{}: RMSE, 95th percentile and maximum of the 3D error in mm{}\n\n{:<10}", scores.names.size(),
      scores.names.size() == 1 ? "" : "s", hold == scores.kinds.end() ? "" : "; RMSE as a share of hold-last's", "");
  for (const double latency_ms : scores.latencies_ms) text += fmt::format("{:>26}", fmt::format("{:g} ms", latency_ms));
  text += "\n";
  for (std::size_t method = 0; method < scores.kinds.size(); ++method) {
    text += fmt::format("{:<10}", to_string(scores.kinds[method]));
    for (std::size_t latency = 0; latency < scores.latencies_ms.size(); ++latency) {
      const double rmse = scores.mean(&PredictionScore::rmse_mm, method, latency);
      std::string cell =
          fmt::format("{:.2f} {:.2f} {:.2f}", rmse, scores.mean(&PredictionScore::p95_mm, method, latency),
                      scores.mean(&PredictionScore::max_mm, method, latency));
      const double held =
          hold == scores.kinds.end()
              ? 0.0
              : scores.mean(&PredictionScore::rmse_mm, static_cast<std::size_t>(hold - scores.kinds.begin()), latency);
      if (held > 0.0) cell += fmt::format(" ({:.3f})", rmse / held);
      text += fmt::format("{:>26}", cell);
    }
    text += "\n";
  }
  return text;
}

std::string chart_of(const Scores& scores) {
  LineChart chart{
      .title = "Prediction of recorded motion", .x_label = "latency, ms", .y_label = "mean RMSE, mm", .curves = {}};
  for (std::size_t method = 0; method < scores.kinds.size(); ++method) {
    LineChart::Curve curve{.name = std::string(to_string(scores.kinds[method])), .points = {}};
    for (std::size_t latency = 0; latency < scores.latencies_ms.size(); ++latency)
      curve.points.emplace_back(scores.latencies_ms[latency], scores.mean(&PredictionScore::rmse_mm, method, latency));
    chart.curves.push_back(std::move(curve));
  }
  return line_chart_svg(chart);
}

void run_predict(const PredictOptions& options, Console& console) {
  std::optional<OutputFolder> output;
  if (!options.output.empty()) output.emplace(options.output, options.overwrite, options.traces);
  const Scores scores = scores_of(options, console);
  const std::string json = json_text(json_of(scores));
  if (output) {
    write_text(output->path() / "prediction.json", json);
    write_text(output->path() / "prediction.svg", chart_of(scores));
    output->commit();
  }
  console.out << (options.as_json ? json : table_of(scores));
}

}  // namespace

void add_predict_command(CLI::App& app, Console& console, int&) {
  auto options = std::make_shared<PredictOptions>();
  CLI::App* command = app.add_subcommand("predict", "Measure the motion predictors on recorded traces");
  command->footer(
      "\nExample:\n  isoshift predict traces/*.csv\n  isoshift predict trace.csv --latency 115,450,630 -o "
      "prediction\n\n"
      "A trace is CSV with the columns t_s (or Timestamp, ms) and x, y, z in mm, such as the trace.csv of track.\n"
      "Every sample after the training time is predicted from the samples that are at least one latency older.");
  command->add_option("trace", options->traces, "Recorded traces")->required()->type_name("CSV...");
  command->add_option("--method", options->methods, "Predictors to measure; may be repeated [all]")
      ->check(CLI::IsMember(predictor_names()));
  command->add_option("--latency", options->latencies_ms, "Times over which to predict")
      ->delimiter(',')
      ->type_name("MS,...")
      ->capture_default_str();
  command->add_option("--rate", options->protocol.rate_hz, "Rate to which the samples are interpolated")
      ->type_name("HZ")
      ->check(CLI::Range(0.5, 100.0))
      ->capture_default_str();
  command
      ->add_option("--train-s", options->protocol.training_s,
                   "Training time at the beginning, which is not scored; 40 s for traces under 90 s")
      ->type_name("S")
      ->check(CLI::Range(0.0, 3600.0))
      ->capture_default_str();
  command->add_option("-o,--output", options->output, "Folder for prediction.json and prediction.svg")
      ->type_name("FOLDER");
  command->add_flag("--overwrite", options->overwrite, "Replace an earlier output in that folder");
  command->add_flag("--json", options->as_json, "Print JSON: trace, method, latency in ms, figures");
  command->callback([options, &console] {
    options->protocol.short_training_s = std::min(options->protocol.short_training_s, options->protocol.training_s);
    run_predict(*options, console);
  });
}

}  // namespace isoshift
