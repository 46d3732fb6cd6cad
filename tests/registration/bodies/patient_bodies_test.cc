// The bodies of a search: made from those that a CT shows, without anything lost or counted twice.

#include "registration/bodies/patient_bodies.h"

#include <gtest/gtest.h>

#include "registration/bodies/carriers.h"

namespace isoshift::patient_bodies_test {
namespace {

using Eigen::Vector3d;

// A spine of three vertebrae, 30 mm apart, in the middle of a box of soft tissue; a rib on each side and one in front,
// and a couch. Voxels of 2 mm; the middle vertebra lies at the origin.
BodyMap small_trunk(bool has_spinous_process = false) {
  BodyMap map;
  map.labels = Volume<std::uint8_t>({120, 120, 60}, Eigen::Affine3d(Eigen::Translation3d(-119.0, -159.0, -59.0) *
                                                                    Eigen::Scaling(Vector3d::Constant(2.0))));
  const auto add = [&](Body::Kind kind, const Vector3d& center, const Vector3d& half) {
    Body& body = map.bodies.emplace_back();
    body.kind = kind;
    body.center_patient_mm = center;
    body.volume_mm3 = 8.0 * half.prod();
    for (int k = 0; k < map.labels.size.z(); ++k)
      for (int j = 0; j < map.labels.size.y(); ++j)
        for (int i = 0; i < map.labels.size.x(); ++i) {
          const Vector3d from = map.labels.patient_from_voxel * Vector3d(i, j, k) - center;
          if ((from.cwiseAbs().array() <= half.array()).all())
            map.labels.at(i, j, k) = static_cast<std::uint8_t>(map.bodies.size());
        }
  };
  for (const double z : {-30.0, 0.0, 30.0}) add(Body::Kind::kVertebra, {0, 0, z}, {18, 15, 12});
  add(Body::Kind::kRib, {60, 0, 0}, {20, 5, 5});
  add(Body::Kind::kRib, {-60, 0, 0}, {20, 5, 5});
  add(Body::Kind::kRib, {0, -120, 0}, {40, 5, 5});
  if (has_spinous_process) add(Body::Kind::kBone, {4, 40, -6}, {3, 12, 8});
  add(Body::Kind::kCouch, {0, 70, 0}, {100, 4, 58});
  return map;
}

PatientBodies small_patient(const Vector3d& target) {
  const BodyMap map = small_trunk();
  return patient_bodies(map, soft_masks(map), target);
}

Target target_at(const Vector3d& room_mm, double radius_mm) {
  Target target{.name = "PTV", .chosen_by = "a test", .center_room_mm = room_mm};
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-radius_mm, radius_mm})
      target.extent_room_mm.push_back(room_mm + side * Vector3d::Unit(axis));
  return target;
}

TEST(PatientBodies, DivideTheCtWithoutRest) {
  const PatientBodies patient = small_patient({0, 0, 0});
  for (const std::vector<BodyShare>& shares : {patient.bodies.shares, patient.carried})
    for (std::size_t voxel = 0; voxel < shares.front().voxels.size(); ++voxel) {
      int sum = 0;
      for (const BodyShare& share : shares) sum += share.voxels[voxel];
      ASSERT_EQ(sum, 255) << "voxel " << voxel;
    }
}

TEST(PatientBodies, AreNamedFromTheTarget) {
  const PatientBodies patient = small_patient({0, 0, 28});
  ASSERT_GE(patient.bodies.bodies.size(), 6U);
  EXPECT_EQ(patient.bodies.bodies[0].name, "vertebra 2 toward the feet");
  EXPECT_EQ(patient.bodies.bodies[1].name, "vertebra 1 toward the feet");
  EXPECT_EQ(patient.bodies.bodies[2].name, "vertebra nearest to the target");
  std::size_t breathing_bones = 0, soft = 0;
  for (const JointedBodies::Body& body : patient.bodies.bodies) {
    EXPECT_TRUE(body.breathes || !body.is_soft) << body.name;
    soft += body.is_soft ? 1 : 0;
    breathing_bones += body.breathes && !body.is_soft ? 1 : 0;
  }
  EXPECT_EQ(breathing_bones, 1U) << "the rib in front";
  EXPECT_GE(soft, 2U);
}

// Where its arch is too thin to be seen, it would else be one of the bones beside the spine.
TEST(PatientBodies, ASpinousProcessGoesWithItsVertebra) {
  const BodyMap map = small_trunk(true);
  const PatientBodies patient = patient_bodies(map, soft_masks(map), {0, 0, 0});
  EXPECT_EQ(patient.bodies.bodies.size(), small_patient({0, 0, 0}).bodies.bodies.size());
  EXPECT_GT(shares_at(patient.carried, {4, 40, -6})[1], 0.99);
}

// Whatever moves is held by something: no body floats without a spring.
TEST(PatientBodies, AllHangTogether) {
  const PatientBodies patient = small_patient({0, 0, 0});
  std::vector<bool> reached(patient.bodies.bodies.size());
  reached[0] = true;
  for (std::size_t round = 0; round < reached.size(); ++round)
    for (const JointedBodies::Spring& spring : patient.bodies.springs)
      if (reached[spring.a] || reached[spring.b]) reached[spring.a] = reached[spring.b] = true;
  for (std::size_t body = 0; body < reached.size(); ++body)
    EXPECT_TRUE(reached[body]) << patient.bodies.bodies[body].name;
}

TEST(Carriers, AreTheBonesNearTheTarget) {
  const PatientBodies patient = small_patient({0, 0, 0});
  const Eigen::Isometry3d planned = Eigen::Isometry3d::Identity();
  const Carriers in_vertebra(patient, target_at({0, 0, 0}, 10.0), planned, {});
  ASSERT_TRUE(in_vertebra.exist());
  EXPECT_GT(in_vertebra.shares()[1], 0.95);
  // Between two vertebrae both carry.
  const Carriers between(patient, target_at({0, 0, 15}, 8.0), planned, {});
  ASSERT_TRUE(between.exist());
  EXPECT_NEAR(between.shares()[1], 0.5, 0.15);
  EXPECT_NEAR(between.shares()[2], 0.5, 0.15);
  // In soft tissue far from every bone there are none, and near the surface of a large target there are.
  EXPECT_FALSE(Carriers(patient, target_at({40, -60, 0}, 10.0), planned, {}).exist());
  EXPECT_TRUE(Carriers(patient, target_at({0, -60, 0}, 40.0), planned, {}).exist());
  double sum = 0.0;
  for (const double share : between.shares()) sum += share;
  EXPECT_NEAR(sum, 1.0, 1e-9);
}

// A person may name what carries a target, however far it lies.
TEST(Carriers, AreTheBonesInAStructureThatIsNamed) {
  PatientBodies patient = small_patient({0, 0, 0});
  const auto box = [&](const Vector3d& center, double half_mm) {
    Volume<std::uint8_t> mask({120, 120, 60}, small_trunk().labels.patient_from_voxel);
    for (int k = 0; k < mask.size.z(); ++k)
      for (int j = 0; j < mask.size.y(); ++j)
        for (int i = 0; i < mask.size.x(); ++i) {
          const Vector3d from = mask.patient_from_voxel * Vector3d(i, j, k) - center;
          mask.at(i, j, k) = from.cwiseAbs().maxCoeff() <= half_mm ? 1 : 0;
        }
    return mask;
  };
  patient.named_carriers = shares_of_bone_in(patient, box({0, 0, 15}, 30.0));
  ASSERT_EQ(patient.named_carriers.size(), patient.bodies.bodies.size());
  const Carriers named(patient, target_at({40, -60, 0}, 10.0), Eigen::Isometry3d::Identity(), patient.named_carriers);
  ASSERT_TRUE(named.exist()) << "no bone is near, and none need be";
  EXPECT_NEAR(named.shares()[1], 0.5, 0.1);
  EXPECT_NEAR(named.shares()[2], 0.5, 0.1);
  EXPECT_TRUE(shares_of_bone_in(patient, box({40, -60, 0}, 10.0)).empty()) << "soft tissue";
}

TEST(Carriers, MoveTheTargetAsTheyMove) {
  const PatientBodies patient = small_patient({0, 0, 0});
  const Eigen::Isometry3d planned = Eigen::Isometry3d::Identity();
  const Carriers carriers(patient, target_at({0, 0, 0}, 10.0), planned, {});
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = Eigen::AngleAxisd(0.05, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  motion.translation() = Vector3d(3, -4, 5);
  BodyPoses poses;
  const std::size_t bodies = patient.bodies.bodies.size();
  poses.assign(bodies, {motion, motion});
  const auto parameters = static_cast<Eigen::Index>(6 * bodies);
  const BodyCertainty certainty{.covariance = Eigen::MatrixXd::Identity(parameters, parameters),
                                .covariance_on_loose_springs = Eigen::MatrixXd::Identity(parameters, parameters),
                                .motions_left = Eigen::VectorXd::Zero(parameters)};
  const CarriedTarget rigid = carriers.target_at(poses, certainty);
  EXPECT_LT((rigid.setup_error.matrix() - motion.matrix()).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT(rigid.deformation_mm, 1e-9);
  // The vertebra in which the target lies turns alone: the target's center goes with it, its surface mostly.
  poses[1] = {motion * Eigen::Translation3d(0, 2, 0), motion};
  const CarriedTarget bent = carriers.target_at(poses, certainty);
  const Vector3d center = bent.setup_error * Vector3d::Zero();
  EXPECT_LT((center - motion * Vector3d(0, 2, 0)).norm(), 0.1);
  // Against the rigid motion it is 2 mm off, brought back to where it was planned.
  const Carriers::Off off = carriers.off_from(motion, poses);
  EXPECT_LT((off.center_mm - Vector3d(0, 2, 0)).norm(), 0.1);
  EXPECT_GE(off.most_mm, off.center_mm.norm() - 0.1);
}

}  // namespace
}  // namespace isoshift::patient_bodies_test
