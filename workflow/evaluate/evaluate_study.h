#pragma once
// Many registrations of one study from published starts, and their errors against its known truth.

#include <Eigen/Geometry>
#include <filesystem>

#include "registration/evaluate.h"
#include "workflow/evaluate/evaluation_files.h"
#include "workflow/observer.h"
#include "workflow/register/registration_setup.h"
#include "workflow/register/study_options.h"
#include "workflow/register/truth.h"

namespace isoshift {

struct EvaluateOptions {
  StudyOptions study;
  RegistrationRequest registration;  // settle() must have been called
  StartProtocol protocol;
  bool has_seed_per_run = false;  // run n searches with the request's seed + n: every run draws other pixels
  std::string target;             // the structure whose error counts, or "isocenter"; empty: as target_of() finds it
  int jobs = 0;  // registrations at a time, each on one thread; 1: one on all cores; 0: as many as the machine's cores
  Eigen::Isometry3d truth = Eigen::Isometry3d::Identity();  // the true setup error, at the isocenter
  std::vector<BodyTruth> body_truths;                       // empty: nobody knows what single bones did
  std::filesystem::path truth_file;                         // must be of the study's setup; empty: nobody checks
  std::filesystem::path output;
  // What EvaluationFolder::study() must be, so that the evaluation belongs to others. Empty: anything.
  nlohmann::ordered_json of_study;
};

// Throws UsageError if several jobs are asked of a renderer that can only do one registration at a time.
void check_jobs(int jobs, RendererKind kind);

// Runs the registrations that are not yet in the folder, and writes summary and plots. Throws UsageError as
// check_jobs() does, and Error for another study than options.of_study; then nothing is written.
EvaluationFolder evaluate_study(const EvaluateOptions& options, Notes& notes, Observer& observer);

// The same of a study that options.study has loaded.
EvaluationFolder evaluate_loaded(const Study& study, EvaluateOptions options, Observer& observer);

}  // namespace isoshift
