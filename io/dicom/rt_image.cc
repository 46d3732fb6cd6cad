#include "io/dicom/rt_image.h"

#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <numeric>

#include "base/error.h"
#include "io/dicom/decode.h"

namespace isoshift {
namespace {

constexpr double kMaxAngleNoiseDeg = 0.01;  // read-outs such as 359.998 mean 0
constexpr double kMaxReadOutNoise = 0.01;   // degrees or mm, between exposures of one image

// The items of the Exposure Sequence that speak of one frame: of several frames those that name it.
class Exposures {
 public:
  Exposures(const DicomItem& dataset, int frames) : items_(dataset.items(DCM_ExposureSequence)) {
    frame_numbers_.resize(items_.size());
    if (frames > 1)
      std::ranges::transform(items_, frame_numbers_.begin(),
                             [](const DicomItem& item) { return item.number(DCM_ReferencedFrameNumber); });
  }

  bool name_frames() const {
    return std::ranges::any_of(frame_numbers_, [](const auto& number) { return number.has_value(); });
  }
  std::vector<DicomItem> of(int frame) const {
    std::vector<DicomItem> items;
    for (std::size_t n = 0; n < items_.size(); ++n)
      if (!frame_numbers_[n] || *frame_numbers_[n] == frame + 1) items.push_back(items_[n]);
    return items;
  }

 private:
  std::vector<DicomItem> items_;
  std::vector<std::optional<double>> frame_numbers_;  // which frame each names, if there are several
};

// A dataset as one frame sees it: the exposure's value where it has one, else the top level's. Several exposures must
// agree.
class FrameAttributes {
 public:
  FrameAttributes(DicomItem dataset, std::vector<DicomItem> exposures)
      : dataset_(std::move(dataset)), exposures_(std::move(exposures)) {}

  std::optional<double> number(const DcmTagKey& tag) const {
    std::optional<double> agreed;
    for (const DicomItem& exposure : exposures_) {
      const auto value = exposure.number(tag);
      if (!value) continue;
      if (agreed && std::abs(*value - *agreed) > kMaxReadOutNoise)
        throw Error(
            fmt::format("{}: {} is {} in one exposure and {} in another of the same image, or {} is missing, which "
                        "tells their frames",
                        dataset_.where(), described(tag), *agreed, *value, described(DCM_ReferencedFrameNumber)));
      if (!agreed) agreed = value;
    }
    return agreed ? agreed : dataset_.number(tag);
  }

 private:
  DicomItem dataset_;
  std::vector<DicomItem> exposures_;
};

template <int N>
std::optional<Eigen::Matrix<double, N, 1>> vector_of(const DicomItem& dataset, const DcmTagKey& tag) {
  if (!dataset.has_value(tag)) return std::nullopt;
  return Eigen::Matrix<double, N, 1>(dataset.required_numbers(tag, N).data());
}

void expect_range(const RtImage& image, const DcmTagKey& tag, double value, double low, double high) {
  if (!(value > low && value < high))
    throw Error(
        fmt::format("{}: {} is {}, expected between {} and {}", image.path.string(), described(tag), value, low, high));
}

template <class T>
void replace(std::optional<T>& value, const T& by, const std::string& what, const std::string& switch_name,
             Notes& notes) {
  notes.overrides.push_back(fmt::format("{}: {} by {}", what, value ? "replaced" : "supplied", switch_name));
  value = by;
}

// Cine module (PS3.3 C.7.6.5): increments in ms, one for all frames or one for each, the first 0. Nothing where the
// file does not say when a later frame was taken.
std::optional<double> frame_offset_s(const DicomItem& d, int frame) {
  const std::vector<double> increments_ms = d.numbers(DCM_FrameTimeVector);
  if (static_cast<int>(increments_ms.size()) > frame)
    return std::accumulate(increments_ms.begin(), increments_ms.begin() + frame + 1, 0.0) / 1000.0;
  if (frame == 0) return 0.0;
  const auto increment_ms = d.number(DCM_FrameTime);
  return increment_ms ? std::optional(frame * *increment_ms / 1000.0) : std::nullopt;
}

RtImage read_frame(const std::filesystem::path& path, const DicomItem& d, const PixelFormat& format, int frame,
                   std::vector<DicomItem> exposures) {
  const FrameAttributes attributes(d, std::move(exposures));
  RtImage image;
  image.path = path;
  image.identity = read_identity(d);
  image.sop_class_uid = d.required_text(DCM_SOPClassUID);
  image.sop_instance_uid = d.required_text(DCM_SOPInstanceUID);
  image.series_instance_uid = d.text(DCM_SeriesInstanceUID).value_or("");
  image.frame_of_reference_uid = d.text(DCM_FrameOfReferenceUID);
  image.label = d.text(DCM_RTImageLabel).value_or(path.stem().string());
  image.frame = frame;
  if (format.frames > 1) image.label += fmt::format("#{}", frame + 1);
  if (const auto type = d.texts(DCM_ImageType); type.size() > 2) image.image_type = type[2];
  image.reported_values_origin = d.text(DCM_ReportedValuesOrigin);
  image.patient_position = d.text(DCM_PatientPosition);
  for (const DicomItem& plan : d.items(DCM_ReferencedRTPlanSequence))
    image.plan_sop_instance_uid = plan.text(DCM_ReferencedSOPInstanceUID);
  if (const auto number = d.number(DCM_ReferencedBeamNumber)) image.beam_number = static_cast<int>(*number);
  read_acquisition_time(d, image);
  const std::optional<double> offset_s = frame_offset_s(d, frame);
  image.frame_offset_s = offset_s.value_or(0.0);
  image.has_own_time = offset_s.has_value();
  image.kvp = attributes.number(DCM_KVP);

  image.plane = d.text(DCM_RTImagePlane);
  image.sad_mm = d.number(DCM_RadiationMachineSAD);
  image.sid_mm = d.number(DCM_RTImageSID);
  image.receptor_translation_mm = vector_of<3>(d, DCM_XRayImageReceptorTranslation);
  image.receptor_angle_deg = d.number(DCM_XRayImageReceptorAngle);
  if (d.has_value(DCM_RTImageOrientation)) image.orientation = d.required_numbers(DCM_RTImageOrientation, 6);
  image.pixel_spacing_mm = vector_of<2>(d, DCM_ImagePlanePixelSpacing);
  image.position_mm = vector_of<2>(d, DCM_RTImagePosition);
  image.gantry_angle_deg = attributes.number(DCM_GantryAngle);
  image.gantry_pitch_angle_deg = attributes.number(DCM_GantryPitchAngle);
  image.collimator_angle_deg = attributes.number(DCM_BeamLimitingDeviceAngle);
  image.table = read_table_read_outs([&](const DcmTagKey& tag) { return attributes.number(tag); });
  image.isocenter_mm = vector_of<3>(d, DCM_IsocenterPosition);

  for (const auto& [keyword, tag] : kEquipmentAttributes)
    if (const auto value = d.text(tag)) image.equipment[keyword] = *value;
  image.columns = format.columns;
  image.rows = format.rows;
  image.intensity_relationship = d.text(DCM_PixelIntensityRelationship);
  if (const auto sign = d.number(DCM_PixelIntensityRelationshipSign); sign && (*sign == 1 || *sign == -1))
    image.intensity_sign = static_cast<int>(*sign);
  image.photometric_interpretation = d.text(DCM_PhotometricInterpretation).value_or("");
  image.is_lossy = d.text(DCM_LossyImageCompression) == "01";
  image.has_modality_lut = !d.items(DCM_ModalityLUTSequence).empty();
  return image;
}

// Both angles turn counter-clockwise seen from the source, which is how the image is displayed (PS3.3 C.8.8.2.7). An
// image that is itself turned or mirrored on the receptor shows them turned back.
double collimator_angle_on_image_rad(const RtImage& image) {
  const std::vector<double> orientation = image.orientation.value_or(std::vector{1.0, 0.0, 0.0, 0.0, -1.0, 0.0});
  const Eigen::Vector3d row_direction(orientation.data()), column_direction(orientation.data() + 3);
  const double on_receptor_rad =
      rad_from_deg(image.collimator_angle_deg.value_or(0.0) - image.receptor_angle_deg.value_or(0.0)) -
      std::atan2(row_direction.y(), row_direction.x());
  const bool is_mirrored = row_direction.cross(column_direction).z() > 0.0;
  return is_mirrored ? -on_receptor_rad : on_receptor_rad;
}

}  // namespace

std::optional<PixelIntensity> pixel_intensity_from(std::string_view word) {
  using enum PixelIntensity::Relationship;
  if (word == "LIN+") return PixelIntensity{kLin, 1};
  if (word == "LIN-") return PixelIntensity{kLin, -1};
  if (word == "LOG+") return PixelIntensity{kLog, 1};
  if (word == "LOG-") return PixelIntensity{kLog, -1};
  return std::nullopt;
}

std::string to_string(const PixelIntensity& intensity) {
  return fmt::format("{}{}", intensity.relationship == PixelIntensity::Relationship::kLin ? "LIN" : "LOG",
                     intensity.sign > 0 ? '+' : '-');
}

const std::map<std::string, DcmTagKey, std::less<>> kEquipmentAttributes = {
    {"DetectorID", DCM_DetectorID},
    {"DeviceSerialNumber", DCM_DeviceSerialNumber},
    {"Manufacturer", DCM_Manufacturer},
    {"ManufacturerModelName", DCM_ManufacturerModelName},
    {"Modality", DCM_Modality},
    {"RTImageLabel", DCM_RTImageLabel},
    {"RadiationMachineName", DCM_RadiationMachineName},
    {"SeriesDescription", DCM_SeriesDescription},
    {"StationName", DCM_StationName},
};

bool RtImage::is_rt_image() const { return sop_class_uid == UID_RTImageStorage; }

std::vector<RtImage> read_rt_images(const DicomFile& file, Notes& notes) {
  const std::filesystem::path& path = file.path();
  const DicomItem dataset = file.dataset();
  const PixelFormat format = pixel_format(dataset);
  const Exposures exposures(dataset, format.frames);
  std::vector<RtImage> images;
  for (int frame = 0; frame < format.frames; ++frame) {
    std::vector<DicomItem> of_frame = exposures.of(frame);
    if (exposures.name_frames() && of_frame.empty())
      notes.warnings.push_back(fmt::format("{}: frame {} was left aside: no item of {} tells its geometry",
                                           path.string(), frame + 1, described(DCM_ExposureSequence)));
    else
      images.push_back(read_frame(path, dataset, format, frame, std::move(of_frame)));
  }
  for (RtImage& image : images) image.sha256 = file.sha256();
  return images;
}

RtImage with_switches(RtImage image, const RtImageSwitches& switches, Notes& notes, const std::string& origin) {
  const auto by = [&](const std::string& flag) { return origin.empty() ? flag : origin + ", as by " + flag; };
  const auto named = [&](const DcmTagKey& tag) { return fmt::format("{}: {}", image.label, described(tag)); };
  const bool by_matrix = image.pixel_from_room.has_value();  // says all of the geometry but the couch's
  if (const auto angle = switches.gantry_angle_deg.find(image.label);
      angle != switches.gantry_angle_deg.end() && by_matrix)
    throw UsageError(fmt::format("--gantry-angle {}={}: the machine profile gives this image a projection matrix",
                                 image.label, angle->second));
  else if (angle != switches.gantry_angle_deg.end())
    replace(image.gantry_angle_deg, angle->second, named(DCM_GantryAngle),
            by(fmt::format("--gantry-angle {}={}", image.label, angle->second)), notes);
  if (switches.couch_angle_deg)
    replace(image.table.support_angle_deg, *switches.couch_angle_deg, named(DCM_PatientSupportAngle),
            by(fmt::format("--couch-angle {}", *switches.couch_angle_deg)), notes);
  if (switches.couch_pitch_deg)
    replace(image.table.pitch_deg, *switches.couch_pitch_deg, named(DCM_TableTopPitchAngle),
            by(fmt::format("--couch-pitch {}", *switches.couch_pitch_deg)), notes);
  if (switches.couch_roll_deg)
    replace(image.table.roll_deg, *switches.couch_roll_deg, named(DCM_TableTopRollAngle),
            by(fmt::format("--couch-roll {}", *switches.couch_roll_deg)), notes);
  if (switches.sad_mm && !by_matrix)
    replace(image.sad_mm, *switches.sad_mm, named(DCM_RadiationMachineSAD),
            by(fmt::format("--sad {}", *switches.sad_mm)), notes);
  if (switches.sid_mm && !by_matrix)
    replace(image.sid_mm, *switches.sid_mm, named(DCM_RTImageSID), by(fmt::format("--sid {}", *switches.sid_mm)),
            notes);
  if (switches.position_mm && !by_matrix)
    replace(image.position_mm, *switches.position_mm, named(DCM_RTImagePosition),
            by(fmt::format("--rt-image-position {},{}", switches.position_mm->x(), switches.position_mm->y())), notes);
  if (switches.assume_centered && !image.position_mm && image.pixel_spacing_mm && !by_matrix)
    replace(image.position_mm,
            Eigen::Vector2d(-0.5 * (image.columns - 1) * image.pixel_spacing_mm->y(),
                            0.5 * (image.rows - 1) * image.pixel_spacing_mm->x()),
            named(DCM_RTImagePosition), by("--assume-centered"), notes);
  if (switches.intensity) {
    const bool is_linear = switches.intensity->relationship == PixelIntensity::Relationship::kLin;
    replace(image.intensity_relationship, std::string(is_linear ? "LIN" : "LOG"), named(DCM_PixelIntensityRelationship),
            by(fmt::format("--intensity {}", to_string(*switches.intensity))), notes);
    image.intensity_sign = switches.intensity->sign;
  }
  if (switches.beam) {
    const bool is_kv = *switches.beam == Beam::kKilovoltage;
    replace(image.kvp, is_kv ? 100.0 : 6000.0, named(DCM_KVP), by(fmt::format("--beam {}", is_kv ? "kv" : "mv")),
            notes);
  }
  if (switches.patient_position)
    replace(image.patient_position, std::string(to_string(*switches.patient_position)), named(DCM_PatientPosition),
            by(fmt::format("--patient-position {}", to_string(*switches.patient_position))), notes);
  return image;
}

std::vector<MissingAttribute> missing_attributes(const RtImage& image) {
  std::vector<MissingAttribute> missing;
  const auto need = [&](bool there, const DcmTagKey& tag, std::string supplied_by) {
    if (!there) missing.push_back({tag, std::move(supplied_by)});
  };
  if (!image.is_rt_image() && !image.pixel_from_room)
    need(false, DCM_ImagePlanePixelSpacing, "a projection matrix in a machine profile (--machine FILE)");
  const bool needs_geometry = image.is_rt_image() && !image.pixel_from_room;
  need(!needs_geometry || image.plane.has_value(), DCM_RTImagePlane, "");
  need(!needs_geometry || image.pixel_spacing_mm.has_value(), DCM_ImagePlanePixelSpacing, "");
  need(!needs_geometry || image.position_mm.has_value(), DCM_RTImagePosition,
       "--rt-image-position X,Y or --assume-centered");
  need(!needs_geometry || image.sad_mm.has_value(), DCM_RadiationMachineSAD, "--sad MM");
  need((!needs_geometry && !image.pixel_from_room) || image.sid_mm.has_value(), DCM_RTImageSID, "--sid MM");
  need(!needs_geometry || image.gantry_angle_deg.has_value(), DCM_GantryAngle,
       fmt::format("--gantry-angle {}=DEG", image.label));
  need(image.table.support_angle_deg.has_value(), DCM_PatientSupportAngle, "--couch-angle DEG");
  need(image.patient_position.has_value(), DCM_PatientPosition, "--patient-position HFS");
  const bool known = image.intensity_relationship == "LIN" || image.intensity_relationship == "LOG";
  need(known, DCM_PixelIntensityRelationship, "--intensity LIN+|LIN-|LOG+|LOG-");
  need(!known || image.intensity_sign.has_value(), DCM_PixelIntensityRelationshipSign,
       "--intensity LIN+|LIN-|LOG+|LOG-");
  return missing;
}

std::vector<Finding> rt_image_findings(const RtImage& image) {
  const std::string where = image.path.string();
  std::vector<Finding> findings;
  if (image.image_type == "DRR")
    findings.push_back({"drr", fmt::format("{}: {} says DRR: this is no X-ray", where, described(DCM_ImageType))});
  else if (image.is_rt_image() && image.image_type != "PORTAL" && image.image_type != "SIMULATOR" &&
           image.image_type != "RADIOGRAPH")
    throw Error(fmt::format("{}: {} says \"{}\", expected PORTAL, SIMULATOR or RADIOGRAPH as its third value", where,
                            described(DCM_ImageType), image.image_type));
  if (image.reported_values_origin && *image.reported_values_origin != "ACTUAL")
    findings.push_back(
        {"planned-geometry", fmt::format("{}: {} says {}: its angles were not measured", where,
                                         described(DCM_ReportedValuesOrigin), *image.reported_values_origin)});
  if (image.has_modality_lut)
    throw Error(fmt::format("{}: {}: pixel values through a table are not supported", where,
                            described(DCM_ModalityLUTSequence)));
  const double gantry_pitch_rad = wrapped_rad(rad_from_deg(image.gantry_pitch_angle_deg.value_or(0.0)));
  if (!image.pixel_from_room && std::abs(gantry_pitch_rad) > rad_from_deg(kMaxAngleNoiseDeg))
    throw Error(
        fmt::format("{}: {} is {} degrees; a tilted gantry is not supported, since the order of its rotations is "
                    "not defined",
                    where, described(DCM_GantryPitchAngle), *image.gantry_pitch_angle_deg));
  if (image.patient_position && !patient_position_from(*image.patient_position))
    throw Error(fmt::format("{}: {} is {}; expected HFS, HFP, FFS, FFP, HFDR, HFDL, FFDR or FFDL", where,
                            described(DCM_PatientPosition), *image.patient_position));
  return findings;
}

Beam beam_of(const RtImage& image, Notes& notes) {
  if (image.kvp) return *image.kvp > 1000.0 ? Beam::kMegavoltage : Beam::kKilovoltage;
  const bool is_portal = image.image_type == "PORTAL";
  notes.warnings.push_back(fmt::format("{}: {} is missing; taken as {} from image type {} (--beam kv|mv replaces it)",
                                       image.label, described(DCM_KVP), is_portal ? "MV" : "kV", image.image_type));
  return is_portal ? Beam::kMegavoltage : Beam::kKilovoltage;
}

TableAngles table_angles(std::span<const RtImage> images, Notes& notes) {
  const auto first_deg = [&](const std::optional<double> TableReadOuts::* angle_deg) -> std::optional<double> {
    const auto says =
        std::ranges::find_if(images, [&](const RtImage& image) { return (image.table.*angle_deg).has_value(); });
    return says == images.end() ? std::nullopt : says->table.*angle_deg;
  };
  const auto angle_rad = [&](const std::optional<double>& value_deg, const DcmTagKey& tag, const char* flag) {
    if (!value_deg)
      notes.warnings.push_back(
          fmt::format("{} is missing in all X-rays, taken as 0; {} DEG supplies it", described(tag), flag));
    return wrapped_rad(rad_from_deg(value_deg.value_or(0.0)));
  };
  const double eccentric_deg = first_deg(&TableReadOuts::eccentric_angle_deg).value_or(0.0);
  const TableAngles table{
      .support_rad = angle_rad(first_deg(&TableReadOuts::support_angle_deg), DCM_PatientSupportAngle, "--couch-angle"),
      .eccentric_rad = wrapped_rad(rad_from_deg(eccentric_deg)),
      .pitch_rad = angle_rad(first_deg(&TableReadOuts::pitch_deg), DCM_TableTopPitchAngle, "--couch-pitch"),
      .roll_rad = angle_rad(first_deg(&TableReadOuts::roll_deg), DCM_TableTopRollAngle, "--couch-roll"),
  };
  if (std::abs(table.eccentric_rad) > rad_from_deg(kMaxAngleNoiseDeg))
    notes.warnings.push_back(fmt::format("{} is {} degrees and was added to the couch angle",
                                         described(DCM_TableTopEccentricAngle), eccentric_deg));
  return table;
}

CarmGeometry carm_geometry(const RtImage& image, Notes& notes) {
  const std::string where = image.path.string();
  CarmGeometry geometry;
  geometry.sad_mm = image.sad_mm.value();
  const double sid_mm = image.sid_mm.value();
  expect_range(image, DCM_RadiationMachineSAD, geometry.sad_mm, 0.0, 5000.0);
  expect_range(image, DCM_RTImageSID, sid_mm, geometry.sad_mm / 2.0, 5000.0);
  geometry.gantry_angle_rad = rad_from_deg(image.gantry_angle_deg.value());

  geometry.receptor_translation_mm = Eigen::Vector3d(0.0, 0.0, geometry.sad_mm - sid_mm);
  if (image.receptor_translation_mm) {
    geometry.receptor_translation_mm = *image.receptor_translation_mm;
    if (std::abs(geometry.receptor_translation_mm.z() - (geometry.sad_mm - sid_mm)) > 0.5)
      throw Error(fmt::format("{}: {} has z = {} mm, expected SAD - SID = {} mm", where,
                              described(DCM_XRayImageReceptorTranslation), geometry.receptor_translation_mm.z(),
                              geometry.sad_mm - sid_mm));
  } else {
    notes.warnings.push_back(fmt::format("{}: {} is missing, taken as (0, 0, SAD - SID)", image.label,
                                         described(DCM_XRayImageReceptorTranslation)));
  }
  if (sid_mm == geometry.sad_mm)
    notes.warnings.push_back(
        fmt::format("{}: {} equals the SAD; its true value may be unknown", image.label, described(DCM_RTImageSID)));
  if (!image.receptor_angle_deg)
    notes.warnings.push_back(
        fmt::format("{}: {} is missing, taken as 0", image.label, described(DCM_XRayImageReceptorAngle)));
  geometry.receptor_angle_rad = rad_from_deg(image.receptor_angle_deg.value_or(0.0));

  geometry.normal_plane = image.plane == "NORMAL";
  if (!geometry.normal_plane && image.plane != "NON_NORMAL")
    throw Error(
        fmt::format("{}: {} is {}, expected NORMAL or NON_NORMAL", where, described(DCM_RTImagePlane), *image.plane));
  if (!geometry.normal_plane && !image.orientation)
    throw Error(fmt::format("{}: {} is missing, which {} NON_NORMAL needs", where, described(DCM_RTImageOrientation),
                            described(DCM_RTImagePlane)));
  if (image.orientation) {
    geometry.row_direction = Eigen::Vector3d(image.orientation->data());
    geometry.column_direction = Eigen::Vector3d(image.orientation->data() + 3);
    const bool is_orthonormal = std::abs(geometry.row_direction.norm() - 1.0) < 1e-4 &&
                                std::abs(geometry.column_direction.norm() - 1.0) < 1e-4 &&
                                std::abs(geometry.row_direction.dot(geometry.column_direction)) < 1e-4;
    const bool is_flat = std::abs(geometry.row_direction.z()) < 1e-4 && std::abs(geometry.column_direction.z()) < 1e-4;
    if (!is_orthonormal || (geometry.normal_plane && !is_flat))
      throw Error(fmt::format("{}: {} is not a pair of perpendicular unit vectors{}, as {} {} needs", where,
                              described(DCM_RTImageOrientation),
                              geometry.normal_plane ? " in the receptor's plane" : "", described(DCM_RTImagePlane),
                              *image.plane));
  }
  geometry.row_spacing_mm = image.pixel_spacing_mm->x();
  geometry.column_spacing_mm = image.pixel_spacing_mm->y();
  for (const double spacing_mm : {geometry.row_spacing_mm, geometry.column_spacing_mm})
    expect_range(image, DCM_ImagePlanePixelSpacing, spacing_mm, 0.05, 6.0);
  geometry.position_mm = *image.position_mm;
  geometry.columns = image.columns;
  geometry.rows = image.rows;
  return geometry;
}

XrayView xray_view(const RtImage& image, Beam beam, Notes& notes) {
  if (image.photometric_interpretation == "MONOCHROME1")
    notes.warnings.push_back(
        fmt::format("{}: {} is MONOCHROME1, which is for display only; pixel values are taken as they are", image.label,
                    described(DCM_PhotometricInterpretation)));
  if (!image.pixel_from_room) return make_xray_view(carm_geometry(image, notes), beam);
  try {
    return xray_view_from_matrix(*image.pixel_from_room, image.sid_mm.value(), image.columns, image.rows, beam);
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", image.path.string(), error.what()));
  }
}

XrayImage read_xray_image(const DicomFile& file, const RtImage& image, const XrayView& view) {
  const PixelFormat format = pixel_format(file.dataset());
  const std::vector<std::int32_t> stored_values = decode_frame(file, format, image.frame);
  const double slope = file.dataset().number(DCM_RescaleSlope).value_or(1.0);
  const double intercept = file.dataset().number(DCM_RescaleIntercept).value_or(0.0);
  if (slope == 0.0) throw Error(fmt::format("{}: {} is 0", image.path.string(), described(DCM_RescaleSlope)));

  XrayImage xray;
  xray.label = image.label;
  xray.view = view;
  xray.values = Image<float>(format.columns, format.rows);
  xray.collimator_angle_rad = collimator_angle_on_image_rad(image);
  const bool is_linear = image.intensity_relationship == "LIN";
  xray.meaning = is_linear ? XrayImage::Meaning::kIntensity : XrayImage::Meaning::kLineIntegral;

  // The sign speaks of stored values (C.8.11.3.1.2). Where rescaled values rise with the intensity they are it (LIN) or
  // its logarithm (LOG). Where they fall, LIN counts from the value that stands for no intensity, the largest or
  // smallest one that can be stored.
  const bool rises = *image.intensity_sign * slope > 0.0;
  const double dark = *image.intensity_sign > 0 ? 0.0 : format.max_stored_value();
  std::ranges::transform(stored_values, xray.values.pixels.begin(), [&](std::int32_t stored) {
    const double rescaled = slope * stored + intercept;
    if (!is_linear) return static_cast<float>(rises ? -rescaled : rescaled);
    return static_cast<float>(rises ? rescaled : std::abs(slope) * std::abs(stored - dark));
  });
  return xray;
}

}  // namespace isoshift
