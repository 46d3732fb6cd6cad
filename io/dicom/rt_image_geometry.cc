// Where the source, the receptor and the table of an X-ray stood.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/option_name.h"
#include "io/dicom/rt_image.h"

namespace isoshift {
namespace {

void expect_range(const RtImage& image, const DcmTagKey& tag, double value, double low, double high) {
  if (!(value >= low && value <= high))
    throw Error(
        fmt::format("{}: {} is {}, expected between {} and {}", image.path.string(), described(tag), value, low, high));
}

}  // namespace

TableAngles table_angles(std::span<const RtImage> images, Notes& notes) {
  const auto first_deg = [&](const std::optional<double> TableReadOuts::* angle_deg) -> std::optional<double> {
    const auto says =
        std::ranges::find_if(images, [&](const RtImage& image) { return (image.table.*angle_deg).has_value(); });
    return says == images.end() ? std::nullopt : says->table.*angle_deg;
  };
  const auto angle_rad = [&](const std::optional<double>& value_deg, const DcmTagKey& tag, const std::string& flag) {
    if (!value_deg)
      notes.warnings.push_back(
          fmt::format("{} is missing in all X-rays, taken as 0; {} supplies it", described(tag), flag));
    return wrapped_rad(rad_from_deg(value_deg.value_or(0.0)));
  };
  const double eccentric_deg = first_deg(&TableReadOuts::eccentric_angle_deg).value_or(0.0);
  const TableAngles table{
      .support_rad = angle_rad(first_deg(&TableReadOuts::support_angle_deg), DCM_PatientSupportAngle,
                               option("couch-angle", "DEG")),
      .eccentric_rad = wrapped_rad(rad_from_deg(eccentric_deg)),
      .pitch_rad =
          angle_rad(first_deg(&TableReadOuts::pitch_deg), DCM_TableTopPitchAngle, option("couch-pitch", "DEG")),
      .roll_rad = angle_rad(first_deg(&TableReadOuts::roll_deg), DCM_TableTopRollAngle, option("couch-roll", "DEG")),
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
  if (!image.pixel_from_room) {
    const CarmGeometry geometry = carm_geometry(image, notes);
    XrayView view = make_xray_view(geometry, beam);
    if (!image.imager || !image.imager->is_corrected) return view;
    return with_errors(view, geometry.gantry_angle_rad, image.sid_mm.value(), image.imager->values);
  }
  try {
    return xray_view_from_matrix(*image.pixel_from_room, image.sid_mm.value(), image.columns, image.rows, beam);
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", image.path.string(), error.what()));
  }
}

}  // namespace isoshift
