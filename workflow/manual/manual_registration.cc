#include "workflow/manual/manual_registration.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/output_folder.h"
#include "workflow/register/setup_error_json.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

fs::path next_in(const fs::path& results) {
  for (int number = 1;; ++number)
    if (const fs::path next = results / std::to_string(number); !fs::exists(next)) return next;
}

}  // namespace

ManualRegistration::ManualRegistration(RegistrationOrder order, fs::path results)
    : order_(std::move(order)), results_(std::move(results)) {}

void ManualRegistration::begin(const Eigen::Isometry3d& setup_error, const std::string& by, bool is_searched) {
  const std::lock_guard lock(mutex_);
  look();
  if (running_) throw Error("A registration runs. Wait for its end, or cancel it.");
  fs::create_directories(results_);
  output_ = next_in(results_);
  RegistrationOrder order = order_;
  order.start = pose_file();
  order.is_searched = is_searched;
  order.output = output_;
  order.tells_progress = true;
  write_text(order.start,
             nlohmann::json{{"setup_error", json_of_setup_error(setup_error)}, {"set_by", by}}.dump());  // start_pose.h
  state_ = {.what = State::What::kRuns};
  running_ = std::make_unique<RegistrationProcess>(order);
}

void ManualRegistration::look() {
  if (!running_) return;
  const std::optional<RegistrationProcess::End> end = running_->end();
  state_.progress = running_->progress();
  if (!end) return;
  end_process();
  if (end->failure.empty())
    state_ = {.what = State::What::kEnded, .result = output_};
  else
    state_ = {.what = State::What::kFailed, .failure = end->failure};
}

void ManualRegistration::end_process() {
  running_.reset();
  std::error_code ignored;  // the result holds the pose
  fs::remove(pose_file(), ignored);
}

ManualRegistration::State ManualRegistration::state() {
  const std::lock_guard lock(mutex_);
  look();
  return state_;
}

void ManualRegistration::cancel() {
  const std::lock_guard lock(mutex_);
  if (!running_) return;
  end_process();
  state_ = {};
}

void ManualRegistration::forget() {
  const std::lock_guard lock(mutex_);
  if (!running_) state_ = {};
}

}  // namespace isoshift
