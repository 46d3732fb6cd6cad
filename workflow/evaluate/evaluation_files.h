#pragma once
// The folder of an evaluation: its configuration, a line for every run that has ended, then summary and plots. An
// evaluation that was stopped continues after its last line.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "registration/evaluate.h"

namespace isoshift {

// Of the configuration of an evaluation what those of one study share: its CT, its first X-ray and the truth.
nlohmann::ordered_json study_in(const nlohmann::ordered_json& configuration);

// Whether a folder holds an evaluation; one that was killed at its beginning may hold none yet.
bool is_evaluation(const std::filesystem::path& folder);

class EvaluationFolder {
 public:
  // Makes the folder, or opens the folder of the same evaluation. Throws Error if it holds anything else.
  EvaluationFolder(std::filesystem::path path, nlohmann::ordered_json configuration);

  // Opens the folder of an evaluation for reading: nothing in it is changed. Throws Error if `path` is not such a
  // folder.
  explicit EvaluationFolder(std::filesystem::path path);

  const std::vector<EvaluatedRun>& runs() const { return runs_; }  // ended so far, in the order they ended
  bool has(int number) const;

  nlohmann::ordered_json study() const { return study_in(configuration_); }

  void append(const EvaluatedRun& run);

  // Writes summary.json, success.svg (share of successes against the start) and errors.svg (histogram of the final
  // errors).
  void write_summary() const;

  bool judged_by_mrpd() const { return configuration_.at("success_by") == "mRPD"; }

 private:
  // Returns whether runs.csv is there and holds whole lines alone; a last line without its end is of a run that was
  // stopped, which is made again.
  bool read_runs();
  void read_bodies();
  void write_runs() const;
  void write_bodies() const;

  std::filesystem::path path_;
  nlohmann::ordered_json configuration_;
  std::vector<EvaluatedRun> runs_;
};

// A table in Markdown, with a row per named summary.
std::string evaluation_table(const std::vector<std::pair<std::string, EvaluationSummary>>& rows);

}  // namespace isoshift
