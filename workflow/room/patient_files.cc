#include "workflow/room/patient_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "base/error.h"
#include "base/sha256.h"
#include "io/dicom/dicom_dataset.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

// Whether it is there and can be read to its end.
bool is_whole(const fs::path& file) {
  try {
    DicomFile::read(file, DicomFile::Extent::kWhole);
    return true;
  } catch (const Error&) {
    return false;
  }
}

// A file that is gone by now may have differed.
bool differ(const fs::path& a, const fs::path& b) {
  try {
    return sha256_of_file(a) != sha256_of_file(b);
  } catch (const Error&) {
    return true;
  }
}

void remove_from(StudyFiles& files, const fs::path& file, const std::string& uid) {
  for (StudyFiles::Ct& ct : files.cts)
    if (std::erase(ct.files, file) > 0) ct.sop_instance_uids.erase(uid);
  std::erase_if(files.cts, [](const auto& ct) { return ct.files.empty(); });
  const auto is_it = [&](const auto& entry) { return entry.file == file; };
  std::erase_if(files.plans, is_it);
  std::erase_if(files.structures, is_it);
  std::erase_if(files.images, is_it);
  std::erase_if(files.drrs, is_it);
  std::erase_if(files.other_xrays, is_it);
}

// Notes in the X-ray of `file` that `other` has its SOPInstanceUID and other contents.
void note_other(StudyFiles& files, const fs::path& file, const fs::path& other) {
  for (auto* images : {&files.images, &files.other_xrays})
    for (StudyFiles::Image& image : *images)
      if (image.file == file) image.other = other;
}

}  // namespace

std::optional<KnownFile> known_file_in(const StudyFiles& one) {
  const auto known = [](const auto& entry) { return KnownFile{patient_id_of(entry.patient), entry.sop_instance_uid}; };
  if (!one.cts.empty())
    return KnownFile{patient_id_of(one.cts.front().patient), *one.cts.front().sop_instance_uids.begin()};
  if (!one.plans.empty()) return known(one.plans.front());
  if (!one.structures.empty()) return known(one.structures.front());
  if (!one.images.empty()) return known(one.images.front());
  if (!one.drrs.empty()) return known(one.drrs.front());
  if (!one.other_xrays.empty()) return known(one.other_xrays.front());
  return std::nullopt;
}

std::vector<fs::path> PatientFiles::forget(const fs::path& file) {
  unreadable_.erase(file);
  std::vector<fs::path> copies;
  const auto known = known_.find(file);
  if (known == known_.end()) return copies;
  const auto& [patient_id, uid] = known->second;
  const auto [first, end] = copies_of_.equal_range(uid);
  std::transform(first, end, std::back_inserter(copies), [](const auto& copy) { return copy.second; });
  copies_of_.erase(first, end);
  file_of_uid_.erase(uid);
  StudyFiles& files = patients_.at(patient_id).files;
  for (const fs::path& copy : copies) remove_from(files, copy, uid);
  remove_from(files, file, uid);
  if (files.cts.empty() && files.plans.empty() && files.structures.empty() && files.images.empty() &&
      files.drrs.empty() && files.other_xrays.empty())
    patients_.erase(patient_id);
  known_.erase(known);
  return copies;
}

void PatientFiles::forget_copy(const fs::path& file) {
  const auto gone = std::ranges::find(copies_of_, file, [](const auto& copy) { return copy.second; });
  if (gone == copies_of_.end()) return;
  const std::string uid = gone->first;
  copies_of_.erase(gone);
  const fs::path used = file_of_uid_.at(uid);
  remove_from(patients_.at(known_.at(used).patient_id).files, file, uid);
  const auto [first, end] = copies_of_.equal_range(uid);
  const auto other = std::find_if(first, end, [&](const auto& copy) { return differ(copy.second, used); });
  note_other(patients_.at(known_.at(used).patient_id).files, used, other == end ? fs::path() : other->second);
}

PatientFiles::Taken PatientFiles::take(const fs::path& file, Notes& notes) {
  Taken taken{.copies = forget(file)};
  StudyFiles one;
  try {
    one = scan_file(file);
  } catch (const Error& error) {
    notes.warnings.push_back(fmt::format("left aside: {}", error.what()));
    unreadable_[file] = error.what();
    return taken;
  }
  const std::optional<KnownFile> found = known_file_in(one);
  if (!found) return taken;
  if (const auto earlier = file_of_uid_.find(found->uid); earlier != file_of_uid_.end()) {
    const fs::path before = earlier->second;
    if (is_whole(before)) {
      Patient& patient = patients_.at(known_.at(before).patient_id);
      patient.last = clock_.now();
      copies_of_.emplace(found->uid, file);
      if (differ(before, file)) {
        note_other(patient.files, before, file);
        std::ranges::move(one.plans, std::back_inserter(patient.files.plans));  // choose_parts() refuses the two
        taken.differs = true;
        notes.warnings.push_back(fmt::format("{}: left aside: differs from {}, which has the same SOPInstanceUID",
                                             file.string(), before.string()));
      }
      return taken;
    }
    std::ranges::move(forget(before), std::back_inserter(taken.copies));
    taken.replaced = before;
  }
  file_of_uid_[found->uid] = file;
  known_[file] = *found;
  Patient& patient = patients_[found->patient_id];
  patient.last = clock_.now();
  for (const StudyFiles::Image& drr : one.drrs)
    notes.warnings.push_back(
        fmt::format("{}: says that it is a DRR: it is left aside where the patient has X-rays", drr.file.string()));
  merge(std::move(one), patient.files);
  return taken;
}

}  // namespace isoshift
