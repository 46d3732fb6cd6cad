// What of an X-ray's attributes is missing, forbidden or supplied by a person.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/option_name.h"
#include "io/dicom/rt_image.h"

namespace isoshift {
namespace {

template <class T>
void replace(std::optional<T>& value, const T& by, const std::string& what, const std::string& switch_name,
             Notes& notes) {
  notes.overrides.push_back(fmt::format("{}: {} by {}", what, value ? "replaced" : "supplied", switch_name));
  value = by;
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

RtImage with_switches(RtImage image, const RtImageSwitches& switches, Notes& notes, const std::string& origin) {
  const auto by = [&](const std::string& flag) { return origin.empty() ? flag : origin + ", as by " + flag; };
  const auto named = [&](const DcmTagKey& tag) { return fmt::format("{}: {}", image.label, described(tag)); };
  const bool by_matrix = image.pixel_from_room.has_value();  // says all of the geometry but the couch's
  if (const auto angle = switches.gantry_angle_deg.find(image.label);
      angle != switches.gantry_angle_deg.end() && by_matrix)
    throw UsageError(fmt::format("{}: the machine profile gives this image a projection matrix",
                                 option("gantry-angle", fmt::format("{}={}", image.label, angle->second))));
  else if (angle != switches.gantry_angle_deg.end())
    replace(image.gantry_angle_deg, angle->second, named(DCM_GantryAngle),
            by(option("gantry-angle", fmt::format("{}={}", image.label, angle->second))), notes);
  if (switches.couch_angle_deg)
    replace(image.table.support_angle_deg, *switches.couch_angle_deg, named(DCM_PatientSupportAngle),
            by(option("couch-angle", fmt::to_string(*switches.couch_angle_deg))), notes);
  if (switches.couch_pitch_deg)
    replace(image.table.pitch_deg, *switches.couch_pitch_deg, named(DCM_TableTopPitchAngle),
            by(option("couch-pitch", fmt::to_string(*switches.couch_pitch_deg))), notes);
  if (switches.couch_roll_deg)
    replace(image.table.roll_deg, *switches.couch_roll_deg, named(DCM_TableTopRollAngle),
            by(option("couch-roll", fmt::to_string(*switches.couch_roll_deg))), notes);
  const bool is_of_no_use = switches.sad_mm || switches.sid_mm || switches.position_mm || switches.assume_centered;
  if (by_matrix && is_of_no_use)
    notes.warnings.push_back(
        fmt::format("{}: a projection matrix places this image; distances and positions by {}, {}, {} or {} are not "
                    "used for it",
                    image.label, option("sad"), option("sid"), option("rt-image-position"), option("assume-centered")));
  if (switches.sad_mm && !by_matrix)
    replace(image.sad_mm, *switches.sad_mm, named(DCM_RadiationMachineSAD),
            by(option("sad", fmt::to_string(*switches.sad_mm))), notes);
  if (switches.sid_mm && !by_matrix)
    replace(image.sid_mm, *switches.sid_mm, named(DCM_RTImageSID), by(option("sid", fmt::to_string(*switches.sid_mm))),
            notes);
  if (switches.position_mm && !by_matrix)
    replace(image.position_mm, *switches.position_mm, named(DCM_RTImagePosition),
            by(option("rt-image-position", fmt::format("{},{}", switches.position_mm->x(), switches.position_mm->y()))),
            notes);
  if (switches.assume_centered && !image.position_mm && image.pixel_spacing_mm && !by_matrix)
    replace(image.position_mm,
            Eigen::Vector2d(-0.5 * (image.columns - 1) * image.pixel_spacing_mm->y(),
                            0.5 * (image.rows - 1) * image.pixel_spacing_mm->x()),
            named(DCM_RTImagePosition), by(option("assume-centered")), notes);
  if (switches.intensity) {
    const bool is_linear = switches.intensity->relationship == PixelIntensity::Relationship::kLin;
    replace(image.intensity_relationship, std::string(is_linear ? "LIN" : "LOG"), named(DCM_PixelIntensityRelationship),
            by(option("intensity", to_string(*switches.intensity))), notes);
    image.intensity_sign = switches.intensity->sign;
  }
  if (switches.beam) {
    const bool is_kv = *switches.beam == Beam::kKilovoltage;
    replace(image.kvp, is_kv ? 100.0 : 6000.0, named(DCM_KVP), by(option("beam", is_kv ? "kv" : "mv")), notes);
  }
  if (switches.patient_position)
    replace(image.patient_position, std::string(to_string(*switches.patient_position)), named(DCM_PatientPosition),
            by(option("patient-position", to_string(*switches.patient_position))), notes);
  return image;
}

std::vector<MissingAttribute> missing_attributes(const RtImage& image) {
  std::vector<MissingAttribute> missing;
  const auto need = [&](bool there, const DcmTagKey& tag, std::string supplied_by, std::string found = "") {
    if (!there) missing.push_back({tag, std::move(supplied_by), std::move(found)});
  };
  need(!image.identity.study_instance_uid.empty(), DCM_StudyInstanceUID, "");
  need(!image.series_instance_uid.empty(), DCM_SeriesInstanceUID, "");
  if (!image.is_rt_image() && !image.pixel_from_room)
    need(false, DCM_ImagePlanePixelSpacing,
         "a projection matrix in a machine profile (" + option("machine", "FILE") + ")");
  const bool needs_geometry = image.is_rt_image() && !image.pixel_from_room;
  need(!needs_geometry || image.plane.has_value(), DCM_RTImagePlane, "");
  need(!needs_geometry || image.pixel_spacing_mm.has_value(), DCM_ImagePlanePixelSpacing, "");
  need(!needs_geometry || image.position_mm.has_value(), DCM_RTImagePosition,
       option("rt-image-position", "X,Y") + " or " + option("assume-centered"));
  need(!needs_geometry || image.sad_mm.has_value(), DCM_RadiationMachineSAD, option("sad", "MM"));
  need((!needs_geometry && !image.pixel_from_room) || image.sid_mm.has_value(), DCM_RTImageSID, option("sid", "MM"));
  need(!needs_geometry || image.gantry_angle_deg.has_value(), DCM_GantryAngle,
       option("gantry-angle", fmt::format("{}=DEG", image.label)));
  need(image.table.support_angle_deg.has_value(), DCM_PatientSupportAngle, option("couch-angle", "DEG"));
  need(image.patient_position.has_value(), DCM_PatientPosition, option("patient-position", "HFS"));
  const bool known = image.intensity_relationship == "LIN" || image.intensity_relationship == "LOG";
  need(known, DCM_PixelIntensityRelationship, option("intensity", "LIN+|LIN-|LOG+|LOG-"),
       image.intensity_relationship.value_or(""));
  need(!known || image.intensity_sign == 1 || image.intensity_sign == -1, DCM_PixelIntensityRelationshipSign,
       option("intensity", "LIN+|LIN-|LOG+|LOG-"),
       image.intensity_sign ? fmt::format("{}", *image.intensity_sign) : "");
  return missing;
}

std::vector<FailedCheck> rt_image_findings(const RtImage& image) {
  const std::string where = image.path.string();
  std::vector<FailedCheck> findings;
  if (image.image_type == "DRR")
    findings.push_back({"drr", fmt::format("{}: {} says DRR: this is not an X-ray", where, described(DCM_ImageType))});
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
  notes.warnings.push_back(fmt::format("{}: {} is missing; taken as {} from image type {} ({} replaces it)",
                                       image.label, described(DCM_KVP), is_portal ? "MV" : "kV", image.image_type,
                                       option("beam", "kv|mv")));
  return is_portal ? Beam::kMegavoltage : Beam::kKilovoltage;
}

}  // namespace isoshift
