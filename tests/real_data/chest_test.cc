// The thorax of a patient with a structure set by another program (tests/real_data/README.md).

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "geometry/mask.h"
#include "io/dicom/structure_mask.h"
#include "io/study/study.h"
#include "tests/support/real_data.h"

namespace isoshift::chest_test {
namespace {

const std::filesystem::path kChest = real_data() / "chest";

// "Spine" is a cylinder of 35 mm radius, drawn as a polygon of 48 corners on each of the 133 slices, 2.5 mm apart.
constexpr double kHeightMm = 133 * 2.5;

double volume_mm3(const Volume<std::uint8_t>& mask) {
  return static_cast<double>(std::ranges::count(mask.voxels, 1)) *
         std::abs(mask.patient_from_voxel.linear().determinant());
}

TEST(Chest, TheSpineIsTheCylinderThatWasDrawn) {
  ISOSHIFT_NEED_REAL_DATA("chest/chest-still");
  Notes notes;
  StudyRequest request;
  request.parts = {.study = kChest / "chest-still", .ct = {kChest / "CT"}, .images = {}, .plan = {}};
  const Study study = load_study(request, notes, {});
  ASSERT_TRUE(study.structures);
  const Structure& spine = structure_named(*study.structures, "spine");
  EXPECT_EQ(spine.name, "Spine");
  EXPECT_EQ(spine.interpreted_type, "ORGAN");
  EXPECT_EQ(spine.contours.size(), 133U);

  const auto mask = mask_of(spine, study.ct->hu.size, study.ct->hu.patient_from_voxel);
  const double polygon_mm2 = 24.0 * 35.0 * 35.0 * std::sin(2.0 * M_PI / 48.0);
  EXPECT_NEAR(volume_mm3(mask), polygon_mm2 * kHeightMm, 0.003 * polygon_mm2 * kHeightMm);
  EXPECT_NEAR(volume_mm3(mask), M_PI * 35.0 * 35.0 * kHeightMm, 0.01 * M_PI * 35.0 * 35.0 * kHeightMm);
  // It goes through the whole CT, so a margin makes it wider and no longer.
  EXPECT_NEAR(volume_mm3(dilated(mask, 10.0)), M_PI * 45.0 * 45.0 * kHeightMm, 0.03 * M_PI * 45.0 * 45.0 * kHeightMm);
}

}  // namespace
}  // namespace isoshift::chest_test
