#include "workflow/room/clock_comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <ctime>

namespace isoshift {
namespace {

// Seconds since the epoch of StudyFiles::Image::at_s.
double seconds_of(ClockComparison::SystemTime now, bool in_utc) {
  const double utc_s = now.time_since_epoch().count();
  const auto whole = static_cast<std::time_t>(utc_s);
  std::tm local{};
  if (in_utc || ::localtime_r(&whole, &local) == nullptr) return utc_s;
  return utc_s + static_cast<double>(local.tm_gmtoff);
}

}  // namespace

void ClockComparison::update(const std::map<std::string, Patient>& patients, SystemTime now) {
  for (const auto& [patient_id, patient] : patients) {
    const auto [looked_at, is_new] = looked_at_.try_emplace(patient_id, patient.last);
    if (!is_new && looked_at->second == patient.last) continue;
    looked_at->second = patient.last;
    for (const auto* images : {&patient.files.images, &patient.files.other_xrays})
      for (const StudyFiles::Image& image : *images) {
        if (!seen_.insert(image.sop_instance_uid).second || !has_begun_ || !image.at_s) continue;
        std::deque<double>& ages_s = ages_s_[image.machine];
        ages_s.push_back(seconds_of(now, image.has_utc_offset) - *image.at_s);
        if (ages_s.size() > kNewest) ages_s.pop_front();
      }
  }
  has_begun_ = true;
}

std::string ClockComparison::beyond(double limit_s) const {
  std::string words;
  const auto add = [&](const std::string& machine, const std::string& what) {
    words += fmt::format("{}{}: {}", words.empty() ? "" : "; ", machine.empty() ? "a machine without a name" : machine,
                         what);
  };
  for (const auto& [machine, ages_s] : ages_s_) {
    const double least = std::ranges::min(ages_s);
    if (-least > limit_s)
      add(machine, fmt::format("its clock is at least {:.0f} s ahead of this computer's", -least));
    else if (ages_s.size() == kNewest && least > limit_s)
      add(machine, fmt::format("its last {} X-rays came {:.0f} s and more after they were taken: its clock is behind "
                               "this computer's, or X-rays come late",
                               kNewest, least));
  }
  return words;
}

}  // namespace isoshift
