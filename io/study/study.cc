#include "io/study/study.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <tuple>

#include "base/error.h"
#include "base/option_name.h"
#include "io/dicom/decode.h"
#include "io/study/contradictions.h"
#include "io/study/planned_pose.h"

namespace isoshift {
namespace {

std::vector<FailedCheck> patient_findings(const Study& study) {
  std::vector<PatientInput> inputs = {{&study.ct->identity, "the CT"}};
  if (study.plan) inputs.push_back({&study.plan->identity, study.plan->path.string()});
  if (study.structures) inputs.push_back({&study.structures->identity, study.structures->path.string()});
  for (const RtImage& image : study.rt_images) inputs.push_back({&image.identity, image.path.string()});
  return patient_findings(inputs);
}

std::vector<FailedCheck> plan_findings(const Study& study, Notes& notes) {
  std::vector<FailedCheck> findings;
  if (!study.plan) return findings;
  const RtPlan& plan = *study.plan;
  if (!plan.frame_of_reference_uid && plan.geometry == "TREATMENT_DEVICE")
    findings.push_back(
        {"for-mismatch",
         fmt::format("{}: has no {}, and {} is TREATMENT_DEVICE: nothing says where its isocenter lies "
                     "in the CT",
                     plan.path.string(), described(DCM_FrameOfReferenceUID), described(DCM_RTPlanGeometry))});
  else if (!plan.frame_of_reference_uid)
    notes.warnings.push_back(
        fmt::format("the plan has no {}; taken as that of the CT", described(DCM_FrameOfReferenceUID)));
  else if (*plan.frame_of_reference_uid != study.ct->frame_of_reference_uid)
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

// What is drawn in another frame of reference would lie anywhere on the CT.
std::vector<FailedCheck> structure_findings(const Study& study, Notes& notes) {
  std::vector<std::string> unknown, elsewhere;
  if (study.structures)
    for (const Structure& structure : study.structures->structures) {
      if (!structure.frame_of_reference_uid)
        unknown.push_back(fmt::format("\"{}\"", structure.name));
      else if (*structure.frame_of_reference_uid != study.ct->frame_of_reference_uid)
        elsewhere.push_back(fmt::format("\"{}\"", structure.name));
    }
  if (!unknown.empty())
    notes.warnings.push_back(fmt::format("structures {} have no {}; taken as that of the CT", fmt::join(unknown, ", "),
                                         described(DCM_ReferencedFrameOfReferenceUID)));
  if (elsewhere.empty()) return {};
  return {{"for-mismatch", fmt::format("{}: {} of {} is not that of the CT, so they do not apply to it",
                                       study.structures->path.string(), described(DCM_ReferencedFrameOfReferenceUID),
                                       fmt::join(elsewhere, ", "))}};
}

void check_one_patient_position(const Study& study) {
  const RtImage& first = study.rt_images.front();
  for (const RtImage& image : study.rt_images)
    if (image.patient_position != first.patient_position)
      throw Error(fmt::format("{}: {} is {}, that of {} is {}", image.path.string(), described(DCM_PatientPosition),
                              image.patient_position.value_or("missing"), first.path.string(),
                              first.patient_position.value_or("missing")));
}

// The files of the X-rays. Each is read once: header, pixels and SHA-256 are of the same bytes. Of a moving target's
// many X-rays only the headers are read at first.
class XrayFiles {
 public:
  explicit XrayFiles(bool headers_first) : headers_first_(headers_first) {}

  std::vector<RtImage> images_of(const std::filesystem::path& path, Notes& notes) {
    return headers_first_ ? read_rt_images(path, notes) : read_rt_images(whole(path), notes);
  }
  const DicomFile& whole(const std::filesystem::path& path) {
    const auto found = files_.find(path);
    if (found != files_.end()) return found->second;
    return files_.emplace(path, DicomFile::read(path, DicomFile::Extent::kWhole)).first->second;
  }

 private:
  bool headers_first_;
  std::map<std::filesystem::path, DicomFile> files_;
};

// Whether two images of one UID show the same from the same place.
bool is_same_xray(const RtImage& a, const RtImage& b, XrayFiles& files) {
  const auto geometry = [](const RtImage& image) {
    return std::tie(image.sad_mm, image.sid_mm, image.gantry_angle_deg, image.table, image.pixel_spacing_mm,
                    image.position_mm, image.orientation, image.receptor_translation_mm, image.receptor_angle_deg,
                    image.acquisition_time);
  };
  if (geometry(a) != geometry(b)) return false;
  const auto pixels = [&](const RtImage& image) {
    const DicomFile& file = files.whole(image.path);
    return decode_frame(file, pixel_format(file.dataset()), image.frame);
  };
  return pixels(a) == pixels(b);
}

// An X-ray that lies there twice is one view (C.12.1: the UID is the instance's own).
void drop_repeated_images(std::vector<RtImage>& images, XrayFiles& files, Notes& notes) {
  for (auto image = images.begin(); image != images.end();) {
    const auto first = std::find_if(images.begin(), image, [&](const RtImage& other) {
      return other.sop_instance_uid == image->sop_instance_uid && other.frame == image->frame;
    });
    if (first == image) {
      ++image;
      continue;
    }
    if (!is_same_xray(*first, *image, files))
      throw Error(fmt::format("{}: has the {} of {}, but shows something else", image->path.string(),
                              described(DCM_SOPInstanceUID), first->path.string()));
    notes.left_aside.push_back(fmt::format("{}: the same X-ray as {}", image->path.string(), first->path.string()));
    image = images.erase(image);
  }
}

// X-rays of one moment in the order of their files and frames.
void sort_by_time(std::vector<RtImage>& images) {
  std::ranges::sort(
      images, {}, [](const RtImage& image) { return std::tuple(acquisition_seconds(image), image.path, image.frame); });
}

// Frames of one imager have one label but for the number behind it.
void keep_earliest_of_each_imager(std::vector<RtImage>& images) {
  sort_by_time(images);
  std::set<std::string> seen;
  std::erase_if(images, [&](const RtImage& image) { return !seen.insert(imager_label(image)).second; });
  for (RtImage& image : images) image.label = imager_label(image);
}

void check_labels(const RtImageSwitches& switches, const std::vector<RtImage>& images) {
  for (const auto& [label, angle_deg] : switches.gantry_angle_deg)
    if (const auto count = std::ranges::count(images, label, &RtImage::label); count != 1)
      throw UsageError(fmt::format("{}: {} images have this label, expected one",
                                   option("gantry-angle", fmt::format("{}={}", label, angle_deg)), count));
}

void check_nothing_missing(const std::vector<RtImage>& images, std::string refused) {
  for (const RtImage& image : images)
    for (const MissingAttribute& missing : missing_attributes(image)) {
      if (!refused.empty()) refused += '\n';
      refused += fmt::format("{}: {} {}.\n       {}", image.path.string(), described(missing.tag), missing.problem(),
                             missing.supplied_by.empty() ? "No switch supplies it: the image cannot be used."
                                                         : "Supply it: " + missing.supplied_by);
    }
  if (!refused.empty()) throw Error(refused);
}

// The beams that the images name in the plan; all beams where one of them names none.
std::vector<RtPlan::Beam> imaged_beams(const Study& study) {
  std::vector<RtPlan::Beam> beams;
  for (const RtImage& image : study.rt_images) {
    const RtPlan::Beam* beam = planned_beam(*study.plan, image);
    if (beam == nullptr) return study.plan->beams;
    if (std::ranges::find(beams, beam->number, &RtPlan::Beam::number) == beams.end()) beams.push_back(*beam);
  }
  return beams;
}

bool is_inside(const Eigen::VectorXd& position, const Eigen::VectorXd& size) {
  return (position.array() >= -0.5).all() && (position.array() <= size.array() - 0.5).all();  // false for NaN
}

void check_isocenter(const Study& study) {
  const Eigen::Vector3d voxel = study.ct->hu.patient_from_voxel.inverse() * study.isocenter_patient_mm;
  if (!is_inside(voxel, study.ct->hu.size.cast<double>()))
    throw Error(fmt::format("the isocenter ({:.1f}) mm lies outside the CT ({})",
                            fmt::join(study.isocenter_patient_mm, ", "), described(DCM_IsocenterPosition)));
  for (std::size_t n = 0; n < study.xrays.size(); ++n) {
    const XrayView& view = study.xrays[n].view;
    const auto pixel = view.project(Eigen::Vector3d::Zero());
    if (pixel && is_inside(*pixel, Eigen::Vector2d(view.columns, view.rows))) continue;
    if (study.rt_images[n].pixel_from_room && pixel)
      throw Error(
          fmt::format("{}: the projection matrix puts the isocenter at column {:.1f}, row {:.1f}, outside the image of "
                      "{} x {} pixels",
                      study.rt_images[n].path.string(), pixel->x(), pixel->y(), view.columns, view.rows));
    throw Error(fmt::format("{}: the isocenter is projected outside the image ({}, {})",
                            study.rt_images[n].path.string(), described(DCM_RTImagePosition),
                            described(DCM_XRayImageReceptorTranslation)));
  }
}

// What the X-rays say against their being of one session.
struct SaidOfSession {
  std::vector<FailedCheck> findings, doubts;
};

// The X-rays with what a person and a machine profile supply, in order of acquisition.
std::vector<RtImage> read_images(const std::vector<std::filesystem::path>& paths, const StudyRequest& request,
                                 XrayFiles& files, SaidOfSession& said, Notes& notes) {
  std::vector<RtImage> images;
  for (const std::filesystem::path& path : paths)
    std::ranges::move(files.images_of(path, notes), std::back_inserter(images));
  if (images.empty()) throw Error("no frame of the X-rays has a geometry");
  drop_repeated_images(images, files, notes);
  if (request.one_per_imager) keep_earliest_of_each_imager(images);
  check_labels(request.switches, images);
  sort_by_time(images);
  std::vector<RtImage> supplied;
  supplied.reserve(images.size());
  for (RtImage& image : images) {
    const RtImage by_profile = request.machine ? with_machine(image, *request.machine, request.switches, notes) : image;
    for (const std::string& contradiction : image.contradictions)
      said.doubts.push_back({"planned-geometry", contradiction});
    image.pixel_from_room = by_profile.pixel_from_room;  // only the profile tells which views are the same
    supplied.push_back(with_switches(by_profile, request.switches, notes));
    std::ranges::move(replaced_doubts(image, by_profile, supplied.back()), std::back_inserter(said.doubts));
  }
  // By what was measured: neither a switch nor a profile hides a move of the table.
  said.findings = session_findings(images, notes);
  std::ranges::move(session_doubts(images, request.max_span_s), std::back_inserter(said.doubts));
  return supplied;
}

// What each X-ray must have by itself. What is missing is told together with what is forbidden.
void check_images(const Study& study, const StudyRequest& request, Notes& notes) {
  std::vector<FailedCheck> findings;
  for (const RtImage& image : study.rt_images)
    std::ranges::move(rt_image_findings(image), std::back_inserter(findings));
  std::string refused;
  try {
    settle(findings, request.allowed, notes);
  } catch (const Error& error) {
    refused = error.what();
  }
  check_nothing_missing(study.rt_images, refused);
  for (const RtImage& image : study.rt_images)
    if (!image.invalid_utc_offset.empty())
      notes.warnings.push_back(fmt::format("{}: {} is \"{}\", expected -1200 to +1400; its time was taken as local",
                                           image.label, described(DCM_TimezoneOffsetFromUTC),
                                           image.invalid_utc_offset));
  for (const RtImage& image : study.rt_images)
    if (image.is_lossy)
      notes.warnings.push_back(
          fmt::format("{}: has been compressed with loss ({})", image.label, described(DCM_LossyImageCompression)));
  for (const RtImage& image : study.rt_images)
    if (image.is_rt_image() && !image.reported_values_origin)
      notes.warnings.push_back(fmt::format("{}: does not say whether its angles were measured ({} is missing)",
                                           image.label, described(DCM_ReportedValuesOrigin)));
}

// One UID is of one instance (PS3.3 C.12.1).
void check_instances(const Study& study) {
  std::map<std::string, std::string> owners;
  for (const std::string& uid : study.ct->sop_instance_uids) owners.emplace(uid, "a slice of the CT");
  const auto check = [&](const std::string& uid, const std::string& name) {
    if (const auto [owner, is_new] = owners.emplace(uid, name); !is_new && owner->second != name)
      throw Error(fmt::format("{}: has the {} of {}", name, described(DCM_SOPInstanceUID), owner->second));
  };
  if (study.plan) check(study.plan->sop_instance_uid, study.plan->path.string());
  if (study.structures) check(study.structures->sop_instance_uid, study.structures->path.string());
  for (const RtImage& image : study.rt_images) check(image.sop_instance_uid, image.path.string());
}

// Whether the parts of the study belong together.
void check_together(const StudyRequest& request, const SaidOfSession& said, Study& study, Notes& notes) {
  check_instances(study);
  std::vector<FailedCheck> findings = patient_findings(study);
  std::ranges::move(plan_findings(study, notes), std::back_inserter(findings));
  std::ranges::move(structure_findings(study, notes), std::back_inserter(findings));
  std::ranges::copy(said.findings, std::back_inserter(findings));
  settle(findings, request.allowed, notes);
  study.doubts = request.parts.doubts;
  std::ranges::copy(study.ct->doubts, std::back_inserter(study.doubts));
  std::ranges::move(unsettled(said.doubts, request.allowed, notes), std::back_inserter(study.doubts));
  check_one_patient_position(study);
}

// Where an X-ray says nothing of jaws, those of the planned beam that it names are a hint.
void declare_planned_apertures(Study& study, Notes& notes) {
  for (std::size_t n = 0; n < study.xrays.size(); ++n) {
    const RtImage& image = study.rt_images[n];
    if (study.xrays[n].declared_aperture || !study.plan) continue;
    const RtPlan::Beam* beam = planned_beam(*study.plan, image);
    if (beam == nullptr) continue;
    for (const std::string& problem : beam->jaws.problems) notes.warnings.push_back(problem);
    study.xrays[n].declared_aperture = declared_aperture(image, beam->jaws, study.xrays[n].view);
    if (study.xrays[n].declared_aperture) study.xrays[n].declared_aperture->is_of_exposure = false;
  }
}

}  // namespace

Study load_study(const StudyRequest& request, Notes& notes, const Progress& progress, CtStore& cts) {
  const StudyParts parts = find_parts(request.parts, request.machine.has_value(), notes);
  Study study;
  study.machine = request.machine;
  study.image_files = parts.images;
  study.unused_structures = parts.unused_structures;
  if (!parts.plan.empty()) study.plan = read_rt_plan(parts.plan);
  if (!parts.structures.empty()) study.structures = read_rt_structures(parts.structures);
  XrayFiles files(request.one_per_imager);
  SaidOfSession said;
  study.rt_images = read_images(parts.images, request, files, said, notes);

  std::vector<RtPlan::Beam> beams;
  if (study.plan) {
    beams = imaged_beams(study);
    const auto planned_position = common_patient_position(*study.plan, beams);
    for (RtImage& image : study.rt_images)
      if (!image.patient_position) image.patient_position = planned_position;
  }
  check_images(study, request, notes);
  study.ct = cts.get(parts.ct, request.allowed, notes, progress);
  check_together(request, said, study, notes);
  place_patient(request, beams, study, notes);
  for (const RtImage& image : study.rt_images)
    study.xrays.push_back(
        read_xray_image(files.whole(image.path), image, xray_view(image, beam_of(image, notes), notes)));
  declare_planned_apertures(study, notes);
  check_isocenter(study);
  std::ranges::move(contradictions_in(study), std::back_inserter(notes.warnings));
  return study;
}

}  // namespace isoshift
