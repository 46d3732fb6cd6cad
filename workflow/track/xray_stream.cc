#include "workflow/track/xray_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "base/error.h"
#include "io/study/session.h"

namespace isoshift {

// With what a person supplied and allowed, or the reason why it cannot be followed; nothing for one seen before.
std::optional<TimedXray> XrayStream::checked(RtImage header) const {
  if (seen_instances_.contains(fmt::format("{}#{}", header.sop_instance_uid, header.frame))) return std::nullopt;
  const std::string where = header.path.string();
  header.label = imager_label(header);
  Notes said;  // the earliest X-rays' notes have been said
  if (request_.machine) header = with_machine(header, *request_.machine, request_.switches, said);
  header = with_switches(header, request_.switches, said);
  if (!header.patient_position) header.patient_position = std::string(to_string(study_.patient_position));
  std::vector<FailedCheck> findings = rt_image_findings(header);
  std::ranges::move(patient_findings({&study_.ct->identity, "the CT"}, {&header.identity, where}),
                    std::back_inserter(findings));
  std::ranges::move(table_findings(header, study_.rt_images.front()), std::back_inserter(findings));
  settle(findings, request_.allowed, said);
  if (const auto missing = missing_attributes(header); !missing.empty())
    throw Error(fmt::format("{}: {} {}", where, described(missing.front().tag), missing.front().problem()));
  const auto time_s = acquisition_seconds(header);
  if (!time_s) throw Error(fmt::format("{}: {} is missing", where, described(DCM_AcquisitionTime)));
  TimedXray timed{.header = std::move(header), .time_s = *time_s, .xray = std::nullopt};
  if (reads_pixels_) {
    const DicomFile file = DicomFile::read(timed.header.path, DicomFile::Extent::kWhole);
    timed.xray = read_xray_image(file, timed.header, xray_view(timed.header, beam_of(timed.header, said), said));
  }
  return timed;
}

void XrayStream::take(TimedXray timed, Notes& notes) {
  seen_instances_.insert(fmt::format("{}#{}", timed.header.sop_instance_uid, timed.header.frame));
  imagers_.insert(timed.header.label);
  const std::string where = timed.header.path.string();
  if (processed_until_s_ && timed.time_s <= *processed_until_s_) {
    ++counts_.late;
    late_s_.push_back(timed.time_s);
    notes.warnings.push_back(fmt::format("{}: left aside: it arrived after a later X-ray had been processed", where));
    return;
  }
  const auto same_moment = [&](const TimedXray& other) {
    return other.time_s == timed.time_s && other.header.label == timed.header.label;
  };
  if (std::ranges::any_of(waiting_, same_moment)) {
    ++counts_.broken;
    notes.warnings.push_back(fmt::format("{}: left aside: another X-ray of {} has the same {}", where,
                                         timed.header.label, described(DCM_AcquisitionTime)));
    return;
  }
  if (!begin_s_ || timed.time_s < *begin_s_) begin_s_ = processed_until_s_ ? begin_s_ : timed.time_s;
  waiting_.insert(std::ranges::upper_bound(waiting_, timed.time_s, {}, &TimedXray::time_s), std::move(timed));
}

void XrayStream::offer(const std::vector<std::filesystem::path>& files, int tries, Notes& notes) {
  for (const std::filesystem::path& file : files) {
    if (done_files_.contains(file.native())) continue;
    try {
      Notes unimportant;
      std::vector<TimedXray> of_file;
      for (RtImage& header : read_rt_images(file, unimportant)) {
        if (auto timed = checked(std::move(header)))
          of_file.push_back(std::move(*timed));
        else
          ++counts_.repeated;
      }
      for (TimedXray& timed : of_file) take(std::move(timed), notes);
    } catch (const Error& error) {
      if (!std::filesystem::exists(file)) continue;  // renamed meanwhile
      if (++failures_[file] < tries) continue;
      ++counts_.broken;
      notes.warnings.push_back(fmt::format("left aside: {}", error.what()));
    }
    failures_.erase(file);
    done_files_.insert(file.native());
  }
}

std::vector<TimedXray> XrayStream::next_moment(double together_s, bool may_be_incomplete) {
  if (waiting_.empty()) return {};
  std::set<std::string> labels;
  std::size_t count = 0;
  const double begin_s = waiting_.front().time_s;
  for (; count < waiting_.size(); ++count)
    if (waiting_[count].time_s > begin_s + together_s || !labels.insert(waiting_[count].header.label).second) break;
  if (count < imagers_.size() && count == waiting_.size() && !may_be_incomplete) return {};
  std::vector<TimedXray> moment(std::make_move_iterator(waiting_.begin()),
                                std::make_move_iterator(waiting_.begin() + static_cast<std::ptrdiff_t>(count)));
  waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(count));
  processed_until_s_ = moment.back().time_s;
  return moment;
}

}  // namespace isoshift
