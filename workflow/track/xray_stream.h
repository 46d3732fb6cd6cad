#pragma once
// X-rays of a moving target in the order of acquisition, from files that exist or still arrive.

#include <deque>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <unordered_set>
#include <vector>

#include "io/study/study.h"
#include "workflow/register/study_options.h"

namespace isoshift {

struct TimedXray {
  RtImage header;
  double time_s = 0.0;            // since an epoch
  std::optional<XrayImage> xray;  // set for files that still arrive: their pixels are read at once
};

// Counts of the files that are not used.
struct StreamCounts {
  std::size_t repeated = 0;  // the same instance had arrived before
  std::size_t late = 0;      // taken before a moment that was processed already
  std::size_t broken = 0;    // cannot be read, or is of another patient
};

class XrayStream {
 public:
  // `reads_pixels`: reads pixels at once, for files that still arrive.
  XrayStream(const StudyRequest& request, const Study& study, bool reads_pixels)
      : request_(request), study_(study), reads_pixels_(reads_pixels) {}

  // Reads the files that are not done. A file that cannot be read yet is tried again by the next calls, and given up
  // after `tries` calls. Each warning is given once.
  void offer(const std::vector<std::filesystem::path>& files, int tries, Notes& notes);

  // The X-rays of the earliest moment: those of all imagers within `together_s`. Empty if no moment is complete.
  // `may_be_incomplete`: returns a moment even if another imager's X-ray of that moment may still arrive.
  std::vector<TimedXray> next_moment(double together_s, bool may_be_incomplete);

  // When the first of all X-rays was taken.
  std::optional<double> begin_s() const { return begin_s_; }
  const StreamCounts& counts() const { return counts_; }
  const std::vector<double>& late_s() const { return late_s_; }  // acquisition times
  std::size_t waiting() const { return waiting_.size(); }
  std::size_t imagers() const { return imagers_.size(); }
  const std::unordered_set<std::string>& done_files() const { return done_files_; }  // offering them again does nothing

 private:
  std::optional<TimedXray> checked(RtImage header) const;
  void take(TimedXray xray, Notes& notes);

  StudyRequest request_;
  const Study& study_;
  bool reads_pixels_;
  std::set<std::string> imagers_;
  std::deque<TimedXray> waiting_;  // by time
  std::unordered_set<std::string> seen_instances_;
  std::unordered_set<std::string> done_files_;
  std::map<std::filesystem::path, int> failures_;
  std::optional<double> begin_s_, processed_until_s_;
  StreamCounts counts_;
  std::vector<double> late_s_;
};

}  // namespace isoshift
