#include "io/study/study_files.h"

#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <iterator>
#include <utility>

#include "base/error.h"
#include "base/local_time.h"
#include "base/option_name.h"
#include "base/parallel.h"
#include "base/sha256.h"
#include "io/dicom/dicom_dataset.h"
#include "io/dicom/rt_image.h"
#include "io/dicom/rt_structures.h"
#include "io/study/files_below.h"
#include "io/study/session_choice.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

std::string first_reference(const DicomItem& dataset, const DcmTagKey& sequence) {
  for (const DicomItem& item : dataset.items(sequence)) return item.uid(DCM_ReferencedSOPInstanceUID).value_or("");
  return "";
}

// The series that a structure set was drawn on (PS3.3 C.8.8.5), and its images.
struct DrawnOn {
  std::set<std::string> series_uids, image_uids;
};
DrawnOn drawn_on(const DicomItem& structures) {
  DrawnOn drawn;
  for (const DicomItem& frame : structures.items(DCM_ReferencedFrameOfReferenceSequence))
    for (const DicomItem& study : frame.items(DCM_RTReferencedStudySequence))
      for (const DicomItem& series : study.items(DCM_RTReferencedSeriesSequence)) {
        if (const auto uid = series.uid(DCM_SeriesInstanceUID)) drawn.series_uids.insert(*uid);
        for (const DicomItem& image : series.items(DCM_ContourImageSequence))
          if (const auto uid = image.uid(DCM_ReferencedSOPInstanceUID)) drawn.image_uids.insert(*uid);
      }
  return drawn;
}

// The frames of reference of the structures: every one has its own (PS3.3 C.8.8.5).
std::set<std::string> drawn_in(const DicomItem& structures) {
  std::set<std::string> frame_uids;
  for (const DicomItem& roi : structures.items(DCM_StructureSetROISequence))
    if (const auto uid = roi.uid(DCM_ReferencedFrameOfReferenceUID)) frame_uids.insert(*uid);
  return frame_uids;
}

// Whose file it is: IDs of two issuers are two patients.
std::string patient_of(const DicomItem& dataset) {
  return dataset.text(DCM_PatientID).value_or("") + "\\" + dataset.text(DCM_IssuerOfPatientID).value_or("");
}

// "Prostate 20260301": what tells one of several objects from the others.
std::string label_of(const DicomItem& dataset, const DcmTagKey& name, const DcmTagKey& date) {
  std::string label = dataset.text(name).value_or("");
  if (const auto on = dataset.text(date)) label += (label.empty() ? "" : " ") + *on;
  return label;
}

// A read-out of the dataset, else of its first exposure that has it.
std::optional<double> read_out(const DicomItem& dataset, const DcmTagKey& tag) {
  if (const auto value = dataset.number(tag)) return value;
  for (const DicomItem& exposure : dataset.items(DCM_ExposureSequence))
    if (const auto value = exposure.number(tag)) return value;
  return std::nullopt;
}

StudyFiles::Image xray(const fs::path& path, const DicomItem& dataset) {
  RtImage timed;
  read_acquisition_time(dataset, timed);
  constexpr double kMostFractions = 1e6;
  const double fraction = dataset.number(DCM_FractionNumber).value_or(0.0);
  return {.file = path,
          .patient = patient_of(dataset),
          .sop_instance_uid = dataset.required_uid(DCM_SOPInstanceUID),
          .plan_uid = first_reference(dataset, DCM_ReferencedRTPlanSequence),
          .label = dataset.text(DCM_RTImageLabel).value_or(""),
          .machine = dataset.text(DCM_RadiationMachineName).value_or(""),
          .at_s = acquisition_seconds(timed),
          .has_utc_offset = timed.utc_offset_min.has_value(),
          .acquired = acquired(timed),
          .fraction =
              fraction >= 1.0 && fraction < kMostFractions ? std::optional(static_cast<int>(fraction)) : std::nullopt,
          .table = read_table_read_outs([&](const TableReadOut& one) { return read_out(dataset, one.tag); },
                                        dataset.text(DCM_ReportedValuesOrigin))};
}

// Whether an RT Image says that it was computed: a plan is exported with its DRRs, fluences and dose images. Some
// planning systems call a DRR a radiograph, and some do not say what it is; it is derived, and its angles are those of
// the plan.
bool is_computed(const DicomItem& dataset) {
  const auto values = dataset.texts(DCM_ImageType);
  const std::string type = rt_image_type(dataset);
  if (!values.empty() && values[0] == "DERIVED" && (type.empty() || dataset.text(DCM_ReportedValuesOrigin) == "PLAN"))
    return true;
  return type == "DRR" || type == "FLUENCE" || type == "BLANK";
}

// Of whom there are X-rays, by PatientID.
std::set<std::string> patients_with_xrays(const StudyFiles& files) {
  std::set<std::string> patients;
  for (const auto* images : {&files.images, &files.other_xrays})
    for (const StudyFiles::Image& image : *images) patients.insert(patient_id_of(image.patient));
  return patients;
}

void add_ct_slice(const fs::path& path, const DicomItem& dataset, StudyFiles& files) {
  const auto type = dataset.texts(DCM_ImageType);
  if (type.size() > 2 && type[2] == "LOCALIZER") {
    files.left_aside.push_back(fmt::format("{}: a CT localizer", path.string()));
    return;
  }
  files.cts.push_back({.patient = patient_of(dataset),
                       .series_instance_uid = dataset.required_uid(DCM_SeriesInstanceUID),
                       .label = label_of(dataset, DCM_SeriesDescription, DCM_SeriesDate),
                       .frame_of_reference_uid = dataset.uid(DCM_FrameOfReferenceUID).value_or(""),
                       .files = {path},
                       .sop_instance_uids = {dataset.required_uid(DCM_SOPInstanceUID)}});
}

bool is_other_xray(const std::string& sop_class) {
  return sop_class == UID_ComputedRadiographyImageStorage || sop_class == UID_DigitalXRayImageStorageForPresentation ||
         sop_class == UID_DigitalXRayImageStorageForProcessing || sop_class == UID_XRayAngiographicImageStorage ||
         sop_class == UID_XRayRadiofluoroscopicImageStorage;
}

// X-rays as machines write them for themselves. What begins like this, or, where a format has no beginning, is named
// like this.
struct OtherFormat {
  std::string_view beginning, extension, name, advice;
};
constexpr std::string_view kExport = "have the console or the record-and-verify system export it as a DICOM RT Image";
constexpr std::array kOtherFormats = {
    OtherFormat{"VMS.XI", ".xim", "an image of a Varian linac (XIM)", kExport},
    OtherFormat{"", ".hnd", "an image of a Varian imager (HND)", kExport},
    OtherFormat{"", ".hnc", "an image of a Varian imager (HNC)", kExport},
    OtherFormat{std::string_view("\x00\x70\x44\x00", 4), ".his", "an image of an Elekta imager (HIS)", kExport},
    OtherFormat{"", ".raw", "pixels without a header, as ExacTrac writes them",
                "have the system export it as DICOM, and supply the geometry by a machine profile"}};

// "FILE: what it is, and what to do"; empty: another file.
std::string other_format(const fs::path& path) {
  std::string beginning(8, '\0'), extension = path.extension().string();
  std::ifstream file(path, std::ios::binary);
  file.read(beginning.data(), static_cast<std::streamsize>(beginning.size()));
  std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
  for (const OtherFormat& format : kOtherFormats)
    if (format.beginning.empty() ? extension == format.extension : beginning.starts_with(format.beginning))
      return fmt::format("{}: {}, which is not read: {}", path.string(), format.name, format.advice);
  return "";
}

// Where one kind of part was looked for, for a message: what was named for it, else the study.
std::string searched(const std::vector<fs::path>& named, const fs::path& study) {
  if (!named.empty()) return "searched " + named.front().string() + (named.size() > 1 ? " and others" : "");
  return study.empty() ? "no study folder was given" : "searched " + study.string();
}

// A file that cannot be read may be a slice or a view: what is left would be another study.
StudyFiles scan_readable(const std::vector<fs::path>& paths) {
  StudyFiles files = scan_study(paths);
  if (!files.unreadable.empty()) throw Error(files.unreadable.front());
  return files;
}

// Of copies of a plan the first is kept. Two plans of one UID that differ say two things of one patient.
void drop_copies(std::vector<StudyFiles::Plan>& plans, Notes& notes) {
  for (auto plan = plans.begin(); plan != plans.end();) {
    const auto first = std::find_if(plans.begin(), plan, [&](const StudyFiles::Plan& other) {
      return other.sop_instance_uid == plan->sop_instance_uid;
    });
    if (first == plan) {
      ++plan;
      continue;
    }
    if (sha256_of_file(first->file) != sha256_of_file(plan->file))
      throw Error(fmt::format(
          "{}: has the {} of {}, but other contents.\n"
          "       Name the plan: {}",
          plan->file.string(), described(DCM_SOPInstanceUID), first->file.string(), option("plan", "FILE")));
    notes.left_aside.push_back(fmt::format("{}: the same RT Plan as {}", plan->file.string(), first->file.string()));
    plan = plans.erase(plan);
  }
}

// The plan that all images with a reference refer to, or the only one there is; nothing if there is none.
const StudyFiles::Plan* choose_plan(const StudyFiles& files, bool was_named) {
  if (files.plans.empty()) return nullptr;
  if (files.plans.size() == 1) return &files.plans.front();
  std::vector<const StudyFiles::Plan*> referred;
  for (const StudyFiles::Plan& plan : files.plans)
    if (std::ranges::find(files.images, plan.sop_instance_uid, &StudyFiles::Image::plan_uid) != files.images.end())
      referred.push_back(&plan);
  if (referred.size() == 1) return referred.front();
  std::string list;
  for (const StudyFiles::Plan& plan : files.plans) list += "\n       " + plan.file.string();
  throw Error(
      fmt::format("{} RT Plans {}, and the X-rays do not tell which one is meant:{}\n"
                  "       Name the plan: {}",
                  files.plans.size(), was_named ? "named" : "found", list, option("plan", "FILE")));
}

// The CT in whose frame of reference the plan was made; of several, the one its structure set was drawn on.
const StudyFiles::Ct& choose_ct(const StudyFiles& files, const StudyFiles::Plan* plan) {
  if (files.cts.size() == 1) return files.cts.front();
  std::vector<const StudyFiles::Ct*> candidates;
  for (const StudyFiles::Ct& ct : files.cts)
    if (plan == nullptr || ct.frame_of_reference_uid == plan->frame_of_reference_uid) candidates.push_back(&ct);
  if (candidates.size() > 1 && plan != nullptr)
    for (const StudyFiles::Structures& structures : files.structures)
      if (structures.sop_instance_uid == plan->structure_set_uid)
        std::erase_if(candidates,
                      [&](const auto* ct) { return !structures.ct_series_uids.contains(ct->series_instance_uid); });
  if (candidates.size() == 1) return *candidates.front();
  std::string list;
  for (const StudyFiles::Ct& ct : files.cts)
    list += fmt::format("\n       {} slices, series {}, first file {}", ct.files.size(), ct.series_instance_uid,
                        ct.files.front().string());
  throw Error(
      fmt::format("{} CT series found, and {}:{}\n"
                  "       Name the planning CT: {}",
                  files.cts.size(),
                  candidates.empty() ? "none is in the plan's frame of reference"
                                     : "the plan does not tell which one it was made on",
                  list, option("ct", "FOLDER")));
}

// Whether a structure set was drawn on the CT. One that names no images may have been, if it is in the CT's frame.
bool is_drawn_on(const StudyFiles::Ct& ct, const StudyFiles::Structures& structures) {
  return structures.ct_series_uids.empty() ? structures.frame_of_reference_uids.contains(ct.frame_of_reference_uid)
                                           : structures.ct_series_uids.contains(ct.series_instance_uid);
}

bool are_copies(const StudyFiles::Structures& one, const StudyFiles::Structures& other) {
  return one.sop_instance_uid == other.sop_instance_uid && sha256_of_file(one.file) == sha256_of_file(other.file);
}

// The structure set that the plan refers to, else all drawn on the CT; copies of one count once. Those without closed
// contours compete with none that has some.
std::vector<const StudyFiles::Structures*> candidates_of(const std::vector<StudyFiles::Structures>& all,
                                                         const StudyFiles::Plan* plan, const StudyFiles::Ct& ct) {
  std::vector<const StudyFiles::Structures*> candidates;
  const auto add_where = [&](auto&& is_candidate) {
    for (const StudyFiles::Structures& structures : all)
      if (is_candidate(structures) &&
          std::ranges::none_of(candidates, [&](const auto* earlier) { return are_copies(*earlier, structures); }))
        candidates.push_back(&structures);
  };
  for (const bool has_contours : {true, false}) {
    if (candidates.empty() && plan != nullptr)
      add_where([&](const auto& structures) {
        return structures.has_contours == has_contours && structures.sop_instance_uid == plan->structure_set_uid;
      });
    if (candidates.empty())
      add_where([&](const auto& structures) {
        return structures.has_contours == has_contours && is_drawn_on(ct, structures);
      });
  }
  return candidates;
}

// Whether no CT of the study is the one that a structure set of the patient says it was drawn on. References are lost
// where UIDs are replaced in some files and not in others: then it may have been drawn on this CT all the same.
bool is_of_absent_ct(const StudyFiles& files, const StudyFiles::Ct& ct, const StudyFiles::Structures& structures) {
  return structures.has_contours && patient_id_of(structures.patient) == patient_id_of(ct.patient) &&
         std::ranges::none_of(files.cts, [&](const auto& one) { return is_drawn_on(one, structures); });
}

void choose_structures(const StudyFiles& files, const StudyFiles::Plan* plan, const StudyFiles::Ct& ct,
                       StudyParts& parts, Notes& notes) {
  const std::vector<StudyFiles::Structures>& all = files.structures;
  const auto candidates = candidates_of(all, plan, ct);
  if (candidates.size() == 1) parts.structures = candidates.front()->file;
  const bool are_rivals = candidates.size() > 1 && candidates.front()->has_contours;
  const bool may_hold_target = candidates.size() == 1 && candidates.front()->has_contours;
  const bool is_planned = plan != nullptr && !plan->structure_set_uid.empty() && !candidates.empty();
  if (is_planned && candidates.front()->sop_instance_uid != plan->structure_set_uid)
    notes.warnings.push_back(fmt::format(
        "{}: the RT Structure Set to which the plan refers {} ({})", plan->file.string(),
        std::ranges::find(all, plan->structure_set_uid, &StudyFiles::Structures::sop_instance_uid) == all.end()
            ? "is not there"
            : "has no closed contour",
        plan->structure_set_uid));
  else if (is_planned && !is_drawn_on(ct, *candidates.front()))
    parts.doubts.push_back(
        fmt::format("the RT Structure Set of the plan, {}, was not drawn on this CT: the plan may "
                    "have been made on another one",
                    candidates.front()->file.string()));
  for (const StudyFiles::Structures& structures : all) {
    if (structures.file == parts.structures) continue;
    const bool is_rival = are_rivals && structures.has_contours && is_drawn_on(ct, structures);
    const bool is_astray =
        candidates.empty() || !candidates.front()->has_contours ? is_of_absent_ct(files, ct, structures) : false;
    if (!may_hold_target)
      (is_rival || is_astray ? parts.unused_structures.rivals : parts.unused_structures.unusable)
          .push_back(structures.file);
    std::string reason = is_astray ? "an RT Structure Set of another CT, which is not here"
                                   : "an RT Structure Set that was not drawn on the CT";
    if (candidates.size() == 1 && structures.sop_instance_uid == candidates.front()->sop_instance_uid)
      reason = fmt::format("the same RT Structure Set as {}", parts.structures.string());
    else if (is_drawn_on(ct, structures) && !structures.has_contours)
      reason = "an RT Structure Set without closed contours";
    else if (candidates.size() == 1 && is_drawn_on(ct, structures))
      reason = "an RT Structure Set that the plan does not refer to";
    else if (is_rival)
      reason = fmt::format("one of {} RT Structure Sets drawn on the CT; name the one meant: {}", candidates.size(),
                           option("structures", "FILE"));
    notes.left_aside.push_back(fmt::format("{}: {}", structures.file.string(), reason));
  }
}

// A structure set that a person named; those found in the folder are others.
void take_named_structures(const fs::path& named, const std::vector<StudyFiles::Structures>& found, StudyParts& parts,
                           Notes& notes) {
  const std::vector<StudyFiles::Structures> structures = scan_readable({named}).structures;
  if (structures.size() != 1)
    throw Error(
        fmt::format("{}: holds {} RT Structure Sets, expected one.\n"
                    "       Name the file: {}",
                    named.string(), structures.empty() ? "no" : fmt::format("{}", structures.size()),
                    option("structures", "FILE")));
  parts.structures = structures.front().file;
  for (const StudyFiles::Structures& other : found)
    if (other.sop_instance_uid != structures.front().sop_instance_uid)
      notes.left_aside.push_back(fmt::format("{}: an RT Structure Set that was not named", other.file.string()));
}

// X-rays that are not RT Images are X-rays like others where a machine profile supplies their geometry.
void take_other_xrays(StudyFiles& files, bool takes_other_xrays) {
  for (const StudyFiles::Image& xray : files.other_xrays) {
    if (takes_other_xrays)
      files.images.push_back(xray);
    else
      files.left_aside.push_back(
          fmt::format("{}: an X-ray that is not an RT Image; a machine profile can supply its geometry: {}",
                      xray.file.string(), option("machine", "FILE")));
  }
}

void check_is_there(const StudyFiles& files, const StudyParts& named) {
  if (files.cts.empty())
    throw Error(
        fmt::format("no CT series found ({}).\n"
                    "       Name its folder: {}",
                    searched(named.ct, named.study), option("ct", "FOLDER")));
  if (files.images.empty())
    throw Error(fmt::format("no RT Image found ({}).\n       {}", searched(named.images, named.study),
                            !files.other_xrays.empty()
                                ? "For X-rays of other classes their geometry is needed: " + option("machine", "FILE")
                            : files.other_formats.empty() ? "Name the X-rays: " + option("image", "FILE")
                                                          : files.other_formats.front()));
  if (!named.plan.empty() && files.plans.empty()) throw Error(fmt::format("{}: holds no RT Plan", named.plan.string()));
}

void choose_images(const std::vector<StudyFiles::Image>& all, const StudyFiles::Plan* plan,
                   const std::vector<StudyFiles::Plan>& other_plans, bool are_named, StudyParts& parts, Notes& notes) {
  // An image of another plan that lies here too belongs to that one. So may one of a plan that is not here, where two
  // or more images are of the plan; else it is a matter for checks.
  const auto of_plan =
      plan == nullptr ? 0 : std::ranges::count(all, plan->sop_instance_uid, &StudyFiles::Image::plan_uid);
  for (const StudyFiles::Image& image : all) {
    const bool is_of_other =
        std::ranges::find(other_plans, image.plan_uid, &StudyFiles::Plan::sop_instance_uid) != other_plans.end();
    const bool is_stray = of_plan >= 2 && !image.plan_uid.empty() && image.plan_uid != plan->sop_instance_uid;
    if (is_of_other && !are_named)
      notes.left_aside.push_back(fmt::format("{}: an X-ray of another plan", image.file.string()));
    else if (is_stray && !are_named)
      notes.left_aside.push_back(
          fmt::format("{}: an X-ray of a plan that is not here ({})", image.file.string(), image.plan_uid));
    else
      parts.images.push_back(image.file);
  }
}

// The parts among scanned files, of which a person may have named some.
StudyParts chosen(StudyFiles files, std::vector<StudyFiles::Plan> other_plans, const StudyParts& named,
                  bool takes_other_xrays, Notes& notes) {
  std::ranges::move(drrs_left_aside(files), std::back_inserter(files.left_aside));
  files.images = counting_images(files);
  take_other_xrays(files, takes_other_xrays);
  check_is_there(files, named);
  StudyParts parts;
  notes.left_aside = files.left_aside;
  for (const fs::path& registration : files.registrations)
    notes.left_aside.push_back(fmt::format("{}: a registration object", registration.string()));
  drop_copies(files.plans, notes);
  const StudyFiles::Plan* plan = choose_plan(files, !named.plan.empty());
  const StudyFiles::Ct& ct = choose_ct(files, plan);
  parts.ct = ct.files;
  for (const StudyFiles::Ct& other : files.cts)
    if (&other != &ct)
      notes.left_aside.push_back(fmt::format("{} and {} more: CT series {}, not the one the plan was made on",
                                             other.files.front().string(), other.files.size() - 1,
                                             other.series_instance_uid));
  if (plan != nullptr) {
    parts.plan = plan->file;
    for (const StudyFiles::Plan& other : files.plans)
      if (&other != plan) other_plans.push_back(other);
  }
  std::erase_if(other_plans,
                [&](const auto& other) { return plan && other.sop_instance_uid == plan->sop_instance_uid; });
  for (const StudyFiles::Plan& other : other_plans)
    notes.left_aside.push_back(fmt::format("{}: an RT Plan that {}", other.file.string(),
                                           !named.plan.empty() ? "was not named" : "no X-ray refers to"));
  if (!named.structures.empty())
    take_named_structures(named.structures, files.structures, parts, notes);
  else if (files.structures.empty())
    parts.unused_structures = named.unused_structures;
  else
    choose_structures(files, plan, ct, parts, notes);
  choose_images(files.images, plan, other_plans, !named.images.empty(), parts, notes);
  if (parts.images.empty())
    throw Error(
        fmt::format("no X-ray found refers to {} ({}).\n"
                    "       Name the X-rays: {}",
                    parts.plan.string(), searched(named.images, named.study), option("image", "FILE")));
  return parts;
}

// The X-rays of one session, and all other files of its patient.
StudyFiles files_of_session(const SessionChoice& choice, StudyFiles files, bool takes_other_xrays,
                            std::vector<std::string>& doubts) {
  compare_copies(files);
  const double now_s = utc_seconds_at(local_time()).value();
  const SessionFiles session = chosen_session(choice, sessions_of(files, takes_other_xrays), now_s);
  doubts = session.doubts;
  StudyFiles own = files_for(session, files);
  own.registrations = files.registrations;
  own.left_aside = files.left_aside;
  std::ranges::move(drrs_left_aside(files), std::back_inserter(own.left_aside));
  for (const auto& images : {files.images, files.other_xrays})
    for (const StudyFiles::Image& image : images)
      if (std::ranges::find(session.images, image.file, &StudyFiles::Image::file) == session.images.end())
        own.left_aside.push_back(fmt::format("{}: an X-ray of another session", image.file.string()));
  return own;
}

}  // namespace

std::string patient_id_of(const std::string& patient) { return patient.substr(0, patient.rfind('\\')); }

bool may_be_of_one_issuer(const std::string& a, const std::string& b) {
  const auto issuer_of = [](const std::string& patient) { return patient.substr(patient.rfind('\\') + 1); };
  return issuer_of(a) == issuer_of(b) || issuer_of(a).empty() || issuer_of(b).empty();
}

std::vector<std::string> drrs_left_aside(const StudyFiles& files) {
  const std::set<std::string> patients = patients_with_xrays(files);
  std::vector<std::string> lines;
  for (const StudyFiles::Image& drr : files.drrs)
    if (patients.contains(patient_id_of(drr.patient)))
      lines.push_back(fmt::format("{}: {} or {} says that it was computed (a DRR, or a fluence): it is no X-ray",
                                  drr.file.string(), described(DCM_ImageType), described(DCM_ReportedValuesOrigin)));
  return lines;
}

std::vector<StudyFiles::Image> counting_images(const StudyFiles& files) {
  const std::set<std::string> patients = patients_with_xrays(files);
  std::vector<StudyFiles::Image> images = files.images;
  std::ranges::copy_if(files.drrs, std::back_inserter(images),
                       [&](const StudyFiles::Image& drr) { return !patients.contains(patient_id_of(drr.patient)); });
  return images;
}

std::string why_no_structures(const UnusedStructures& unused) {
  const auto names = [](const std::vector<fs::path>& files) {
    std::string list;
    for (const fs::path& file : files) list += (list.empty() ? "" : ", ") + file.filename().string();
    return list;
  };
  if (unused.rivals.size() == 1)
    return fmt::format("nothing tells whether {} was drawn on this CT: it names another one, which is not here",
                       names(unused.rivals));
  if (!unused.rivals.empty())
    return fmt::format("nothing tells which of {} RT Structure Sets is meant for this CT ({})", unused.rivals.size(),
                       names(unused.rivals));
  if (!unused.unusable.empty())
    return fmt::format("no RT Structure Set of the study has a closed contour on this CT ({})", names(unused.unusable));
  return "the study holds no RT Structure Set";
}

std::vector<fs::path> StudyParts::paths() const {
  std::vector<fs::path> paths = {study, plan, structures};
  paths.insert(paths.end(), ct.begin(), ct.end());
  paths.insert(paths.end(), images.begin(), images.end());
  std::erase(paths, fs::path());
  return paths;
}

StudyFiles scan_file(const fs::path& path) {
  StudyFiles files;
  const Beginning beginning = beginning_of(path);
  if (beginning == Beginning::kNothing && is_named_like_dicom(path))
    throw Error(
        fmt::format("{}: is empty or begins with zeros: it has lost its contents, or was never filled", path.string()));
  if (beginning != Beginning::kDicom && path.extension() == ".dcm")
    throw Error(fmt::format("{}: is not a DICOM file, as its name says: it may be cut off", path.string()));
  if (beginning != Beginning::kDicom) {
    const std::string other = other_format(path);
    files.left_aside.push_back(other.empty() ? fmt::format("{}: not a DICOM file", path.string()) : other);
    if (!other.empty()) files.other_formats.push_back(other);
    return files;
  }
  const DicomFile file = DicomFile::read(path, DicomFile::Extent::kHeader);
  const DicomItem dataset = file.dataset();
  const std::string sop_class = dataset.text(DCM_SOPClassUID).value_or("");
  if (sop_class == UID_CTImageStorage || sop_class == UID_EnhancedCTImageStorage ||
      sop_class == UID_LegacyConvertedEnhancedCTImageStorage) {
    add_ct_slice(path, dataset, files);
  } else if (sop_class == UID_RTImageStorage) {
    (is_computed(dataset) ? files.drrs : files.images).push_back(xray(path, dataset));
  } else if (is_other_xray(sop_class)) {
    files.other_xrays.push_back(xray(path, dataset));
  } else if (sop_class == UID_RTPlanStorage || sop_class == UID_RTIonPlanStorage) {
    files.plans.push_back({.file = path,
                           .patient = patient_of(dataset),
                           .sop_instance_uid = dataset.required_uid(DCM_SOPInstanceUID),
                           .frame_of_reference_uid = dataset.uid(DCM_FrameOfReferenceUID).value_or(""),
                           .structure_set_uid = first_reference(dataset, DCM_ReferencedStructureSetSequence),
                           .label = label_of(dataset, DCM_RTPlanLabel, DCM_RTPlanDate)});
  } else if (sop_class == UID_RTStructureSetStorage) {
    DrawnOn drawn = drawn_on(dataset);
    files.structures.push_back({.file = path,
                                .patient = patient_of(dataset),
                                .sop_instance_uid = dataset.required_uid(DCM_SOPInstanceUID),
                                .ct_series_uids = std::move(drawn.series_uids),
                                .ct_sop_instance_uids = std::move(drawn.image_uids),
                                .frame_of_reference_uids = drawn_in(dataset),
                                .has_contours = holds_closed_contour(dataset)});
  } else if (sop_class == UID_SpatialRegistrationStorage || sop_class == UID_DeformableSpatialRegistrationStorage) {
    files.registrations.push_back(path);
  } else {
    files.left_aside.push_back(
        fmt::format("{}: {}", path.string(), dcmFindNameOfUID(sop_class.c_str(), "an object of unknown class")));
  }
  return files;
}

void merge(StudyFiles from, StudyFiles& files) {
  for (StudyFiles::Ct& ct : from.cts) {
    const auto same = std::ranges::find(files.cts, ct.series_instance_uid, &StudyFiles::Ct::series_instance_uid);
    if (same == files.cts.end()) {
      files.cts.push_back(std::move(ct));
      continue;
    }
    std::ranges::move(ct.files, std::back_inserter(same->files));
    same->sop_instance_uids.merge(ct.sop_instance_uids);
  }
  const auto append = [&](auto member) { std::ranges::move(from.*member, std::back_inserter(files.*member)); };
  append(&StudyFiles::plans);
  append(&StudyFiles::images);
  append(&StudyFiles::drrs);
  append(&StudyFiles::other_xrays);
  append(&StudyFiles::structures);
  append(&StudyFiles::registrations);
  append(&StudyFiles::left_aside);
  append(&StudyFiles::other_formats);
  append(&StudyFiles::unreadable);
}

StudyFiles scan_study(const std::vector<fs::path>& paths) {
  std::set<fs::path> unsearchable;
  const std::vector<fs::path> below = files_below(paths, {}, &unsearchable);
  std::vector<StudyFiles> scanned(below.size());
  parallel_for(std::size_t{0}, below.size(), [&](std::size_t n) {
    try {
      scanned[n] = scan_file(below[n]);
    } catch (const Error& error) {
      scanned[n].unreadable.emplace_back(error.what());
    }
  });
  StudyFiles files;
  for (const fs::path& path : unsearchable)
    (is_link_to_something(path) ? files.left_aside : files.unreadable).push_back(why_not_searched(path));
  for (StudyFiles& of_file : scanned) merge(std::move(of_file), files);
  return files;
}

StudyParts find_parts(const StudyParts& named, bool takes_other_xrays, Notes& notes) {
  StudyFiles files;
  if (!named.study.empty()) files = scan_readable({named.study});
  std::vector<StudyFiles::Plan> other_plans;  // a named plan makes those found in the folder others
  if (!named.ct.empty()) files.cts = scan_readable(named.ct).cts;
  if (!named.images.empty()) {
    StudyFiles images = scan_readable(named.images);
    std::ranges::move(images.drrs, std::back_inserter(images.images));  // a person means them
    files.drrs.clear();
    std::swap(files.images, images.images);
    std::swap(files.other_formats, images.other_formats);
    std::swap(files.other_xrays, images.other_xrays);
  }
  if (!named.plan.empty()) std::swap(other_plans, files.plans), files.plans = scan_readable({named.plan}).plans;
  std::vector<std::string> doubts;
  if (named.session.is_made()) files = files_of_session(named.session, std::move(files), takes_other_xrays, doubts);
  StudyParts parts = chosen(std::move(files), std::move(other_plans), named, takes_other_xrays, notes);
  std::ranges::move(doubts, std::back_inserter(parts.doubts));
  return parts;
}

StudyParts choose_parts(const StudyFiles& files) {
  Notes nobody;
  return chosen(files, {}, {}, false, nobody);
}

}  // namespace isoshift
