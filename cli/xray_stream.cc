#include "cli/xray_stream.h"

#include <fmt/format.h>

#include <algorithm>

#include "geometry/error.h"

namespace isoshift {

void XrayStream::take(RtImage header, Notes& notes) {
  const std::string instance = fmt::format("{}#{}", header.sop_instance_uid, header.frame);
  if (!seen_instances_.insert(instance).second) {
    ++counts_.repeated;
    return;
  }
  Notes applied;  // the study's own notes say what was supplied
  if (request_.machine) header = with_machine(header, *request_.machine, request_.switches, applied);
  header = with_switches(header, request_.switches, applied);
  if (!header.patient_position) header.patient_position = std::string(to_string(study_.patient_position));
  if (header.identity.patient_id != study_.ct.identity.patient_id)
    throw Error(fmt::format("{}: {} differs from the CT's", header.path.string(), described(DCM_PatientID)));
  if (const auto missing = missing_attributes(header); !missing.empty())
    throw Error(fmt::format("{}: {} is missing", header.path.string(), described(missing.front().tag)));
  const auto time_s = acquisition_seconds(header);
  if (!time_s) throw Error(fmt::format("{}: {} is missing", header.path.string(), described(DCM_AcquisitionTime)));
  if (processed_until_s_ && *time_s <= *processed_until_s_) {
    ++counts_.late;
    notes.warnings.push_back(
        fmt::format("{}: came after a later one had been processed, and was left out", header.path.string()));
    return;
  }
  const auto place = std::ranges::upper_bound(waiting_, *time_s, {}, &TimedXray::time_s);
  waiting_.insert(place, {.header = std::move(header), .time_s = *time_s});
}

void XrayStream::offer(const std::vector<std::filesystem::path>& files, int tries, Notes& notes) {
  for (const std::filesystem::path& file : files) {
    if (taken_files_.contains(file)) continue;
    try {
      Notes unimportant;
      for (RtImage& header : read_rt_images(file, unimportant)) take(std::move(header), notes);
    } catch (const Error& error) {
      if (++failures_[file] < tries) continue;
      ++counts_.broken;
      notes.warnings.push_back(fmt::format("left out: {}", error.what()));
    }
    failures_.erase(file);
    taken_files_.insert(file);
  }
}

std::vector<TimedXray> XrayStream::next_moment(double together_s, std::size_t imagers, bool may_be_incomplete) {
  if (waiting_.empty()) return {};
  std::vector<TimedXray> moment;
  std::set<std::string> labels;
  const double begin_s = waiting_.front().time_s;
  for (const TimedXray& xray : waiting_) {
    if (xray.time_s > begin_s + together_s || !labels.insert(imager_label(xray.header)).second) break;
    moment.push_back(xray);
  }
  const bool later_waits = moment.size() < waiting_.size();
  if (moment.size() < imagers && !later_waits && !may_be_incomplete) return {};
  waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(moment.size()));
  processed_until_s_ = moment.back().time_s;
  return moment;
}

}  // namespace isoshift
