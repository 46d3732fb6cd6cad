// Bodies of CTs of people and of a plastic head (tests/real_data/README.md).

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "bodies/body_map.h"
#include "io/dicom/ct_series.h"
#include "io/study/study_files.h"
#include "tests/support/real_data.h"

namespace isoshift::bodies_test {
namespace {

CtSeries ct_in(const std::filesystem::path& folder) {
  Notes notes;
  const StudyFiles files = scan_study({folder});
  return read_ct_series(files.cts.front().files, {}, notes, {});
}

// Seen by eye on sagittal and coronal sections through the spine: the middle between the discs, and between the front
// and back of the vertebral bodies, to about 2 mm. The patient's back is bent forward at the top and, worn, to the side
// at the bottom.
TEST(BodiesOfAChest, AreAllItsVertebraeWhereAPersonSeesThem) {
  ISOSHIFT_NEED_REAL_DATA("chest/CT");
  const std::array<Eigen::Vector3d, 17> seen = {{
      {25, 17, -338},
      {25, 27, -309},
      {22, 38, -281},
      {18, 49, -254},
      {13, 60, -229},
      {7, 68, -205},
      {4, 72, -184},
      {2, 75, -162},
      {1, 76, -141},
      {0, 73, -121},
      {0, 66, -102},
      {0, 57, -84},
      {-1, 46, -68},
      {-2, 34, -53},
      {-4, 21, -39},
      {-5, 9, -26},
      {-6, -3, -10},
  }};
  const BodyMap map = find_bodies(ct_in(real_data() / "chest" / "CT").hu);
  const auto vertebrae = std::ranges::count(map.bodies, Body::Kind::kVertebra, &Body::kind);
  ASSERT_EQ(vertebrae, std::ssize(seen));
  for (std::size_t n = 0; n < seen.size(); ++n)
    EXPECT_LT((map.bodies[n].center_patient_mm - seen[n]).norm(), 5.0)
        << "vertebra " << n + 1 << " at " << map.bodies[n].center_patient_mm.transpose();
}

TEST(BodiesOfAChest, HoldNoHeartAndNoAorta) {
  ISOSHIFT_NEED_REAL_DATA("chest/CT");
  const BodyMap map = find_bodies(ct_in(real_data() / "chest" / "CT").hu);
  const Eigen::Affine3d voxel_from_patient = map.labels.patient_from_voxel.inverse();
  // The descending aorta, the left atrium, the root of the aorta and the superior vena cava, as seen in the slice at
  // z = -172: bright with contrast agent.
  for (const Eigen::Vector3d& at : {Eigen::Vector3d(23, 56, -172), Eigen::Vector3d(19, 14, -172),
                                    Eigen::Vector3d(24, -24, -172), Eigen::Vector3d(-5, -16, -172)}) {
    const Eigen::Vector3i voxel = (voxel_from_patient * at).array().round().cast<int>();
    EXPECT_EQ(map.labels.at(voxel.x(), voxel.y(), voxel.z()), 0) << at.transpose();
  }
}

TEST(BodiesOfAPlasticHead, AreBonesWithoutVertebrae) {
  ISOSHIFT_NEED_REAL_DATA("head/CT");
  const BodyMap map = find_bodies(ct_in(real_data() / "head" / "CT").hu);
  EXPECT_GT(map.bodies.size(), 5U);
  EXPECT_EQ(std::ranges::count(map.bodies, Body::Kind::kVertebra, &Body::kind), 0);
}

}  // namespace
}  // namespace isoshift::bodies_test
