#pragma once
// The folder of an evaluation: what was evaluated, a line for every run as it ends, then summary and plots. An
// evaluation that was stopped goes on from its lines.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "registration/evaluate.h"

namespace isoshift {

class EvaluationFolder {
 public:
  // Makes the folder, or opens that of the same evaluation. Throws Error if it holds anything else.
  EvaluationFolder(std::filesystem::path path, nlohmann::ordered_json configuration);

  // Opens one to read. Throws Error if there is none.
  explicit EvaluationFolder(std::filesystem::path path);

  const std::vector<EvaluatedRun>& runs() const { return runs_; }  // ended so far, in the order they ended
  bool has(int number) const;

  void append(const EvaluatedRun& run);

  // summary.json, success.svg (share of successes against the start) and errors.svg (histogram of what was left).
  void write_summary() const;

  bool judged_by_mrpd() const { return configuration_.at("success_by") == "mRPD"; }

 private:
  void read_runs();

  std::filesystem::path path_;
  nlohmann::ordered_json configuration_;
  std::vector<EvaluatedRun> runs_;
};

// A row of a table in Markdown: names beside figures.
std::string evaluation_table(const std::vector<std::pair<std::string, EvaluationSummary>>& rows);

}  // namespace isoshift
