#include "phantom/bends.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "io/dicom/rt_plan.h"
#include "io/dicom/rt_structures.h"
#include "phantom/study_writer.h"
#include "tests/support/pose_near.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::bends_test {
namespace {

using Anatomy = PhantomOptions::Anatomy;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kRadPerDeg = 3.14159265358979323846 / 180.0;

PhantomOptions options_of(Anatomy anatomy, const std::vector<std::string>& bends) {
  PhantomOptions options;
  options.anatomy = anatomy;
  options.placement.isocenter_patient_mm = Vector3d(-12.5, 38, -410);
  options.seed = 3;
  for (const std::string& bend : bends) options.bends.push_back(Bend::from_text(bend));
  return options;
}

const BentBody& body_named(const BentPhantom& phantom, const std::string& name) {
  for (const BentBody& bent : phantom.bodies)
    if (bent.body.name == name) return bent;
  throw Error("no body " + name);
}

// Degrees by which a body is turned.
double turn_deg(const BentBody& bent) {
  return Eigen::AngleAxisd(bent.moved_from_planned.rotation()).angle() / kRadPerDeg;
}

TEST(PhantomBends, WithoutBendsXraysShowTheShapesOfTheCt) {
  for (const Anatomy anatomy : {Anatomy::kHead, Anatomy::kSpine, Anatomy::kThorax}) {
    const BentPhantom phantom = phantom_of(options_of(anatomy, {}));
    const Vector3d center(-12.5, 38, -410);
    const std::vector<Shape> shapes = anatomy == Anatomy::kHead    ? head_phantom(center, 3)
                                      : anatomy == Anatomy::kSpine ? spine_phantom(center, 3)
                                                                   : thorax_phantom(center, 3, Vector3d::Zero());
    ASSERT_EQ(phantom.in_ct.size(), shapes.size());
    for (std::size_t n = 0; n < shapes.size(); ++n) {
      EXPECT_EQ(phantom.in_ct[n].unit_from_patient.matrix(), shapes[n].unit_from_patient.matrix());
      EXPECT_EQ(phantom.in_xrays[n].unit_from_patient.matrix(), shapes[n].unit_from_patient.matrix());
    }
  }
}

TEST(PhantomBends, JawTurnsAboutItsJointsAndTheSkullStays) {
  const BentPhantom phantom = phantom_of(options_of(Anatomy::kHead, {"jaw:10"}));
  const BentBody& jaw = body_named(phantom, "mandible");
  EXPECT_NEAR(turn_deg(jaw), 10.0, 1e-9);
  EXPECT_THAT(Vector3d(jaw.moved_from_planned * jaw.body.carried_at_patient_mm),
              VectorNear(jaw.body.carried_at_patient_mm, 1e-9));
  // Opened: the chin, in front of and below the joints, goes down and back.
  const Vector3d chin = jaw.body.carried_at_patient_mm + Vector3d(0, -45, -40);
  const Vector3d by_mm = jaw.moved_from_planned * chin - chin;
  EXPECT_LT(by_mm.z(), -5.0);
  EXPECT_GT(by_mm.y(), 5.0);
  for (const char* name : {"skull", "C1", "C2", "C3"})
    EXPECT_TRUE(body_named(phantom, name).moved_from_planned.isApprox(Eigen::Isometry3d::Identity())) << name;
}

TEST(PhantomBends, NeckTurnsMoreTheFartherItIsFromTheSkull) {
  const BentPhantom phantom = phantom_of(options_of(Anatomy::kHead, {"neck:8"}));
  EXPECT_EQ(turn_deg(body_named(phantom, "skull")), 0.0);
  EXPECT_EQ(turn_deg(body_named(phantom, "mandible")), 0.0);
  const double c1 = turn_deg(body_named(phantom, "C1")), c2 = turn_deg(body_named(phantom, "C2")),
               c3 = turn_deg(body_named(phantom, "C3"));
  EXPECT_GT(c1, 0.0);
  EXPECT_GT(c2, c1);
  EXPECT_GT(c3, c2);
  EXPECT_LT(c3, 8.0);
  // The neck comes forward under the head.
  const BentBody& lowest = body_named(phantom, "C3");
  EXPECT_LT((lowest.moved_from_planned * lowest.body.center_patient_mm - lowest.body.center_patient_mm).y(), -0.5);
}

// The distance along the line of joints stays; the angle is that of the stated curve.
TEST(PhantomBends, SpineBendsFromItsMiddleAndKeepsItsLength) {
  const BentPhantom phantom = phantom_of(options_of(Anatomy::kSpine, {"spine:6"}));
  EXPECT_TRUE(body_named(phantom, "L3").moved_from_planned.isApprox(Eigen::Isometry3d::Identity()));
  for (const auto& [name, most_deg] :
       {std::pair("L1", 6.0), std::pair("L2", 6.0), std::pair("L4", 4.8), std::pair("L5", 4.8)}) {
    const BentBody& level = body_named(phantom, name);
    const double distance_mm = std::abs(level.body.center_patient_mm.z() + 410.0), u = distance_mm / 100.0;
    EXPECT_NEAR(turn_deg(level), most_deg * u * u * (3.0 - 2.0 * u), 1e-6) << name;
    // A chord of a gentle arc is at most 0.1 mm shorter than the arc.
    const Vector3d on_line(-12.5, 38, level.body.center_patient_mm.z());
    EXPECT_NEAR((level.moved_from_planned * on_line - Vector3d(-12.5, 38, -410)).norm(), distance_mm, 0.1) << name;
  }
}

TEST(PhantomBends, EveryVertebraHasProcessesOfItsOwn) {
  const auto process_lengths = [](const std::vector<std::string>& bends) {
    const BentPhantom phantom = phantom_of(options_of(Anatomy::kSpine, bends));
    std::vector<double> lengths;
    for (std::size_t body = 0; body < phantom.bodies.size(); ++body) {
      if (!phantom.bodies[body].body.is_vertebra) continue;
      double longest = 0.0;  // the spinous process: the box that reaches farthest back
      for (const Shape& shape : phantom.in_ct)
        if (shape.body == static_cast<int>(body) && shape.kind == Shape::Kind::kBox)
          longest = std::max(longest, shape.unit_from_patient.inverse().linear().col(1).norm());
      lengths.push_back(longest);
    }
    return lengths;
  };
  const std::vector<double> equal = process_lengths({}), own = process_lengths({"spine:0"});
  ASSERT_EQ(own.size(), 5U);
  for (std::size_t a = 0; a < own.size(); ++a)
    for (std::size_t b = 0; b < a; ++b) {
      EXPECT_NEAR(equal[a], equal[b], 1e-9);
      EXPECT_GT(std::abs(own[a] - own[b]), 0.01);
    }
}

TEST(PhantomBends, LostTissueMovesNoBone) {
  for (const Anatomy anatomy : {Anatomy::kHead, Anatomy::kSpine, Anatomy::kThorax}) {
    const BentPhantom phantom = phantom_of(options_of(anatomy, {"weight-loss:20"}));
    for (const BentBody& bent : phantom.bodies)
      EXPECT_TRUE(bent.moved_from_planned.isApprox(Eigen::Isometry3d::Identity())) << bent.body.name;
    int thinner = 0;
    for (std::size_t n = 0; n < phantom.in_ct.size(); ++n)
      if (!phantom.in_ct[n].unit_from_patient.isApprox(phantom.in_xrays[n].unit_from_patient)) {
        ++thinner;
        EXPECT_EQ(phantom.in_ct[n].added.bone, 0.0);
      }
    EXPECT_GE(thinner, 1);
  }
}

TEST(PhantomBends, CouchIsShownByOneOfThemOnly) {
  const BentPhantom missing = phantom_of(options_of(Anatomy::kHead, {"missing-couch"}));
  EXPECT_EQ(missing.in_ct.size(), missing.in_xrays.size() + 3);
  const BentPhantom extra = phantom_of(options_of(Anatomy::kHead, {"extra-couch"}));
  EXPECT_EQ(extra.in_ct.size() + 3, extra.in_xrays.size());
}

TEST(PhantomBends, ShouldersRiseAndTheSpineStays) {
  const BentPhantom phantom = phantom_of(options_of(Anatomy::kThorax, {"shoulders:12"}));
  for (const char* name : {"shoulder left", "shoulder right"}) {
    const BentBody& shoulder = body_named(phantom, name);
    EXPECT_NEAR(turn_deg(shoulder), 4.0, 1e-9);
    // The outer end rises more than the inner one.
    const Vector3d inner = shoulder.body.carried_at_patient_mm, outer = shoulder.body.center_patient_mm;
    EXPECT_NEAR((shoulder.moved_from_planned * inner - inner).z(), 12.0, 1e-9);
    EXPECT_GT((shoulder.moved_from_planned * outer - outer).z(), 14.0);
  }
  EXPECT_EQ(turn_deg(body_named(phantom, "T8")), 0.0);
}

TEST(PhantomBends, WhatCannotBeIsRefusedByName) {
  const auto refusal = [](Anatomy anatomy, const std::vector<std::string>& bends, const std::string& position = "HFS") {
    try {
      PhantomOptions options = options_of(anatomy, bends);
      options.placement.patient_position = position;
      options.check();
    } catch (const UsageError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  using testing::HasSubstr;
  EXPECT_THAT(refusal(Anatomy::kHead, {"knee"}), HasSubstr("knee: no such bend; there are neck, spine, jaw"));
  EXPECT_THAT(refusal(Anatomy::kSpine, {"jaw"}), HasSubstr("--anatomy head has it"));
  EXPECT_THAT(refusal(Anatomy::kHead, {"neck:40"}), HasSubstr("at most 15 degrees"));
  EXPECT_THAT(refusal(Anatomy::kHead, {"neck:4mm"}), HasSubstr("expected a number"));
  EXPECT_THAT(refusal(Anatomy::kHead, {"neck", "neck:2"}), HasSubstr("given twice"));
  EXPECT_THAT(refusal(Anatomy::kHead, {"missing-couch:3"}), HasSubstr("no amount"));
  EXPECT_THAT(refusal(Anatomy::kHead, {"missing-couch", "extra-couch"}), HasSubstr("together"));
  EXPECT_THAT(refusal(Anatomy::kHead, {"missing-couch"}, "HFP"), HasSubstr("HFP"));
  EXPECT_EQ(refusal(Anatomy::kHead, {"neck:4", "jaw", "weight-loss"}), "");
}

// Center of the only shadow in an image, in pixels.
Vector2d shadow(const Image<float>& intensity) {
  double weights = 0.0;
  Vector2d sum = Vector2d::Zero();
  for (int row = 0; row < intensity.rows; ++row)
    for (int column = 0; column < intensity.columns; ++column) {
      const double absorbed = std::max(0.0, 1.0 - intensity.at(column, row) - 0.01);
      weights += absorbed;
      sum += absorbed * Vector2d(column, row);
    }
  return sum / weights;
}

// The whole way of a vertebra, in closed form: truth.json says where its center lies in the room, a pinhole with the
// source 1000 mm from the isocenter and the panel 1500 mm from the source says where its shadow falls, and a marker
// that was moved with its body must cast it there.
TEST(PhantomBends, TruthOfABodySaysWhereItsMarkerIsSeen) {
  PhantomOptions options = options_of(Anatomy::kSpine, {"spine:8"});
  options.placement.translation_mm = Vector3d(4.3, -6.1, 3.2);
  options.placement.rotation_deg = Vector3d(1.4, -2.1, 1.8);
  options.placement.couch_angle_deg = 0.0;
  options.voxel_mm = 5.0;
  options.image_pixels = 64;
  TemporaryFolder folder;
  write_phantom_study(options, folder.path(), {});
  const nlohmann::json truth = nlohmann::json::parse(std::ifstream(folder / "truth.json"));
  ASSERT_EQ(truth["bends"], nlohmann::json::array({"spine:8"}));
  const BentPhantom phantom = phantom_of(options);
  ASSERT_EQ(truth["bodies"].size(), phantom.bodies.size());
  for (std::size_t n = 0; n < phantom.bodies.size(); ++n) {
    const nlohmann::json& body = truth["bodies"][n];
    if (!phantom.bodies[n].body.is_vertebra) continue;
    Vector3d center, t;
    Matrix3d r;
    for (int row = 0; row < 3; ++row) {
      center[row] = body["center_patient_mm"][row];
      t[row] = body["translation_mm"][row];
      for (int column = 0; column < 3; ++column) r(row, column) = body["rotation_matrix"][row][column];
    }
    // HFS, couch 0: the room's x is the patient's left, y the head, z the front.
    const Vector3d from_isocenter = center - Vector3d(-12.5, 38, -410);
    const Vector3d planned(from_isocenter.x(), from_isocenter.z(), -from_isocenter.y());
    const Vector3d found = r * planned + t;
    Shape marker = make_shape(Shape::Kind::kEllipsoid, center, Vector3d::Constant(2.0), {.bone = 8.0});
    marker.unit_from_patient = marker.unit_from_patient * phantom.bodies[n].moved_from_planned.inverse();
    const Image<float> front =
        simulate_xray({marker}, options.placement, {.gantry_angle_deg = 0, .scatter_share = 0.0}, 0.0, 1);
    const double scale = 1500.0 / (1000.0 - found.z()) / 0.8;
    EXPECT_THAT(shadow(front), VectorNear(Vector2d(255.5 + scale * found.x(), 255.5 - scale * found.y()), 0.05))
        << body["name"];
    const Image<float> side =
        simulate_xray({marker}, options.placement, {.gantry_angle_deg = 90, .scatter_share = 0.0}, 0.0, 1);
    const double side_scale = 1500.0 / (1000.0 - found.x()) / 0.8;
    EXPECT_THAT(shadow(side),
                VectorNear(Vector2d(255.5 - side_scale * found.z(), 255.5 - side_scale * found.y()), 0.05))
        << body["name"];
  }
}

TEST(PhantomBends, PlanNamesTheTargetAtTheIsocenter) {
  PhantomOptions options = options_of(Anatomy::kHead, {"neck:4", "jaw:5"});
  options.voxel_mm = 5.0;
  options.image_pixels = 64;
  TemporaryFolder folder;
  write_phantom_study(options, folder.path(), {});
  const RtStructures structures = read_rt_structures(folder / "RTSTRUCT.dcm");
  const Structure& target = structure_named(structures, "PTV");
  EXPECT_EQ(target.interpreted_type, "PTV");
  Vector3d sum = Vector3d::Zero();
  double points = 0.0;
  for (const Contour& contour : target.contours)
    for (const Vector3d& point : contour.points_patient_mm) {
      sum += point;
      points += 1.0;
    }
  EXPECT_THAT(Vector3d(sum / points), VectorNear(Vector3d(-12.5, 38, -410), 4.0));
  const RtPlan plan = read_rt_plan(folder / "RTPLAN.dcm");
  ASSERT_EQ(plan.dose_references.size(), 1U);
  EXPECT_EQ(plan.dose_references.front().type, "TARGET");
  EXPECT_EQ(plan.dose_references.front().roi_number, target.number);
}

}  // namespace
}  // namespace isoshift::bends_test
