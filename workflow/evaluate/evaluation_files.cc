#include "workflow/evaluate/evaluation_files.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "base/error.h"
#include "base/json_file.h"
#include "base/output_folder.h"
#include "io/report/bar_chart.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kConfigurationFile = "evaluation.json";
constexpr const char* kRunsFile = "runs.csv";
constexpr const char* kHeader =
    "run,start_mtre_mm,mtre_mm,mpd_mm,mrpd_mm,target_mm,rotation_share,dx_mm,dy_mm,dz_mm,drx_deg,dry_deg,drz_deg,"
    "sigma_x_mm,sigma_y_mm,sigma_z_mm,sigma_rx_deg,sigma_ry_deg,sigma_rz_deg,evaluations,seconds,seconds_rendering,"
    "seconds_similarity,verdict,reasons";

constexpr const char* kBodiesFile = "bodies.csv";
constexpr const char* kBodiesHeader =
    "run,body,determined,found_x_mm,found_y_mm,found_z_mm,true_x_mm,true_y_mm,true_z_mm,sigma_x_mm,sigma_y_mm,"
    "sigma_z_mm";

std::string lines_of_bodies(const EvaluatedRun& run) {
  std::string lines;
  for (const EvaluatedBody& body : run.bodies) {
    lines += fmt::format("{},{},{}", run.number, body.name, body.is_determined ? "yes" : "no");
    for (const Eigen::Vector3d* mm : {&body.found_mm, &body.true_mm, &body.sigma_mm})
      lines += fmt::format(",{}", fmt::join(mm->begin(), mm->end(), ","));
    lines += "\n";
  }
  return lines;
}

// Adds the body of a line of bodies.csv to its run, if that has ended.
void add_body(const std::string& line, std::vector<EvaluatedRun>& runs) {
  std::istringstream text(line);
  std::string number, word;
  EvaluatedBody body;
  std::getline(text, number, ',');
  std::getline(text, body.name, ',');
  std::getline(text, word, ',');
  body.is_determined = word == "yes";
  for (Eigen::Vector3d* mm : {&body.found_mm, &body.true_mm, &body.sigma_mm})
    for (double& component : *mm) {
      std::getline(text, word, ',');
      component = std::stod(word);
    }
  const auto run = std::ranges::find(runs, std::stoi(number), &EvaluatedRun::number);
  if (run != runs.end()) run->bodies.push_back(std::move(body));
}

std::string line_of(const EvaluatedRun& run) {
  std::string line = fmt::format("{},{},{},{},{},{},{},{},", run.number, run.start_mtre_mm, run.mtre_mm, run.mpd_mm,
                                 run.mrpd_mm, run.target_mm, run.rotation_share, fmt::join(run.error, ","));
  line += run.sigma ? fmt::format("{},", fmt::join(*run.sigma, ",")) : std::string(",,,,,,");
  std::string reasons = run.reasons;
  std::ranges::replace(reasons, '"', '\'');
  std::ranges::replace_if(reasons, [](unsigned char c) { return c < 0x20; }, ' ');
  line += fmt::format("{},{},{},{},{},\"{}\"\n", run.evaluations, run.seconds, run.seconds_rendering,
                      run.seconds_similarity, to_string(run.verdict), reasons);
  return line;
}

// Fields up to the reasons, which alone hold commas.
EvaluatedRun run_of(const std::string& line) {
  std::istringstream text(line);
  std::string field;
  const auto number = [&] {
    std::getline(text, field, ',');
    return std::stod(field);
  };
  EvaluatedRun run;
  run.number = static_cast<int>(number());
  for (double* value :
       {&run.start_mtre_mm, &run.mtre_mm, &run.mpd_mm, &run.mrpd_mm, &run.target_mm, &run.rotation_share})
    *value = number();
  for (double& value : run.error) value = number();
  std::array<double, 6> sigma = {};
  bool has_sigma = true;
  for (double& value : sigma) {
    std::getline(text, field, ',');
    has_sigma = has_sigma && !field.empty();
    if (has_sigma) value = std::stod(field);
  }
  if (has_sigma) run.sigma = sigma;
  run.evaluations = static_cast<int>(number());
  for (double* value : {&run.seconds, &run.seconds_rendering, &run.seconds_similarity}) *value = number();
  std::getline(text, field, ',');
  for (const Verdict verdict : {Verdict::kAccepted, Verdict::kReview, Verdict::kRejected})
    if (to_string(verdict) == field) run.verdict = verdict;
  std::getline(text, run.reasons);
  run.reasons = run.reasons.substr(1, run.reasons.size() - 2);
  return run;
}

Json if_determined(const BodySummary& body, double value) { return body.determined > 0 ? Json(value) : Json(nullptr); }

Json json_of(const MeanAndSd& values) { return {{"mean", values.mean}, {"sd", values.sd}}; }

Json json_of(const OverAllRuns& all) {
  return {{"runs", all.runs},
          {"mtre_mm", json_of(all.mtre_mm)},
          {"mpd_mm", json_of(all.mpd_mm)},
          {"mrpd_mm", json_of(all.mrpd_mm)},
          {"search_seconds", json_of(all.search_seconds)},
          {"evaluations", json_of(all.evaluations)},
          {"rendering_share_of_an_iteration", all.rendering_share}};
}

// Mean and median need one success, a standard deviation two.
Json of_successes(const EvaluationSummary& summary, double value, int least = 1) {
  return summary.successes >= least ? Json(value) : Json(nullptr);
}

std::string mm_of_successes(const EvaluationSummary& summary, double value_mm) {
  return summary.successes > 0 ? fmt::format("{:.2f} mm", value_mm) : "-";
}

std::string mtre_of_successes(const EvaluationSummary& summary) {
  return summary.successes > 1 ? fmt::format("{:.2f} +/- {:.2f} mm", summary.mean_mm, summary.sd_mm)
                               : mm_of_successes(summary, summary.mean_mm);
}

std::string capture_in_words(const EvaluationSummary& summary) {
  return fmt::format("{}{} mm", summary.may_capture_more ? "at least " : "", summary.capture_range_mm);
}

Json json_of(const EvaluationSummary& summary) {
  Json json = {{"runs", summary.runs},
               {"successes", summary.successes},
               {"success_share", summary.success_share()},
               {"mtre_mm",
                {{"mean", of_successes(summary, summary.mean_mm)},
                 {"sd", of_successes(summary, summary.sd_mm, 2)},
                 {"median", of_successes(summary, summary.median_mm)}}},
               {"mpd_mm", of_successes(summary, summary.mean_mpd_mm)},
               {"mrpd_mm", of_successes(summary, summary.mean_mrpd_mm)},
               {"capture_range_mm", summary.capture_range_mm},
               {"may_capture_more", summary.may_capture_more},
               {"rotation_share_of_failures", summary.rotation_share_of_failures},
               {"median_seconds", summary.median_seconds},
               {"mean_evaluations", summary.mean_evaluations},
               {"rendering_share", summary.rendering_share},
               {"similarity_share", summary.similarity_share},
               {"within_1_mm", {{"runs", summary.within_1_mm}, {"accepted", summary.within_1_mm_accepted}}},
               {"beyond_2_mm", {{"runs", summary.beyond_2_mm}, {"accepted", summary.beyond_2_mm_accepted}}},
               {"target",
                {{"median_mm", summary.median_target_mm},
                 {"within_1_mm", summary.target_within_1_mm},
                 {"within_1_mm_accepted", summary.target_within_1_mm_accepted},
                 {"beyond_2_mm_accepted", summary.target_beyond_2_mm_accepted}}},
               {"all_with_a_pose", json_of(summary.all)}};
  for (const BodySummary& body : summary.bodies)
    json["bodies"].push_back({{"name", body.name},
                              {"runs", body.runs},
                              {"determined", body.determined},
                              {"median_true_mm", if_determined(body, body.median_true_mm)},
                              {"median_error_mm", if_determined(body, body.median_error_mm)},
                              {"share_within_one_sigma", if_determined(body, body.within_one_sigma)},
                              {"share_within_two_sigma", if_determined(body, body.within_two_sigma)}});
  if (summary.within_one_sigma) json["share_within_one_sigma"] = *summary.within_one_sigma;
  if (summary.within_two_sigma) json["share_within_two_sigma"] = *summary.within_two_sigma;
  return json;
}

// What was left after registration, in 40 bins up to the worst success; failures are counted in the title.
BarChart error_histogram(const std::vector<EvaluatedRun>& runs, bool by_mrpd, const EvaluationSummary& summary) {
  constexpr int kBins = 40;
  const auto left_mm = [by_mrpd](const EvaluatedRun& run) { return by_mrpd ? run.mrpd_mm : run.mtre_mm; };
  double largest_mm = 0.05;
  for (const EvaluatedRun& run : runs)
    if (left_mm(run) < kSuccessMm) largest_mm = std::max(largest_mm, left_mm(run));
  const double width_mm = largest_mm / kBins;
  BarChart chart{.title = fmt::format("{} after registration: {} of {} below {} mm", by_mrpd ? "mRPD" : "mTRE",
                                      summary.successes, summary.runs, kSuccessMm),
                 .x_label = by_mrpd ? "mRPD [mm]" : "mTRE [mm]",
                 .y_label = "registrations"};
  for (int bin = 0; bin < kBins; ++bin) chart.bars.push_back({.from = bin * width_mm, .to = (bin + 1) * width_mm});
  for (const EvaluatedRun& run : runs)
    if (left_mm(run) < kSuccessMm)
      chart.bars[std::min<std::size_t>(kBins - 1, static_cast<std::size_t>(left_mm(run) / width_mm))].height += 1.0;
  return chart;
}

BarChart success_chart(const std::vector<EvaluatedRun>& runs, bool by_mrpd, const EvaluationSummary& summary) {
  BarChart chart{.title = fmt::format("Success: {:.1f} % of {} starts, capture range {}",
                                      100.0 * summary.success_share(), summary.runs, capture_in_words(summary)),
                 .x_label = "mTRE at the start [mm]",
                 .y_label = "success [%]; dashed: 95 %",
                 .y_max = 100.0,
                 .reference_line = 95.0};
  for (const SuccessBin& bin : success_bins(runs, by_mrpd))
    chart.bars.push_back({.from = static_cast<double>(bin.start_mm),
                          .to = bin.start_mm + 1.0,
                          .height = 100.0 * bin.successes / bin.runs});
  return chart;
}

Json parsed(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream) throw Error(fmt::format("{}: cannot be opened; is this the folder of an evaluation?", file.string()));
  try {
    return Json::parse(stream);
  } catch (const nlohmann::json::exception& error) {
    throw Error(fmt::format("{}: cannot be read: {}", file.string(), error.what()));
  }
}

}  // namespace

Json study_in(const Json& configuration) {
  return {{"ct_series", configuration.at("ct_series")},
          {"image", configuration.at("images").at(0)},
          {"truth", configuration.at("truth")}};
}

bool is_evaluation(const std::filesystem::path& folder) { return std::filesystem::exists(folder / kConfigurationFile); }

EvaluationFolder::EvaluationFolder(std::filesystem::path path, Json configuration)
    : path_(std::move(path)), configuration_(std::move(configuration)) {
  if (is_evaluation(path_)) {
    if (parsed(path_ / kConfigurationFile) != configuration_)
      throw Error(
          fmt::format("{}: holds another evaluation (evaluation.json says which).\n       Choose another folder with "
                      "-o, or remove this one",
                      path_.string()));
    const bool are_whole = read_runs();
    write_bodies();
    if (!are_whole) write_runs();
    return;
  }
  if (holds_files(path_))
    throw Error(
        fmt::format("{}: exists and holds no evaluation.\n       Choose another folder with -o", path_.string()));
  std::filesystem::create_directories(path_);
  replace_text(path_ / kConfigurationFile, json_text(configuration_));
  write_bodies();
  write_runs();
}

EvaluationFolder::EvaluationFolder(std::filesystem::path path)
    : path_(std::move(path)), configuration_(parsed(path_ / kConfigurationFile)) {
  read_runs();
}

bool EvaluationFolder::read_runs() {
  // Stopped before it was made: nothing has run.
  if (!std::filesystem::exists(path_ / kRunsFile)) return false;
  std::ifstream stream(path_ / kRunsFile);
  std::string line;
  std::getline(stream, line);
  if (line != kHeader) throw Error(fmt::format("{}: is of another version", (path_ / kRunsFile).string()));
  bool is_cut = false;
  while (std::getline(stream, line)) {
    is_cut = stream.eof();
    if (is_cut) break;
    try {
      runs_.push_back(run_of(line));
    } catch (const std::exception&) {
      throw Error(fmt::format("{}: line {} cannot be read: {}", (path_ / kRunsFile).string(), runs_.size() + 2, line));
    }
  }
  read_bodies();
  return !is_cut;
}

void EvaluationFolder::write_runs() const {
  std::string runs = std::string(kHeader) + "\n";
  for (const EvaluatedRun& run : runs_) runs += line_of(run);
  replace_text(path_ / kRunsFile, runs);
}

void EvaluationFolder::write_bodies() const {
  std::string bodies = std::string(kBodiesHeader) + "\n";
  for (const EvaluatedRun& run : runs_) bodies += lines_of_bodies(run);
  replace_text(path_ / kBodiesFile, bodies);
}

// Bodies are written before the line of their run: those of a run that was stopped are left out, and made again with
// it. Evaluations of before 2026-11-24 have no such file.
void EvaluationFolder::read_bodies() {
  std::ifstream stream(path_ / kBodiesFile);
  if (!stream) return;
  std::string line;
  std::getline(stream, line);
  if (line != kBodiesHeader) throw Error(fmt::format("{}: is of another version", (path_ / kBodiesFile).string()));
  for (int number = 2; std::getline(stream, line) && !stream.eof(); ++number) try {
      add_body(line, runs_);
    } catch (const std::exception&) {
      throw Error(fmt::format("{}: line {} cannot be read: {}", (path_ / kBodiesFile).string(), number, line));
    }
}

bool EvaluationFolder::has(int number) const {
  return std::ranges::find(runs_, number, &EvaluatedRun::number) != runs_.end();
}

void EvaluationFolder::append(const EvaluatedRun& run) {
  const auto add = [&](const char* file, const std::string& lines) {
    std::ofstream stream(path_ / file, std::ios::app);
    stream << lines << std::flush;
    if (!stream) throw Error(fmt::format("{}: cannot be written", (path_ / file).string()));
  };
  add(kBodiesFile, lines_of_bodies(run));
  add(kRunsFile, line_of(run));
  runs_.push_back(run);
}

void EvaluationFolder::write_summary() const {
  const EvaluationSummary summary = summarized(runs_, judged_by_mrpd());
  replace_text(path_ / "summary.json", json_text(json_of(summary)));
  replace_text(path_ / "success.svg", bar_chart_svg(success_chart(runs_, judged_by_mrpd(), summary)));
  replace_text(path_ / "errors.svg", bar_chart_svg(error_histogram(runs_, judged_by_mrpd(), summary)));
}

std::string evaluation_table(const std::vector<std::pair<std::string, EvaluationSummary>>& rows) {
  std::size_t width = 10;
  for (const auto& [name, summary] : rows) width = std::max(width, name.size());
  std::string table = fmt::format(
      "| {:<{}} | success | mTRE mean +/- SD | median | mPD | mRPD | capture | rotation | accepted <1 mm | accepted >2 "
      "mm | target median | target <1 mm (accepted) | target >2 mm accepted | evaluations | time | rendering of time "
      "|\n|{:-<{}}|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
      "", width, "", width + 2);
  for (const auto& [name, s] : rows)
    table += fmt::format(
        "| {:<{}} | {}/{} ({:.1f} %) | {} | {} | {} | {} | {} | {} | {}/{} | "
        "{}/{} | {:.2f} mm | {} ({}) | {} | {:.0f} | {:.2f} s | {:.0f} % |\n",
        name, width, s.successes, s.runs, 100.0 * s.success_share(), mtre_of_successes(s),
        mm_of_successes(s, s.median_mm), mm_of_successes(s, s.mean_mpd_mm), mm_of_successes(s, s.mean_mrpd_mm),
        capture_in_words(s), s.successes < s.runs ? fmt::format("{:.0f} %", 100.0 * s.rotation_share_of_failures) : "-",
        s.within_1_mm_accepted, s.within_1_mm, s.beyond_2_mm_accepted, s.beyond_2_mm, s.median_target_mm,
        s.target_within_1_mm, s.target_within_1_mm_accepted, s.target_beyond_2_mm_accepted, s.mean_evaluations,
        s.median_seconds, 100.0 * s.rendering_share);
  return table;
}

}  // namespace isoshift
