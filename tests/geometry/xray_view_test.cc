// Every vector of docs/dicom.md 2.4: two independent implementations agreed on them to 1e-9.

#include "geometry/xray_view.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "base/error.h"
#include "geometry/patient_setup.h"
#include "tests/support/pose_near.h"

namespace isoshift::xray_view_test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

const Vector3d kIsocenter(10, -150, -420);
const Vector3d kPoint(40, -180, -370);

// SAD 1000, SID 1500, 1024 x 1024, 0.4 mm, centered.
CarmGeometry base_geometry(double gantry_deg) {
  CarmGeometry geometry;
  geometry.sad_mm = 1000.0;
  geometry.gantry_angle_rad = rad_from_deg(gantry_deg);
  geometry.receptor_translation_mm = Vector3d(0, 0, -500);
  geometry.column_spacing_mm = geometry.row_spacing_mm = 0.4;
  geometry.position_mm = Vector2d(-204.6, 204.6);
  geometry.columns = geometry.rows = 1024;
  return geometry;
}

TableAngles couch(double support_deg, double pitch_deg = 0.0, double roll_deg = 0.0) {
  return {.support_rad = rad_from_deg(support_deg),
          .pitch_rad = rad_from_deg(pitch_deg),
          .roll_rad = rad_from_deg(roll_deg)};
}

// (column, row) of a patient point.
Vector2d projected(const CarmGeometry& geometry, const TableAngles& table, const Vector3d& point_patient,
                   PatientPosition position = PatientPosition::kHfs) {
  const XrayView view = make_xray_view(geometry, Beam::kKilovoltage);
  return view.project(planned_room_from_patient(position, table, kIsocenter) * point_patient).value();
}

// dicom.md prints pixels to six decimals.
constexpr double kPrintedPx = 6e-7;

TEST(XrayView, ProjectsThePointsOfDicomMd24) {
  const std::array<Vector3d, 5> points = {kIsocenter, {30, -150, -420}, {10, -130, -420}, {10, -150, -400}, kPoint};
  struct Case {
    CarmGeometry geometry;
    TableAngles table;
    std::array<Vector2d, 5> expected;
  };
  CarmGeometry turned_receptor = base_geometry(30);
  turned_receptor.receptor_angle_rad = rad_from_deg(5);
  CarmGeometry translated_receptor = base_geometry(30);
  translated_receptor.receptor_translation_mm = Vector3d(12, -7.5, -500);
  const std::array<Case, 5> cases = {{
      {base_geometry(0),
       couch(0),
       {{{511.5, 511.5}, {586.5, 511.5}, {511.5, 511.5}, {511.5, 436.5}, {627.479381, 318.201031}}}},
      {base_geometry(90),
       couch(0),
       {{{511.5, 511.5}, {511.5, 511.5}, {586.5, 511.5}, {511.5, 436.5}, {395.520619, 318.201031}}}},
      {turned_receptor,
       couch(10),
       {{{511.5, 511.5},
         {577.001884, 504.027283},
         {548.221270, 514.712695},
         {506.709831, 437.066722},
         {541.858457, 301.443985}}}},
      {translated_receptor,
       couch(350),
       {{{481.5, 492.75},
         {546.101339, 505.903147},
         {518.361539, 492.75},
         {492.798399, 418.760938},
         {552.600889, 319.836595}}}},
      {base_geometry(30),
       couch(10, 2, -1.5),
       {{{511.5, 511.5},
         {575.127816, 498.413543},
         {549.593577, 508.631341},
         {498.933572, 437.767800},
         {516.583896, 303.965280}}}},
  }};
  for (std::size_t c = 0; c < cases.size(); ++c)
    for (std::size_t p = 0; p < points.size(); ++p)
      EXPECT_THAT(projected(cases[c].geometry, cases[c].table, points[p]), VectorNear(cases[c].expected[p], kPrintedPx))
          << "column " << c << ", point " << p;
}

TEST(XrayView, ProjectsAllEightPatientPositionsOfDicomMd24) {
  struct Case {
    PatientPosition position;
    Vector2d g0, g90, g30_c10;
  };
  using enum PatientPosition;
  const std::array<Case, 8> cases = {{
      {kHfs, {627.479381, 318.201031}, {395.520619, 318.201031}, {523.435346, 299.597398}},
      {kHfp, {402.276699, 329.461165}, {620.723301, 329.461165}, {446.534883, 353.508450}},
      {kFfs, {395.520619, 704.798969}, {402.276699, 693.538835}, {385.540590, 718.912101}},
      {kFfp, {620.723301, 693.538835}, {627.479381, 704.798969}, {690.664260, 675.489843}},
      {kHfdr, {395.520619, 318.201031}, {402.276699, 329.461165}, {329.857924, 345.242201}},
      {kHfdl, {620.723301, 329.461165}, {627.479381, 318.201031}, {633.602091, 310.439586}},
      {kFfdr, {627.479381, 704.798969}, {395.520619, 704.798969}, {582.600889, 684.413405}},
      {kFfdl, {402.276699, 693.538835}, {620.723301, 693.538835}, {500.403290, 708.513290}},
  }};
  for (const Case& c : cases) {
    EXPECT_THAT(projected(base_geometry(0), couch(0), kPoint, c.position), VectorNear(c.g0, kPrintedPx))
        << to_string(c.position);
    EXPECT_THAT(projected(base_geometry(90), couch(0), kPoint, c.position), VectorNear(c.g90, kPrintedPx))
        << to_string(c.position);
    EXPECT_THAT(projected(base_geometry(30), couch(10), kPoint, c.position), VectorNear(c.g30_c10, kPrintedPx))
        << to_string(c.position);
  }
}

TEST(XrayView, MatrixIsThatOfDicomMd24) {
  // The product pixel_from_room * room_from_patient, its rows scaled so that the last one's first three have length 1.
  const auto matrix = [](const CarmGeometry& geometry, const TableAngles& table) {
    const XrayView view = make_xray_view(geometry, Beam::kKilovoltage);
    Eigen::Matrix<double, 3, 4> p =
        view.pixel_from_room * planned_room_from_patient(PatientPosition::kHfs, table, kIsocenter).matrix();
    return Eigen::Matrix<double, 3, 4>(p / p.row(2).head<3>().norm());
  };
  Eigen::Matrix<double, 3, 4> g0, g90, g30;
  g0 << 3750, 511.5, 0, 550725, 0, 511.5, -3750, -986775, 0, 1, 0, 1150;
  g90 << -511.5, 3750, 0, 1079115, -511.5, 0, -3750, -1058385, -1, 0, 0, 1010;
  g30 << 2990.976213, 2310.837053, -195.513828, 746099.988085, -621.820846, 606.389012, -3683.715984, -938484.153122,
      -0.492404, 0.866025, 0.086824, 1171.293967;
  CarmGeometry turned_receptor = base_geometry(30);
  turned_receptor.receptor_angle_rad = rad_from_deg(5);
  EXPECT_THAT(matrix(base_geometry(0), couch(0)), VectorNear(g0, 1e-6));
  EXPECT_THAT(matrix(base_geometry(90), couch(0)), VectorNear(g90, 1e-6));
  EXPECT_THAT(matrix(turned_receptor, couch(10)), VectorNear(g30, 1e-6));
}

TEST(XrayView, HandlesAnisotropicPixelsOffCenterOfDicomMd24) {
  CarmGeometry geometry = base_geometry(0);
  geometry.row_spacing_mm = 0.5;
  geometry.position_mm = Vector2d(-200, 180);
  EXPECT_THAT(projected(geometry, couch(0), kPoint), VectorNear(Vector2d(615.979381, 205.360825), kPrintedPx));
  EXPECT_THAT(projected(geometry, couch(0), kIsocenter), VectorNear(Vector2d(500, 360), kPrintedPx));
  geometry.gantry_angle_rad = rad_from_deg(90);
  geometry.receptor_translation_mm = Vector3d(5, -3, -500);
  EXPECT_THAT(projected(geometry, couch(0), kPoint), VectorNear(Vector2d(371.520619, 199.360825), kPrintedPx));
  EXPECT_THAT(projected(geometry, couch(0), kIsocenter), VectorNear(Vector2d(487.5, 354), kPrintedPx));
}

TEST(XrayView, HandlesTheNonNormalPlaneOfDicomMd24) {
  CarmGeometry geometry = base_geometry(30);
  geometry.normal_plane = false;
  geometry.row_direction = Vector3d(std::cos(rad_from_deg(5)), 0, std::sin(rad_from_deg(5)));
  EXPECT_THAT(projected(geometry, couch(10), kPoint), VectorNear(Vector2d(523.477602, 299.656387), kPrintedPx));
}

TEST(XrayView, RayHitsWhatItsPixelShows) {
  const XrayView view = make_xray_view(base_geometry(30), Beam::kKilovoltage);
  const Ray ray = view.ray(123.25, 777.5);
  for (const double share : {0.1, 0.66, 1.0}) {
    const Vector3d on_ray = ray.source_room_mm + share * (ray.pixel_room_mm - ray.source_room_mm);
    EXPECT_THAT(view.project(on_ray).value(), VectorNear(Vector2d(123.25, 777.5), 1e-9));
    EXPECT_NEAR((view.pixel_from_room * on_ray.homogeneous()).z(), share, 1e-12);  // the fraction of the way
  }
}

// SID = SAD: pixel sizes refer to the isocenter's plane, and half of the patient lies behind it.
TEST(XrayView, RaysPassThroughThePatientWhereTheImagePlaneDoesNot) {
  CarmGeometry at_isocenter = base_geometry(30.0);
  at_isocenter.receptor_translation_mm = Vector3d::Zero();
  at_isocenter.column_spacing_mm = at_isocenter.row_spacing_mm = 0.4 / 1.5;
  at_isocenter.position_mm /= 1.5;
  const XrayView view = make_xray_view(at_isocenter, Beam::kKilovoltage);
  const XrayView behind = make_xray_view(base_geometry(30.0), Beam::kKilovoltage);
  EXPECT_THAT(view.project(Vector3d(30, 20, 10)).value(),
              VectorNear(behind.project(Vector3d(30, 20, 10)).value(), 1e-9));
  const Ray ray = view.ray(100.0, 700.0);
  EXPECT_THAT(view.project(ray.pixel_room_mm).value(), VectorNear(Vector2d(100.0, 700.0), 1e-9));
  EXPECT_NEAR((ray.pixel_room_mm - view.source_room_mm).dot(view.central_direction_room()), 2000.0, 1e-6);
  const Ray to_receptor = behind.ray(100.0, 700.0);
  EXPECT_NEAR((to_receptor.pixel_room_mm - behind.source_room_mm).dot(behind.central_direction_room()), 1500.0, 1e-6);
}

TEST(XrayView, RefusesPointsBehindTheSource) {
  const XrayView view = make_xray_view(base_geometry(0), Beam::kKilovoltage);
  EXPECT_EQ(view.project(Vector3d(0, 0, 1200)), std::nullopt);
}

TEST(XrayView, SourceStandsAtThePatientsLeftAtGantry90) {
  const XrayView view = make_xray_view(base_geometry(90), Beam::kKilovoltage);
  EXPECT_THAT(view.source_room_mm, VectorNear(Vector3d(1000, 0, 0), 1e-9));
}

TEST(XrayView, DownscaledBlocksKeepTheirCenters) {
  const XrayView view = make_xray_view(base_geometry(30), Beam::kKilovoltage);
  const XrayView quarter = view.downscaled(4);
  EXPECT_EQ(quarter.columns, 256);
  // Block (10, 20) holds columns 40..43 and rows 80..83, whose middle is (41.5, 81.5).
  EXPECT_THAT(quarter.ray(10, 20).pixel_room_mm, VectorNear(view.ray(41.5, 81.5).pixel_room_mm, 1e-9));
}

// A matrix without sense also has a camera: pixels that no receptor has give it away.
TEST(XrayView, AMatrixOfImpossiblePixelsIsRefused) {
  CarmGeometry geometry{.sad_mm = 1000,
                        .receptor_translation_mm = {0, 0, -500},
                        .column_spacing_mm = 0.4,
                        .row_spacing_mm = 0.4,
                        .position_mm = {-200, 200},
                        .columns = 1000,
                        .rows = 1000};
  const Eigen::Matrix<double, 3, 4> right = make_xray_view(geometry, Beam::kKilovoltage).pixel_from_room;
  const auto view_of = [](const Eigen::Matrix<double, 3, 4>& matrix) {
    return xray_view_from_matrix(matrix, 1500, 1000, 1000, Beam::kKilovoltage);
  };
  EXPECT_NO_THROW(view_of(right));
  Eigen::Matrix<double, 3, 4> sheared = right, thin = right, fine = right, of_meters = right;
  sheared.row(0) += 0.1 * right.row(1);
  thin.row(0) *= 3.0;
  fine.topRows<2>() *= 10.0;
  of_meters.leftCols<3>() *= 1000.0;
  for (const auto& matrix : {sheared, thin, fine, of_meters}) EXPECT_THROW(view_of(matrix), Error);
}

}  // namespace
}  // namespace isoshift::xray_view_test
