// Vertebrae look alike: a search that begins between two of them ends at the right one.

#include "registration/bodies/target_search.h"

#include <gtest/gtest.h>

#include "tests/support/bent_scene.h"

namespace isoshift::target_search_test {
namespace {

using Eigen::Vector3d;

constexpr double kVertebraMm = 36.0;  // from one of the column to the next

struct Column {
  BentScene scene = bent_column({{.translation_mm = {1.0, -1.0, 1.0}, .rotation_deg = {-2.0, 0.0, 0.5}},
                                 {.translation_mm = {1.0, -1.0, 0.5}, .rotation_deg = {-0.5, 0.5, 0.0}},
                                 {.translation_mm = {1.5, -1.0, 0.0}, .rotation_deg = {1.5, -1.0, 0.5}}});
  PatientBodies patient;
  Target target{.name = "PTV"};

  explicit Column(bool has_vertebrae) {
    for (std::size_t n = 0; n < scene.bodies.bodies.size(); ++n) {
      scene.bodies.bodies[n].is_vertebra = has_vertebrae;
      scene.bodies.bodies[n].vertebra = static_cast<int>(n) - 1;
    }
    patient.bodies = scene.bodies;
    patient.carried = scene.bodies.shares;
    patient.to_bone_mm = Volume<float>(scene.ct.size, scene.ct.patient_from_voxel);
  }

  Carriers carriers() const { return Carriers(patient, target, scene.planned, {}); }

  // With the whole found too far toward the patient's head.
  TargetSearchResult searched_from(double too_far_mm) const {
    const SearchableScene searchable(scene, patient.bodies, scene.planned * Eigen::Translation3d(0.0, 0.0, too_far_mm));
    return search_target(searchable.get(), carriers(), {}, {});
  }

  double error_mm(const TargetSearchResult& found) const {
    return (carriers().setup_error_at(found.poses) * Vector3d::Zero() - scene.truth[1] * Vector3d::Zero()).norm();
  }
};

TEST(TargetSearch, EndsAtTheRightVertebra) {
  const Column column(true);
  for (const double too_far_mm : {0.0, -0.5 * kVertebraMm, kVertebraMm}) {
    const TargetSearchResult found = column.searched_from(too_far_mm);
    EXPECT_LT(column.error_mm(found), 1.0) << "begun " << too_far_mm << " mm off";
    EXPECT_EQ(found.stages.size(), BodySearchOptions().stages.size());
    // What ended elsewhere is told, and told apart.
    for (const Alternative& other : found.alternatives) {
      EXPECT_GT(other.distance_mm, 1.0) << other.description;
      EXPECT_TRUE(other.is_ruled_out) << other.description;
      EXPECT_LT(other.similarity, other.as_is) << other.description;
    }
  }
}

// Only of vertebrae is it known where the next one lies: from one of them off, other bones are not found.
TEST(TargetSearch, BeginsElsewhereOnlyAlongTheSpine) {
  const Column column(false);
  const TargetSearchResult found = column.searched_from(kVertebraMm);
  EXPECT_GT(column.error_mm(found), 10.0);
  EXPECT_TRUE(found.alternatives.empty());
}

}  // namespace
}  // namespace isoshift::target_search_test
