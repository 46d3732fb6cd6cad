#include "io/study.h"

#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <set>

#include "geometry/error.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

constexpr double kMaxTimeSpanS = 600.0;
constexpr double kMaxTableMoveMm = 0.5;
constexpr double kMaxTableTurnDeg = 0.1;

std::vector<fs::path> files_below(const std::vector<fs::path>& paths) {
  std::set<fs::path> files;
  for (const fs::path& path : paths) {
    std::error_code error;
    const auto status = fs::status(path, error);
    if (!fs::exists(status)) throw Error(fmt::format("{}: no such file or folder", path.string()));
    if (!fs::is_directory(status)) {
      files.insert(path);
      continue;
    }
    for (auto entry = fs::recursive_directory_iterator(path, error); !error && entry != fs::end(entry);
         entry.increment(error))
      if (entry->is_regular_file()) files.insert(entry->path());
    if (error) throw Error(fmt::format("{}: cannot be searched: {}", path.string(), error.message()));
  }
  return {files.begin(), files.end()};
}

void sort_in(const fs::path& path, StudyFiles& files) {
  if (!has_dicom_magic(path)) {
    files.left_aside.push_back({path, "not a DICOM file"});
    return;
  }
  const DicomFile file = DicomFile::read(path, DicomFile::Extent::kHeader);
  const DicomItem dataset = file.dataset();
  const std::string sop_class = dataset.text(DCM_SOPClassUID).value_or("");
  if (sop_class == UID_CTImageStorage) {
    const auto type = dataset.texts(DCM_ImageType);
    if (type.size() > 2 && type[2] == "LOCALIZER")
      files.left_aside.push_back({path, "a CT localizer"});
    else
      files.ct_series[dataset.required_text(DCM_SeriesInstanceUID)].push_back(path);
  } else if (sop_class == UID_RTImageStorage) {
    files.rt_images.push_back(path);
  } else if (sop_class == UID_RTPlanStorage || sop_class == UID_RTIonPlanStorage) {
    files.rt_plans.push_back(path);
  } else if (sop_class == UID_RTStructureSetStorage) {
    files.rt_structures.push_back(path);
  } else {
    const char* name = dcmFindNameOfUID(sop_class.c_str(), "an object of unknown class");
    files.left_aside.push_back({path, name});
  }
}

// The parts of a study after the rule "what is named wins, the rest is searched for".
struct Parts {
  std::vector<fs::path> ct;
  std::vector<fs::path> images;
  std::optional<fs::path> plan;
};

std::string searched(const StudyRequest& request) {
  return request.study.empty() ? "no study folder was given" : "searched " + request.study.string();
}

Parts find_parts(const StudyRequest& request) {
  StudyFiles found;
  if (!request.study.empty()) found = scan_study({request.study});
  if (!request.ct.empty()) found.ct_series = scan_study(request.ct).ct_series;
  if (!request.images.empty()) found.rt_images = scan_study(request.images).rt_images;
  if (request.plan) found.rt_plans = scan_study({*request.plan}).rt_plans;

  Parts parts;
  if (found.ct_series.empty())
    throw Error(fmt::format("no CT series found ({}).\n       Name its folder: --ct FOLDER", searched(request)));
  if (found.ct_series.size() > 1) {
    std::string list;
    for (const auto& [uid, files] : found.ct_series)
      list += fmt::format("\n       {} slices, series {}, first file {}", files.size(), uid, files.front().string());
    throw Error(fmt::format("{} CT series found, expected one:{}\n       Name the planning CT: --ct FOLDER",
                            found.ct_series.size(), list));
  }
  parts.ct = found.ct_series.begin()->second;
  if (found.rt_images.empty())
    throw Error(fmt::format("no RT Image found ({}).\n       Name the X-rays: --image FILE", searched(request)));
  parts.images = found.rt_images;
  if (found.rt_plans.size() > 1)
    throw Error(fmt::format("{} RT Plans found, expected one: {} and {}.\n       Name the plan: --plan FILE",
                            found.rt_plans.size(), found.rt_plans[0].string(), found.rt_plans[1].string()));
  if (!found.rt_plans.empty()) parts.plan = found.rt_plans.front();
  return parts;
}

// Seconds since an epoch from DA and TM ("20260301", "101500.25"); nothing where either is absent or malformed.
std::optional<double> seconds_of(const RtImage& image) {
  if (!image.acquisition_date || !image.acquisition_time) return std::nullopt;
  const auto digits = [](std::string_view text, std::size_t begin, std::size_t count) -> std::optional<int> {
    int value = 0;
    if (text.size() < begin + count) return std::nullopt;
    const auto [end, error] = std::from_chars(text.data() + begin, text.data() + begin + count, value);
    return error == std::errc() && end == text.data() + begin + count ? std::optional(value) : std::nullopt;
  };
  const auto year = digits(*image.acquisition_date, 0, 4), month = digits(*image.acquisition_date, 4, 2),
             day = digits(*image.acquisition_date, 6, 2), hour = digits(*image.acquisition_time, 0, 2);
  if (!year || !month || !day || !hour) return std::nullopt;
  const std::chrono::year_month_day date(std::chrono::year(*year), std::chrono::month(static_cast<unsigned>(*month)),
                                         std::chrono::day(static_cast<unsigned>(*day)));
  const int minute = digits(*image.acquisition_time, 2, 2).value_or(0);
  const int second = digits(*image.acquisition_time, 4, 2).value_or(0);
  const double days = static_cast<double>(std::chrono::sys_days(date).time_since_epoch().count());
  return ((days * 24 + *hour) * 60 + minute) * 60 + second;
}

std::vector<Finding> patient_findings(const Study& study) {
  const Identity& reference = study.ct.identity;
  std::vector<Finding> findings;
  const auto compare = [&](const Identity& other, const std::string& where) {
    if (other.patient_id == reference.patient_id && other.patient_id_issuer == reference.patient_id_issuer) return;
    findings.push_back(
        {"patient-mismatch", fmt::format("{}: {} differs from the CT's: the inputs are of different patients", where,
                                         described(DCM_PatientID))});
  };
  if (study.plan) compare(study.plan->identity, study.plan->path.string());
  for (const RtImage& image : study.rt_images) compare(image.identity, image.path.string());
  return findings;
}

std::vector<Finding> plan_findings(const Study& study, Notes& notes) {
  std::vector<Finding> findings;
  if (!study.plan) return findings;
  const RtPlan& plan = *study.plan;
  if (!plan.frame_of_reference_uid)
    notes.warnings.push_back(
        fmt::format("the plan has no {}; taken as that of the CT", described(DCM_FrameOfReferenceUID)));
  else if (*plan.frame_of_reference_uid != study.ct.frame_of_reference_uid)
    findings.push_back(
        {"for-mismatch", fmt::format("{}: {} is not that of the CT, so the plan's isocenter does not apply "
                                     "to it",
                                     plan.path.string(), described(DCM_FrameOfReferenceUID))});
  if (plan.approval_status != "APPROVED")
    notes.warnings.push_back(
        fmt::format("the plan is not approved ({} is \"{}\")", described(DCM_ApprovalStatus), plan.approval_status));
  for (const RtImage& image : study.rt_images) {
    if (!image.plan_sop_instance_uid)
      notes.warnings.push_back(fmt::format("{}: does not say to which plan it belongs ({})", image.label,
                                           described(DCM_ReferencedRTPlanSequence)));
    else if (*image.plan_sop_instance_uid != plan.sop_instance_uid)
      findings.push_back({"plan-mismatch",
                          fmt::format("{}: belongs to another plan than {} ({}): it refers to {}, the plan is {}",
                                      image.path.string(), plan.path.string(), described(DCM_ReferencedRTPlanSequence),
                                      *image.plan_sop_instance_uid, plan.sop_instance_uid)});
  }
  return findings;
}

std::vector<Finding> session_findings(const Study& study) {
  std::vector<Finding> findings;
  const RtImage& first = study.rt_images.front();
  for (const RtImage& image : study.rt_images) {
    const auto begin = seconds_of(first), end = seconds_of(image);
    if (begin && end && std::abs(*end - *begin) > kMaxTimeSpanS)
      findings.push_back({"time-span", fmt::format("{}: taken {:.0f} minutes from {}, expected at most 10 ({})",
                                                   image.path.string(), std::abs(*end - *begin) / 60.0,
                                                   first.path.string(), described(DCM_AcquisitionTime))});
    if (image.table_position_mm && first.table_position_mm &&
        (*image.table_position_mm - *first.table_position_mm).cwiseAbs().maxCoeff() > kMaxTableMoveMm)
      findings.push_back(
          {"table-moved", fmt::format("{}: the table moved by ({:.1f}) mm since {} ({})", image.path.string(),
                                      fmt::join(*image.table_position_mm - *first.table_position_mm, ", "),
                                      first.path.string(), described(DCM_TableTopVerticalPosition))});
    const auto turned = [&](const std::optional<double> RtImage::*angle, const DcmTagKey& tag) {
      const double change_deg =
          deg_from_rad(wrapped_rad(rad_from_deg((image.*angle).value_or(0.0) - (first.*angle).value_or(0.0))));
      if (std::abs(change_deg) > kMaxTableTurnDeg)
        findings.push_back(
            {"table-moved", fmt::format("{}: the table turned by {:.1f} degrees since {} ({})", image.path.string(),
                                        change_deg, first.path.string(), described(tag))});
    };
    turned(&RtImage::support_angle_deg, DCM_PatientSupportAngle);
    turned(&RtImage::eccentric_angle_deg, DCM_TableTopEccentricAngle);
    turned(&RtImage::table_pitch_deg, DCM_TableTopPitchAngle);
    turned(&RtImage::table_roll_deg, DCM_TableTopRollAngle);
    if (image.patient_position != first.patient_position)
      throw Error(fmt::format("{}: {} is {}, that of {} is {}", image.path.string(), described(DCM_PatientPosition),
                              image.patient_position.value_or("missing"), first.path.string(),
                              first.patient_position.value_or("missing")));
  }
  return findings;
}

void check_nothing_missing(const std::vector<RtImage>& images, std::string refused) {
  for (const RtImage& image : images)
    for (const MissingAttribute& missing : missing_attributes(image)) {
      if (!refused.empty()) refused += '\n';
      refused += fmt::format("{}: {} is missing.\n       {}", image.path.string(), described(missing.tag),
                             missing.supplied_by.empty() ? "No switch supplies it: the image cannot be used."
                                                         : "Supply it: " + missing.supplied_by);
    }
  if (!refused.empty()) throw Error(refused);
}

// The beams that the images name in the plan; all beams where one of them names none.
std::vector<RtPlan::Beam> imaged_beams(const Study& study) {
  std::vector<int> numbers;
  for (const RtImage& image : study.rt_images) {
    if (!image.beam_number || image.plan_sop_instance_uid != study.plan->sop_instance_uid) return study.plan->beams;
    numbers.push_back(*image.beam_number);
  }
  return selected_beams(*study.plan, numbers);
}

void warn_of_planned_couch_angle(const Study& study, const std::vector<RtPlan::Beam>& beams, Notes& notes) {
  for (const RtPlan::Beam& beam : beams) {
    if (!beam.support_angle_deg) continue;
    const double change_rad = wrapped_rad(rad_from_deg(*beam.support_angle_deg) - study.table.support_rad);
    if (std::abs(change_rad) > rad_from_deg(kMaxTableTurnDeg))
      notes.warnings.push_back(fmt::format(
          "beam {} of the plan has couch angle {:.1f} degrees, the images {:.1f} degrees; the images' counts",
          beam.number, *beam.support_angle_deg, deg_from_rad(study.table.support_rad)));
  }
}

void check_isocenter(const Study& study) {
  const Eigen::Vector3d voxel = study.ct.hu.patient_from_voxel.inverse() * study.isocenter_patient_mm;
  const Eigen::Vector3d last = study.ct.hu.size.cast<double>().array() - 0.5;
  if ((voxel.array() < -0.5).any() || (voxel.array() > last.array()).any())
    throw Error(fmt::format("the isocenter ({:.1f}) mm lies outside the CT ({})",
                            fmt::join(study.isocenter_patient_mm, ", "), described(DCM_IsocenterPosition)));
  for (std::size_t n = 0; n < study.xrays.size(); ++n) {
    const XrayView& view = study.xrays[n].view;
    const auto pixel = view.project(Eigen::Vector3d::Zero());
    if (!pixel || (pixel->array() < -0.5).any() || pixel->x() > view.columns - 0.5 || pixel->y() > view.rows - 0.5)
      throw Error(fmt::format("{}: the isocenter is projected outside the image ({}, {})",
                              study.rt_images[n].path.string(), described(DCM_RTImagePosition),
                              described(DCM_XRayImageReceptorTranslation)));
  }
}

}  // namespace

StudyFiles scan_study(const std::vector<fs::path>& paths) {
  StudyFiles files;
  for (const fs::path& path : files_below(paths)) sort_in(path, files);
  return files;
}

Study load_study(const StudyRequest& request, Notes& notes, const Progress& progress) {
  const Parts parts = find_parts(request);
  Study study;
  if (parts.plan) study.plan = read_rt_plan(*parts.plan);
  for (const fs::path& path : parts.images)
    study.rt_images.push_back(with_switches(read_rt_image_header(path), request.switches, notes));
  std::ranges::stable_sort(study.rt_images, {}, [](const RtImage& image) { return seconds_of(image); });
  for (const auto& [label, angle_deg] : request.switches.gantry_angle_deg)
    if (std::ranges::find(study.rt_images, label, &RtImage::label) == study.rt_images.end())
      throw UsageError(fmt::format("--gantry-angle {}={}: no image has this label", label, angle_deg));

  // A position or isocenter that only the plan has; a switch wins over both.
  std::vector<RtPlan::Beam> beams;
  if (study.plan) {
    beams = imaged_beams(study);
    const auto planned_position = common_patient_position(*study.plan, beams);
    for (RtImage& image : study.rt_images)
      if (!image.patient_position) image.patient_position = planned_position;
  }
  std::string refused;
  std::vector<Finding> findings;
  for (const RtImage& image : study.rt_images)
    std::ranges::move(rt_image_findings(image), std::back_inserter(findings));
  try {
    settle(findings, request.allowed, notes);
  } catch (const Error& error) {
    refused = error.what();  // said together with all that is missing
  }
  check_nothing_missing(study.rt_images, refused);

  study.ct = read_ct_series(parts.ct, request.allowed, notes, progress);
  findings = patient_findings(study);
  std::ranges::move(plan_findings(study, notes), std::back_inserter(findings));
  std::ranges::move(session_findings(study), std::back_inserter(findings));
  settle(findings, request.allowed, notes);

  study.patient_position = patient_position_from(study.rt_images.front().patient_position.value()).value();
  study.table = table_angles(study.rt_images.front(), notes);
  if (request.isocenter_patient_mm) {
    study.isocenter_patient_mm = *request.isocenter_patient_mm;
    notes.overrides.push_back(fmt::format("{}: ({}) mm by --isocenter", described(DCM_IsocenterPosition),
                                          fmt::join(study.isocenter_patient_mm, ", ")));
  } else if (study.plan) {
    study.isocenter_patient_mm = common_isocenter(*study.plan, beams);
  } else {
    throw Error(
        fmt::format("no RT Plan found ({}), so the planned isocenter is unknown.\n"
                    "       Name the plan (--plan FILE) or supply the isocenter: --isocenter X,Y,Z",
                    searched(request)));
  }
  if (const auto planned = study.plan ? common_patient_position(*study.plan, beams) : std::nullopt;
      planned && *planned != to_string(study.patient_position))
    throw Error(fmt::format("{}: {} is {}, that of {} is {}", study.rt_images.front().path.string(),
                            described(DCM_PatientPosition), to_string(study.patient_position),
                            study.plan->path.string(), *planned));
  warn_of_planned_couch_angle(study, beams, notes);
  study.planned_room_from_patient =
      planned_room_from_patient(study.patient_position, study.table, study.isocenter_patient_mm);
  for (const RtImage& image : study.rt_images)
    study.xrays.push_back(read_xray_image(image, beam_of(image, notes), carm_geometry(image, notes)));
  check_isocenter(study);
  return study;
}

}  // namespace isoshift
