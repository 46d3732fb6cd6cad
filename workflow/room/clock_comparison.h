#pragma once
// Compares the clocks of imagers with that of this computer, by when X-rays were acquired and when they arrived.

#include <chrono>
#include <deque>
#include <map>
#include <set>
#include <string>

#include "io/study/study_files.h"
#include "workflow/room/source.h"

namespace isoshift {

class ClockComparison {
 public:
  using SystemTime = std::chrono::sys_time<std::chrono::duration<double>>;

  // Takes the X-rays that have arrived since the last call. Those of the first call may have arrived long ago, and tell
  // nothing, as do X-rays of which the time of acquisition is not known. `now`: of this computer's clock.
  void update(const std::map<std::string, Patient>& patients, SystemTime now);

  // The machines whose clock is off by more than a limit, in words; empty: none. An X-ray from the future proves it. An
  // image that is late may have waited somewhere: a clock counts as behind if the newest three X-rays were all late.
  std::string beyond(double limit_s) const;

 private:
  static constexpr std::size_t kNewest = 3;

  std::map<std::string, Clock::Time> looked_at_;      // Patient::last at that time, by PatientID
  std::set<std::string> seen_;                        // SOPInstanceUIDs
  std::map<std::string, std::deque<double>> ages_s_;  // at their arrival, the newest last, by RadiationMachineName
  bool has_begun_ = false;
};

}  // namespace isoshift
