#pragma once
// What a person does with a study on the screen: registers it from the pose set by hand, or keeps that pose. Every
// registration runs in a child process and leaves a result of its own.

#include <Eigen/Geometry>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "workflow/register/registration_process.h"

namespace isoshift {

// Several threads may use it.
class ManualRegistration {
 public:
  // `order`: what is registered, and how; its start, output and progress are set here. Results are written to
  // `results`/1, `results`/2 and so on, which must be of a folder that nobody else writes into at the same time.
  ManualRegistration(RegistrationOrder order, std::filesystem::path results);

  const std::filesystem::path& results() const { return results_; }

  // Begins a registration from a pose that `by` has set, or keeps the pose as it is. `region`: flags of isoshift
  // register for what is compared, in the place of those of the order; empty: these. Throws Error if another one runs.
  void begin(const Eigen::Isometry3d& setup_error, const std::string& by, bool is_searched,
             const std::vector<std::string>& region = {});

  struct State {
    enum class What { kIdle, kRuns, kEnded, kFailed } what = What::kIdle;
    std::string by;                                 // who has begun it
    Progressed progress;                            // of what runs
    std::filesystem::path result;                   // folder of what has ended
    std::map<std::string, std::string> files = {};  // SHA-256 by name, of all files that the child wrote there
    std::string failure = {};                       // why the last one has no result
  };
  State state();

  // Ends what runs, without a result. Throws Error if another person has begun it.
  void cancel(const std::string& by);

  // Says no more of what has ended: its result was moved away.
  void forget();

 private:
  void look();
  void end_process();
  std::filesystem::path pose_file() const { return results_ / ".pose.json"; }

  const RegistrationOrder order_;
  const std::filesystem::path results_;
  std::mutex mutex_;
  std::unique_ptr<RegistrationProcess> running_;
  std::filesystem::path output_;  // of what runs
  State state_;
};

}  // namespace isoshift
