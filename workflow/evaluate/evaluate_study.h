#pragma once
// Many registrations of one study from published starts, and their errors against its known truth.

#include <Eigen/Geometry>
#include <filesystem>

#include "registration/evaluate.h"
#include "workflow/evaluate/evaluation_files.h"
#include "workflow/observer.h"
#include "workflow/register/registration_setup.h"
#include "workflow/register/study_options.h"

namespace isoshift {

struct EvaluateOptions {
  StudyOptions study;
  RegistrationRequest registration;  // settled
  StartProtocol protocol;
  int jobs = 0;  // registrations at a time, each on one thread; 1: one on all cores; 0: as many as there are cores
  Eigen::Isometry3d truth = Eigen::Isometry3d::Identity();  // setup error
  std::filesystem::path output;
};

// Runs what the folder of an earlier call lacks, and writes summary and plots. Throws UsageError for several jobs of a
// renderer that does one registration at a time.
EvaluationFolder evaluate_study(const EvaluateOptions& options, Notes& notes, Observer& observer);

}  // namespace isoshift
