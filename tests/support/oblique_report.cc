#include "tests/support/oblique_report.h"

#include "geometry/rotation.h"
#include "tests/support/findings.h"

namespace isoshift {

// A view of another size than its picture.
SetupResult::View view_with_picture(const std::string& label) {
  SetupResult::View view{.label = label,
                         .sop_class_uid = "1.2.840.10008.5.1.4.1.1.481.1",
                         .sop_instance_uid = "1.2.3.4",
                         .sha256 = std::string(64, 'a'),
                         .gantry_deg = 45,
                         .columns = 120,
                         .rows = 90};
  ViewPicture& picture = view.picture;
  for (auto* image : {&picture.xray, &picture.drr_planned, &picture.drr_found}) {
    *image = Image<std::uint8_t>(60, 45, 30);
    for (int row = 10; row < 30; ++row)
      for (int column = 15; column < 40; ++column) image->at(column, row) = 200;
  }
  picture.isocenter_px = {29.5, 22.0};
  picture.pixels_per_mm = 0.4;
  picture.directions = {"R", "L", "H", "F"};
  picture.field = {{{1, 1}, {58, 1}, {58, 43}, {1, 43}}};
  picture.structures = {
      {.name = "PTV", .planned = {{{20, 20}, {30, 20}, {25, 30}}}, .found = {{{21, 20}, {31, 20}, {26, 30}}}}};
  return view;
}

// head-oblique at its truth, the worked example of docs/conventions.md.
SetupResult oblique_report(Verdict verdict) {
  SetupResult report;
  report.made_on = "2026-03-01T10:16:02+0100";
  report.version = "0.1.0";
  report.commit = "abc";
  report.findings = findings_for(verdict);
  report.identity = {.character_set = "ISO_IR 192",
                     .patient_id = "ID-1",
                     .patient_name = "Example",
                     .study_instance_uid = "1.2.3",
                     .study_date = "20260301"};
  report.plan_uid = "1.2.9";
  report.plan_class_uid = "1.2.840.10008.5.1.4.1.1.481.5";
  report.patient_position = "HFS";
  report.table.support_rad = rad_from_deg(10.0);
  report.setup_error.translation() = Eigen::Vector3d(-7.4, 3.9, -5.2);
  report.setup_error.linear() = rotation_from_zxy({rad_from_deg(-2.9), rad_from_deg(-2.3), rad_from_deg(1.7)});
  report.views = {view_with_picture("KV_45")};
  return report;
}

SetupResult bent_report(Verdict verdict) {
  SetupResult report = oblique_report(verdict);
  report.table = {};
  report.target = Target{.name = "PTV", .chosen_by = "--target", .center_room_mm = {0, 10, 0}};
  report.target_deformation_mm = 0.4;
  report.target_image_share = 0.7;
  const auto body = [](std::string name, double y_mm, const Eigen::Vector3d& mm, const Eigen::Vector3d& deg) {
    return BodyMotion{.name = std::move(name),
                      .center_room_mm = {0, y_mm, 0},
                      .displacement_mm = mm,
                      .rotation_rad = deg.unaryExpr(&rad_from_deg),
                      .sigma_mm = {0.1, 0.2, 0.1},
                      .image_share = 0.9};
  };
  // Head first, supine: y is toward the head, x to the patient's left, z to the front.
  report.bodies = {body("vertebra 3 toward the feet", -70, {9.0, -2.0, 0.0}, {0.5, 0.0, 0.0}),
                   body("vertebra nearest to the target", 5, {0.1, 0.0, 0.1}, {0.1, 0.0, 0.0}),
                   body("vertebra 2 toward the head", 55, {0.0, 0.0, 3.0}, {-4.0, 0.5, 0.0}),
                   body("front bones 60 mm toward the head", 75, {0.0, 0.0, 12.0}, {0.0, 6.0, 0.0}),
                   body("left bones 120 mm toward the head", 125, {0.0, 30.0, 0.0}, {0.0, 0.0, 9.0})};
  report.bodies[1].carries_target = 0.62;
  report.structures = {{.name = "Spinal^Cord", .displacement_mm = {0.3, -0.4, 1.2}, .most_mm = 4.26}};
  report.bodies[3].breathes = true;
  report.bodies[4].image_share = 0.05;
  return report;
}

SiteRules small_couch() {
  return {.name = "Linac 3",
          .sha256 = std::string(64, 'b'),
          .level = ActionLevel{.translation_mm = 5.0, .rotation_deg = 3.0},
          .couch_dof = CouchDof::kFour,
          .couch_scale = ValidatedScale{CouchScale::kVarianIec, "J. Doe", "2026-03-01"}};
}

}  // namespace isoshift
