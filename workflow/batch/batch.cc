#include "workflow/batch/batch.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

#include "base/error.h"
#include "base/graceful_end.h"
#include "base/output_folder.h"
#include "workflow/batch/batch_workers.h"
#include "workflow/batch/case_inputs.h"

namespace isoshift {
namespace {

// Cases of one CT stay together.
std::vector<BatchCase> cases_of_shard(const Shard& shard, std::vector<BatchCase> cases) {
  std::multimap<std::string, BatchCase> by_ct;  // cases of one CT keep their order
  for (BatchCase& one : cases) by_ct.emplace(one.ct_key(), std::move(one));
  std::ranges::transform(by_ct, cases.begin(), [](auto& entry) { return std::move(entry.second); });
  const auto begin = [&](int number) {
    return static_cast<std::ptrdiff_t>(cases.size() * static_cast<std::size_t>(number) /
                                       static_cast<std::size_t>(shard.count));
  };
  return {cases.begin() + begin(shard.number - 1), cases.begin() + begin(shard.number)};
}

// True if it is not known, or if a file cannot be read: the registration says which one.
bool has_xrays_of_manifest(const BatchCase& one) {
  if (one.xrays_sha256.empty()) return true;
  try {
    return xrays_sha256_of(one) == one.xrays_sha256;
  } catch (const Error&) {
    return true;
  }
}

}  // namespace

std::vector<BatchCase> cases_of(const BatchOptions& options, Observer& observer) {
  if (!std::filesystem::is_directory(options.cases)) return read_manifest(options.cases);
  if (const auto scanned = options.output / "manifest.csv";
      options.takes_earlier_scan && std::filesystem::exists(scanned))
    return read_manifest(scanned);
  Notes notes;
  std::vector<BatchCase> cases = scan_cases(options.cases, !options.each.study.machine.empty(), notes);
  for (const std::string& file : notes.left_aside) observer.say("left aside: " + file);
  for (const std::string& warning : notes.warnings) observer.say("warning: " + warning);
  return cases;
}

Batch::Batch(const BatchOptions& options, Observer& observer)
    : options_(options),
      observer_(observer),
      cases_(cases_of(options, observer)),
      folder_(options.output, options.kept) {
  const auto manifest = folder_.path() / "manifest.csv";
  if (std::filesystem::is_directory(options.cases) &&
      !(options.takes_earlier_scan && std::filesystem::exists(manifest)))
    replace_text(manifest, manifest_csv(cases_));
}

bool Batch::run() {
  const Shard shard = options_.shard.value_or(Shard());
  if (shard.count > 1) cases_ = cases_of_shard(shard, std::move(cases_));
  const ShardLock lock = folder_.work_on(shard, cases_);
  if (shard.count == 1 && std::filesystem::is_directory(options_.cases))
    for (const std::string& name : folder_.set_aside_regrouped(cases_))
      observer_.say(
          fmt::format("case {}: its X-rays are grouped in another way now. Its result is in superseded", name));
  return register_all();
}

bool Batch::register_all() {
  std::vector<BatchJob> jobs;
  const RegisterOptions& each = options_.each;
  CaseInputs inputs(folder_.path() / "inputs", {each.study.machine, each.study.machine_key, each.site, each.start});
  std::size_t ended_before = 0, compared = 0;
  for (const BatchCase& one : cases_) {
    if (inputs.renew(one, folder_.has_ended(one.name))) {
      observer_.say(fmt::format(
          "case {}: its files, its doubts, its anatomy or what the flags name have changed, so it is registered again. "
          "Its earlier result is in superseded",
          one.name));
      folder_.set_aside(one.name);
    }
    ended_before += folder_.has_ended(one.name) ? 1 : 0;
    if (!folder_.has_ended(one.name) && !has_xrays_of_manifest(one)) {
      folder_.fail(one.name,
                   "its X-rays are not those for which the manifest was written (xrays_sha256). Write the manifest "
                   "again with --scan; or empty that cell, if you have chosen other X-rays");
      inputs.note_nothing(one);
    }
    if (!folder_.has_ended(one.name))
      jobs.push_back({.name = one.name,
                      .ct_key = one.ct_key(),
                      .order = {.parts = one.parts,
                                .flags = options_.kept,
                                .anatomy = one.anatomy,
                                .output = std::filesystem::absolute(folder_.folder_of(one.name)),
                                .at_a_time = options_.jobs}});
    observer_.progress("Comparing files of cases", ++compared, cases_.size());
  }
  if (ended_before > 0)
    observer_.say(fmt::format("{} of {} cases have been registered before", ended_before, cases_.size()));
  const GracefulEnd end;
  const std::string step = fmt::format("Registering {}", jobs.size());
  const std::size_t total = jobs.size();
  std::size_t ended = 0;
  run_in_workers(
      std::move(jobs), options_.jobs,
      [&](const std::string& name, const std::optional<std::string>& failure) {
        if (failure) folder_.fail(name, *failure);
        if (!folder_.has_ended(name)) folder_.fail(name, "the worker reported the end of the case, but left no result");
        // It may have waited for long, and read other files than were grouped.
        if (const BatchCase& one = *std::ranges::find(cases_, name, &BatchCase::name); !has_xrays_of_manifest(one)) {
          folder_.set_aside(name);
          folder_.fail(name, "its X-rays were changed while the batch ran. Start the batch again");
          inputs.note_nothing(one);
        }
        observer_.progress(step, ++ended, total);
      },
      [&] { return end.is_asked_for(); });
  return ended == total;
}

std::vector<std::string> Batch::arguments() const {
  std::vector<std::string> words = {"batch",    std::filesystem::absolute(options_.cases).string(),
                                    "--output", std::filesystem::absolute(options_.output).string(),
                                    "--jobs",   fmt::format("{}", options_.jobs)};
  words.insert(words.end(), options_.kept.begin(), options_.kept.end());
  return words;
}

}  // namespace isoshift
