#include "io/objects/drr_image.h"

#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/utf8.h"
#include "geometry/rotation.h"
#include "io/dicom/decode.h"
#include "io/objects/object_header.h"

namespace isoshift {
namespace {

constexpr double kLineIntegralPerStored = 0.001;

// The beginning of a text in UTF-8, whole characters only.
std::string first_characters(const std::string& text, std::size_t count) {
  std::size_t end = 0;
  for (std::size_t found = 0; end < text.size(); ++end)
    if (begins_character(text[end]) && found++ == count) break;
  return text.substr(0, end);
}

void put_general(DicomItem dataset, const Study& study, std::size_t index, const std::string& series_instance_uid) {
  put_header(dataset, {.identity = study.ct->identity,
                       .sop_class_uid = UID_RTImageStorage,
                       .sop_instance_uid = new_uid(),
                       .modality = "RTIMAGE",
                       .series_instance_uid = series_instance_uid,
                       .series_number = 9002,
                       .series_description = "DRR",
                       .instance_number = static_cast<int>(index + 1)});
  dataset.put(DCM_OperatorsName, "");
  dataset.put(DCM_ImageType, "DERIVED\\SECONDARY\\DRR");
  dataset.put(DCM_ConversionType, "WSD");
  dataset.put(DCM_PatientOrientation, "");
  for (const std::string& uid : study.ct->sop_instance_uids)
    dataset.append_reference(DCM_SourceImageSequence, study.ct->sop_class_uid, uid);
}

void put_geometry(DicomItem dataset, const RtImage& image) {
  Notes said_already;
  const CarmGeometry geometry = carm_geometry(image, said_already);
  dataset.put(DCM_RTImagePlane, geometry.normal_plane ? "NORMAL" : "NON_NORMAL");
  dataset.put(DCM_XRayImageReceptorTranslation, std::span(geometry.receptor_translation_mm.data(), 3));
  dataset.put(DCM_XRayImageReceptorAngle, deg_from_rad(geometry.receptor_angle_rad));
  const Eigen::Vector3d &u = geometry.row_direction, &v = geometry.column_direction;
  dataset.put(DCM_RTImageOrientation, std::array{u.x(), u.y(), u.z(), v.x(), v.y(), v.z()});
  dataset.put(DCM_ImagePlanePixelSpacing, std::array{geometry.row_spacing_mm, geometry.column_spacing_mm});
  dataset.put(DCM_RTImagePosition, std::span(geometry.position_mm.data(), 2));
  dataset.put(DCM_RadiationMachineName, image.equipment.contains("RadiationMachineName")
                                            ? image.equipment.find("RadiationMachineName")->second
                                            : "");
  dataset.put(DCM_RadiationMachineSAD, geometry.sad_mm);
  dataset.put(DCM_RTImageSID, image.sid_mm.value());
  dataset.put(DCM_PrimaryDosimeterUnit, "MU");
  dataset.put(DCM_GantryAngle, image.gantry_angle_deg.value());
  dataset.put(DCM_BeamLimitingDeviceAngle, image.collimator_angle_deg.value_or(0.0));
  dataset.put(DCM_PatientSupportAngle, image.table.support_angle_deg.value());
  dataset.put(DCM_TableTopEccentricAngle, image.table.eccentric_angle_deg.value_or(0.0));
  dataset.put(DCM_TableTopPitchAngle, image.table.pitch_deg.value_or(0.0));
  dataset.put(DCM_TableTopRollAngle, image.table.roll_deg.value_or(0.0));
}

}  // namespace

void write_drr_image(const Study& study, std::size_t index, const Image<float>& line_integral,
                     const Eigen::Isometry3d& setup_error, const std::string& series_instance_uid,
                     const std::filesystem::path& path) {
  const RtImage& image = study.rt_images[index];
  if (image.pixel_from_room)
    throw Error(fmt::format("{}: its geometry is a projection matrix, which an RT Image cannot hold", image.label));
  if (image.imager && image.imager->is_corrected)
    throw Error(
        fmt::format("{}: the machine profile corrects where its receptor lies, which the header of an RT Image "
                    "cannot say: leave correct_imager out of the profile",
                    image.label));
  const bool is_as_planned = setup_error.isApprox(Eigen::Isometry3d::Identity(), 1e-12);
  DicomFile file;
  DicomItem dataset = file.dataset();
  put_general(dataset, study, index, series_instance_uid);
  dataset.put(DCM_RTImageLabel, first_characters(image.label, 16));
  dataset.put(DCM_RTImageDescription, is_as_planned ? "DRR, patient as planned" : "DRR, patient off plan");
  dataset.put(DCM_DerivationDescription, fmt::format("DRR of the planning CT as {} should have seen it", image.label));
  dataset.put(DCM_FrameOfReferenceUID, is_as_planned ? study.ct->frame_of_reference_uid : new_uid());
  dataset.put(DCM_PositionReferenceIndicator, "");
  // Off plan, the new frame of reference has its origin at the machine's isocenter.
  const Eigen::Vector3d isocenter_mm = is_as_planned ? study.isocenter_patient_mm : Eigen::Vector3d(0.0, 0.0, 0.0);
  dataset.put(DCM_IsocenterPosition, std::span(isocenter_mm.data(), 3));
  dataset.put(DCM_PatientPosition, to_string(study.patient_position));
  put_geometry(dataset, image);
  if (study.plan) {
    dataset.append_reference(DCM_ReferencedRTPlanSequence, study.plan->sop_class_uid, study.plan->sop_instance_uid);
    if (image.beam_number) dataset.put(DCM_ReferencedBeamNumber, *image.beam_number);
  }
  put_pixel_format(dataset, {.columns = line_integral.columns, .rows = line_integral.rows});
  dataset.put(DCM_PixelIntensityRelationship, "LOG");
  dataset.put(DCM_PixelIntensityRelationshipSign, -1);
  dataset.put(DCM_RescaleIntercept, 0.0);
  dataset.put(DCM_RescaleSlope, kLineIntegralPerStored);
  dataset.put(DCM_RescaleType, "US");
  std::vector<std::uint16_t> stored(line_integral.pixels.size());
  std::ranges::transform(line_integral.pixels, stored.begin(), [](float value) {
    return static_cast<std::uint16_t>(std::clamp(std::lround(value / kLineIntegralPerStored), 0L, 65535L));
  });
  dataset.put_pixels(stored);
  file.write(path);
}

}  // namespace isoshift
