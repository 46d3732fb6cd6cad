#include "workflow/manual/manual_registration.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <set>

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

// What a registration left whose parent was killed: "3.partial-Xd82la".
void remove_unfinished(const fs::path& results) {
  std::vector<fs::path> unfinished;
  for (const auto& entry : fs::directory_iterator(results)) {
    const std::string name = entry.path().filename().string();
    if (const auto digits = name.find_first_not_of("0123456789");
        digits != 0 && digits != std::string::npos && name.compare(digits, 9, ".partial-") == 0)
      unfinished.push_back(entry.path());
  }
  for (const fs::path& folder : unfinished) fs::remove_all(folder);
}

// Flags as they are typed: "--body 3" or "--body=3".
std::vector<std::string> with_region(const std::vector<std::string>& flags, const std::vector<std::string>& region) {
  static const std::set<std::string> of_region = {"--structure", "--body", "--around-isocenter", "--rectangle"};
  std::vector<std::string> all;
  for (std::size_t n = 0; n < flags.size(); ++n) {
    if (!of_region.contains(flags[n].substr(0, flags[n].find('='))))
      all.push_back(flags[n]);
    else if (of_region.contains(flags[n]))
      ++n;  // its value
  }
  std::ranges::copy(region, std::back_inserter(all));
  return all;
}

}  // namespace

ManualRegistration::ManualRegistration(RegistrationOrder order, fs::path results)
    : order_(std::move(order)), results_(std::move(results)) {}

void ManualRegistration::begin(const Eigen::Isometry3d& setup_error, const std::string& by, bool is_searched,
                               const std::vector<std::string>& region) {
  const std::lock_guard lock(mutex_);
  look();
  if (running_) throw Error("A registration runs. Wait for its end, or cancel it.");
  fs::create_directories(results_);
  remove_unfinished(results_);
  output_ = next_in(results_);
  RegistrationOrder order = order_;
  if (!region.empty()) order.flags = with_region(order_.flags, region);
  order.start = pose_file();
  order.is_searched = is_searched;
  order.output = output_;
  order.tells_progress = true;
  replace_text(
      order.start,
      nlohmann::json{{"setup_error", json_of_setup_error(setup_error)}, {"set_by", by}}.dump());  // start_pose.h
  state_ = {.what = State::What::kRuns, .by = by};
  running_ = std::make_unique<RegistrationProcess>(order);
}

void ManualRegistration::look() {
  if (!running_) return;
  const std::optional<RegistrationProcess::End> end = running_->end();
  state_.progress = running_->progress();
  if (!end) return;
  end_process();
  if (end->failure.empty())
    state_ = {.what = State::What::kEnded, .by = state_.by, .result = output_, .files = end->files};
  else
    state_ = {.what = State::What::kFailed, .by = state_.by, .failure = end->failure};
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

void ManualRegistration::cancel(const std::string& by) {
  const std::lock_guard lock(mutex_);
  if (!running_) return;
  if (state_.by != by) throw Error(fmt::format("{} has begun this registration.", state_.by));
  end_process();
  state_ = {};
}

void ManualRegistration::forget() {
  const std::lock_guard lock(mutex_);
  if (!running_) state_ = {};
}

}  // namespace isoshift
