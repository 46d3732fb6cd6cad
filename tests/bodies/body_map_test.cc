// Bodies: what is one, what joins what.

#include "bodies/body_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "bodies/components.h"
#include "bodies/distance.h"
#include "tests/support/phantom_ct.h"

namespace isoshift::body_map_test {
namespace {

Eigen::Affine3d lattice_of(double edge_mm) {
  Eigen::Affine3d lattice = Eigen::Affine3d::Identity();
  lattice.linear() *= edge_mm;
  return lattice;
}

TEST(Distance, IsThatToTheNearestVoxelInEveryDirection) {
  Volume<std::uint8_t> mask({15, 12, 10}, lattice_of(2.0));
  const std::vector<Eigen::Vector3i> targets = {{3, 4, 5}, {12, 1, 8}, {7, 11, 0}};
  for (const Eigen::Vector3i& at : targets) mask.at(at.x(), at.y(), at.z()) = 1;
  const Volume<float> distance = distance_mm(mask);
  for (int k = 0; k < 10; ++k)
    for (int j = 0; j < 12; ++j)
      for (int i = 0; i < 15; ++i) {
        double least = 1e9;
        for (const Eigen::Vector3i& at : targets)
          least = std::min(least, 2.0 * (at - Eigen::Vector3i(i, j, k)).cast<double>().norm());
        ASSERT_NEAR(distance.at(i, j, k), least, 1e-4);
      }
}

TEST(Components, TwoBallsThatTouchArePartsWithANeckBetween) {
  Volume<std::uint8_t> outside({60, 30, 30}, lattice_of(2.0));
  for (int k = 0; k < 30; ++k)
    for (int j = 0; j < 30; ++j)
      for (int i = 0; i < 60; ++i) {
        const Eigen::Vector3d at(i, j, k);
        const bool inside =
            (at - Eigen::Vector3d(18, 15, 15)).norm() < 12 || (at - Eigen::Vector3d(40, 15, 15)).norm() < 12;
        outside.at(i, j, k) = inside ? 0 : 1;
      }
  Volume<std::uint8_t> inside = outside;
  for (std::uint8_t& value : inside.voxels) value = 1 - value;
  EXPECT_EQ(connected_parts(inside, 1).size(), 1U);
  EXPECT_EQ(parts_between_necks(distance_mm(outside), 3.0).size(), 2U);
}

class BodiesOfAThorax : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    ct_ = new Volume<float>(PhantomCt{.anatomy = "thorax", .seed = 5, .spacing_mm = {2, 2, 3}}.make());
    map_ = new BodyMap(find_bodies(*ct_));
  }
  static void TearDownTestSuite() {
    delete map_;
    delete ct_;
  }
  static const BodyMap& map() { return *map_; }
  static const Volume<float>& ct() { return *ct_; }

 private:
  static inline Volume<float>* ct_ = nullptr;
  static inline BodyMap* map_ = nullptr;
};

TEST_F(BodiesOfAThorax, AreVertebraeFromTheFeetToTheHeadAndRibs) {
  ASSERT_GE(map().bodies.size(), 9U);
  for (std::size_t n = 0; n < 7; ++n) {
    EXPECT_EQ(map().bodies[n].kind, Body::Kind::kVertebra);
    if (n > 0) {
      EXPECT_GT(map().bodies[n].center_patient_mm.z(), map().bodies[n - 1].center_patient_mm.z());
    }
  }
  EXPECT_TRUE(std::ranges::any_of(map().bodies, [](const Body& body) { return body.kind == Body::Kind::kRib; }));
}

TEST_F(BodiesOfAThorax, NeighboringVertebraeAreJoinedAtTheirDisc) {
  for (int n = 0; n + 1 < 7; ++n) {
    const auto joint = std::ranges::find_if(map().joints, [&](const Joint& j) { return j.a == n && j.b == n + 1; });
    ASSERT_NE(joint, map().joints.end());
    EXPECT_FALSE(joint->is_stiff);
    const Eigen::Vector3d middle = 0.5 * (map().bodies[n].center_patient_mm + map().bodies[n + 1].center_patient_mm);
    EXPECT_LT((joint->at_patient_mm - middle).norm(), 6.0);
  }
}

TEST_F(BodiesOfAThorax, PiecesOfBonesAreAtMost80MmLong) {
  for (const Body& body : map().bodies)
    if (body.kind == Body::Kind::kBone || body.kind == Body::Kind::kRib) {
      EXPECT_LE(body.box_patient_mm.sizes().maxCoeff(), 80.0);
    }
}

TEST_F(BodiesOfAThorax, LabelsAndBodiesAgree) {
  std::vector<std::size_t> counts(256, 0);
  for (const std::uint8_t label : map().labels.voxels) ++counts[label];
  const double voxel_mm3 = map().labels.patient_from_voxel.linear().determinant();
  for (std::size_t n = 0; n < map().bodies.size(); ++n)
    EXPECT_NEAR(map().bodies[n].volume_mm3, static_cast<double>(counts[n + 1]) * voxel_mm3, 1e-6);
  for (const Joint& joint : map().joints) {
    EXPECT_LT(joint.a, joint.b);
    EXPECT_LT(joint.b, static_cast<int>(map().bodies.size()));
  }
}

TEST_F(BodiesOfAThorax, AreTheSameEveryTime) {
  const BodyMap again = find_bodies(ct());
  EXPECT_EQ(again.labels.voxels, map().labels.voxels);
  EXPECT_EQ(again.bodies.size(), map().bodies.size());
}

TEST_F(BodiesOfAThorax, ADrawnBoneIsABodyWithItsName) {
  Volume<std::uint8_t> drawn(ct().size, ct().patient_from_voxel);
  const Eigen::Vector3d middle = map().bodies[8].center_patient_mm;
  for (int k = 0; k < drawn.size.z(); ++k)
    for (int j = 0; j < drawn.size.y(); ++j)
      for (int i = 0; i < drawn.size.x(); ++i)
        drawn.at(i, j, k) = (drawn.patient_from_voxel * Eigen::Vector3d(i, j, k) - middle).norm() < 20.0 ? 1 : 0;
  const std::vector<DrawnBone> bones = {{"Rib_7", drawn}};
  const BodyMap with = find_bodies(ct(), bones);
  const auto named = std::ranges::find(with.bodies, "Rib_7", &Body::name);
  ASSERT_NE(named, with.bodies.end());
  EXPECT_LT((named->center_patient_mm - middle).norm(), 2.0);
  EXPECT_NEAR(named->volume_mm3, 4.0 / 3.0 * M_PI * 8000.0, 2000.0);
}

// The bones of two neighboring vertebrae as found, drawn by a person: nothing else of them is left, and no body is
// added.
TEST_F(BodiesOfAThorax, DrawnVertebraeReplaceTheFoundOnes) {
  std::vector<DrawnBone> bones;
  for (const int number : {2, 3}) {
    Volume<std::uint8_t> drawn(map().labels.size, map().labels.patient_from_voxel);
    for (std::size_t n = 0; n < drawn.voxels.size(); ++n) drawn.voxels[n] = map().labels.voxels[n] == number ? 1 : 0;
    const Body& body = map().bodies[static_cast<std::size_t>(number - 1)];
    ASSERT_EQ(body.kind, Body::Kind::kVertebra);
    // A body of its own around the center, as TG-263 has VB_T9: without the arch.
    for (int k = 0; k < drawn.size.z(); ++k)
      for (int j = 0; j < drawn.size.y(); ++j)
        for (int i = 0; i < drawn.size.x(); ++i) {
          const double away_mm = (drawn.patient_from_voxel * Eigen::Vector3d(i, j, k) - body.center_patient_mm).norm();
          if (away_mm < 8.0) drawn.at(i, j, k) = 1;
          if (away_mm > 18.0) drawn.at(i, j, k) = 0;
        }
    bones.push_back({number == 2 ? "vertebrae_T9" : "VB_T8", drawn});
  }
  const BodyMap with = find_bodies(ct(), bones);
  EXPECT_EQ(with.bodies.size(), map().bodies.size());
  EXPECT_EQ(with.bodies[1].name, "vertebrae_T9");
  EXPECT_EQ(with.bodies[2].name, "VB_T8");
  EXPECT_EQ(with.bodies[2].kind, Body::Kind::kVertebra);
  for (const char* found : {"vertebra 2", "vertebra 3"})
    EXPECT_EQ(std::ranges::find(with.bodies, found, &Body::name), with.bodies.end());
}

TEST(Bodies, ACouchApartFromThePatientIsABodyOfItsOwn) {
  const std::vector<Shape> shapes = {make_shape(Shape::Kind::kEllipsoid, {0, 0, 0}, {80, 60, 200}, {.water = 1.0}),
                                     make_shape(Shape::Kind::kCylinder, {0, 10, 0}, {12, 12, 200}, {.bone = 0.5}),
                                     make_shape(Shape::Kind::kBox, {0, 85, 0}, {90, 2, 200}, {.water = 1.0}),
                                     make_shape(Shape::Kind::kBox, {85, 80, 0}, {2, 10, 200}, {.water = 1.2})};
  Eigen::Affine3d lattice = lattice_of(2.0);
  lattice.translation() << -99.0, -99.0, -60.0;
  const BodyMap map = find_bodies(ct_of_shapes(shapes, {100, 100, 60}, lattice));
  ASSERT_FALSE(map.bodies.empty());
  EXPECT_EQ(map.bodies.back().kind, Body::Kind::kCouch);
  EXPECT_EQ(map.bodies.back().name, "couch");
  EXPECT_GT(map.bodies.back().center_patient_mm.y(), 70.0);
  for (const Joint& joint : map.joints) EXPECT_LT(joint.b + 1, static_cast<int>(map.bodies.size()));
}

TEST(Bodies, OfACtOfAirAreNone) {
  EXPECT_TRUE(find_bodies(Volume<float>({10, 10, 10}, lattice_of(2.0), -1000.0F)).bodies.empty());
}

}  // namespace
}  // namespace isoshift::body_map_test
