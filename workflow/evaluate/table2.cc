#include "workflow/evaluate/table2.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "base/output_folder.h"
#include "workflow/evaluate/table2_configurations.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

struct Table2Row {
  Table2Configuration configuration;
  Json study;  // EvaluationFolder::study()
  EvaluationSummary summary;
};

const char* in_words(StartReading reading) {
  switch (reading) {
    case StartReading::kTranslation: return "25 mm without rotation";
    case StartReading::kMtre: return "mTRE 25 mm";
    case StartReading::kUpTo: return "mTRE up to 25 mm";
  }
  return "";
}

std::string optimizer_of(const Table2Configuration& configuration) {
  return configuration.searches == 1 ? std::string(configuration.optimizer)
                                     : fmt::format("{}, {} searches", configuration.optimizer, configuration.searches);
}

// The configurations that have a folder there, in their order. Throws Error for folders of different studies.
std::vector<Table2Row> rows_in(const std::filesystem::path& folder) {
  std::vector<Table2Row> rows;
  for (const Table2Configuration& configuration : table2_configurations()) {
    if (!is_evaluation(folder / configuration.name)) continue;
    const EvaluationFolder evaluation(folder / configuration.name);
    if (!rows.empty() && evaluation.study() != rows.front().study)
      throw Error(
          fmt::format("{}: holds evaluations of two studies, {} and {}; a table is of one.\n       Choose another "
                      "folder with -o",
                      folder.string(), rows.front().configuration.name, configuration.name));
    rows.push_back({configuration, evaluation.study(), summarized(evaluation.runs(), evaluation.judged_by_mrpd())});
  }
  return rows;
}

std::string markdown(const std::vector<Table2Row>& rows) {
  const auto cell = [](const MeanAndSd& values, int decimals) {
    return fmt::format("{:.{}f} +/- {:.{}f}", values.mean, decimals, values.sd, decimals);
  };
  std::string table =
      "| configuration | start | views | renderer | similarity | optimizer | starts | failures | mTRE mm | mPD mm | "
      "mRPD "
      "mm | time s | iterations | rendering |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n";
  for (const auto& [configuration, study, summary] : rows) {
    const OverAllRuns& all = summary.all;
    table +=
        fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {:.1f} % |\n",
                    configuration.name, in_words(configuration.reading), configuration.is_one_view ? 1 : 2,
                    configuration.renderer, configuration.similarity, optimizer_of(configuration), summary.runs,
                    summary.runs - summary.successes, cell(all.mtre_mm, 2), cell(all.mpd_mm, 2), cell(all.mrpd_mm, 2),
                    cell(all.search_seconds, 2), cell(all.evaluations, 0), 100.0 * all.rendering_share);
  }
  return table;
}

std::string csv(const std::vector<Table2Row>& rows) {
  const auto cells = [](const MeanAndSd& values) { return fmt::format(",{},{}", values.mean, values.sd); };
  std::string table =
      "configuration,reading,views,renderer,similarity,optimizer,searches,starts,failures,without_pose,mtre_mm,"
      "mtre_sd_mm,mpd_mm,mpd_sd_mm,mrpd_mm,mrpd_sd_mm,search_s,search_sd_s,evaluations,evaluations_sd,"
      "rendering_share\n";
  for (const auto& [configuration, study, summary] : rows) {
    const OverAllRuns& all = summary.all;
    table += fmt::format("{},{},{},{},{},{},{},{},{},{}", configuration.name, in_words(configuration.reading),
                         configuration.is_one_view ? 1 : 2, configuration.renderer, configuration.similarity,
                         configuration.optimizer, configuration.searches, summary.runs,
                         summary.runs - summary.successes, summary.runs - all.runs);
    for (const MeanAndSd* values : {&all.mtre_mm, &all.mpd_mm, &all.mrpd_mm, &all.search_seconds, &all.evaluations})
      table += cells(*values);
    table += fmt::format(",{}\n", all.rendering_share);
  }
  return table;
}

// The same study with its first X-ray alone.
Study first_view_of(Study study) {
  study.xrays.erase(study.xrays.begin() + 1, study.xrays.end());
  study.rt_images.erase(study.rt_images.begin() + 1, study.rt_images.end());
  return study;
}

EvaluateOptions options_for(const Table2Configuration& configuration, const EvaluateOptions& common,
                            const Study& study) {
  EvaluateOptions options = common;
  options.registration = request_of(configuration, common.registration);
  options.registration.settle();
  options.protocol = protocol_of(configuration, common.protocol.count);
  options.protocol.seed = common.protocol.seed;
  options.has_seed_per_run = true;
  options.output = common.output / configuration.name;
  if (configuration.is_one_view)
    std::erase_if(options.registration.region.rectangles, [&](const std::string& rectangle) {
      return !rectangle.starts_with(study.xrays.front().label + "=");
    });
  return options;
}

}  // namespace

std::string evaluate_table2(const EvaluateOptions& options, const std::vector<std::string>& names, Notes& notes,
                            Observer& observer) {
  std::vector<Table2Configuration> wanted;
  for (const Table2Configuration& configuration : table2_configurations())
    if (names.empty() || std::ranges::find(names, configuration.name) != names.end()) wanted.push_back(configuration);
  for (const Table2Configuration& configuration : wanted)
    check_jobs(options.jobs, request_of(configuration, options.registration).rendering.kind());
  const Study study = load(options.study, notes, observer);
  std::vector<Table2Row> rows = rows_in(options.output);
  for (const Table2Configuration& configuration : wanted) {
    observer.say(fmt::format("{}:", configuration.name));
    EvaluateOptions of_configuration = options_for(configuration, options, study);
    if (!rows.empty()) of_configuration.of_study = rows.front().study;
    evaluate_loaded(configuration.is_one_view ? first_view_of(study) : study, std::move(of_configuration), observer);
    rows = rows_in(options.output);
    replace_text(options.output / "table2.md", markdown(rows));
    replace_text(options.output / "table2.csv", csv(rows));
  }
  return markdown(rows);
}

}  // namespace isoshift
