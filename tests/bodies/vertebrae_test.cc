// Vertebrae are found by their discs: each once, its center within 5 mm of where the phantom has it.

#include "bodies/vertebrae.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "bodies/lattice.h"
#include "tests/support/phantom_ct.h"

namespace isoshift::vertebrae_test {
namespace {

struct Count {
  int all = 0, skipped = 0, topmost_skipped = 0, additional = 0;
  double worst_mm = 0.0;
};

// Adds the vertebrae of a phantom that lie within its CT.
void count(const PhantomCt& phantom, Count& count) {
  constexpr double kNearMm = 12.0;  // beyond that it is another vertebra
  const Volume<float> ct = phantom.make();
  const std::vector<Vertebra> found = find_vertebrae(ct, on_patient_axes(ct, 2.0));
  std::vector<Eigen::Vector3d> truth = phantom.vertebrae();
  const Eigen::Affine3d voxel_from_patient = ct.patient_from_voxel.inverse();
  std::erase_if(truth, [&](const Eigen::Vector3d& at) {
    const Eigen::Array3d voxel = (voxel_from_patient * at).array();
    return (voxel < 0.0).any() || (voxel > ct.size.array().cast<double>() - 1.0).any();
  });
  std::ranges::sort(truth, {}, [](const Eigen::Vector3d& at) { return at.z(); });
  std::vector<int> hits(found.size(), 0);
  for (const Eigen::Vector3d& at : truth) {
    ++count.all;
    const auto distance = [&](const Vertebra& vertebra) { return (vertebra.center_patient_mm - at).norm(); };
    const auto nearest = std::ranges::min_element(found, {}, distance);
    if (nearest == found.end() || distance(*nearest) > kNearMm) {
      ++count.skipped;
      if (&at == &truth.back()) ++count.topmost_skipped;
      continue;
    }
    ++hits[static_cast<std::size_t>(nearest - found.begin())];
    count.worst_mm = std::max(count.worst_mm, distance(*nearest));
  }
  // A vertebra of which the CT shows a part may have its center beyond the CT's end.
  for (std::size_t n = 0; n < found.size(); ++n)
    if (hits[n] != 1 && !found[n].is_cut) ++count.additional;
}

void expect_all_found(const Count& count) {
  EXPECT_EQ(count.skipped, 0) << "of " << count.all;
  EXPECT_EQ(count.additional, 0);
  EXPECT_LT(count.worst_mm, 5.0);
}

TEST(Vertebrae, OfTwentySpinesAreAllFound) {
  Count counted;
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
    count({.anatomy = "spine", .seed = seed, .spacing_mm = {2.0, 2.0, 2.5}}, counted);
  expect_all_found(counted);
  EXPECT_EQ(counted.all, 100);
}

TEST(Vertebrae, OfTwentyThoracesAreAllFound) {
  Count counted;
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
    count({.anatomy = "thorax", .seed = seed, .spacing_mm = {2.0, 2.0, 3.0}}, counted);
  expect_all_found(counted);
  EXPECT_EQ(counted.all, 140);
}

// The topmost neck vertebra of this phantom touches the skull, and in some heads is half within it.
TEST(Vertebrae, OfTwentyHeadsAreFoundButSomeThatTouchTheSkull) {
  Count counted;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) count({.anatomy = "head", .seed = seed}, counted);
  EXPECT_EQ(counted.skipped, counted.topmost_skipped);
  EXPECT_LE(counted.topmost_skipped, 8);
  EXPECT_EQ(counted.additional, 0);
  EXPECT_LT(counted.worst_mm, 5.0);
}

TEST(Vertebrae, AreFoundWhateverTheAxesOfTheVoxels) {
  const Eigen::Matrix3d coronal{{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}, backward{{-1, 0, 0}, {0, 1, 0}, {0, 0, -1}};
  const Eigen::Matrix3d oblique = Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 2).normalized()).toRotationMatrix();
  for (const Eigen::Matrix3d& axes : {coronal, backward}) {
    Count counted;
    for (const char* anatomy : {"spine", "thorax"}) count({.anatomy = anatomy, .seed = 4, .axes = axes}, counted);
    expect_all_found(counted);
  }
  Count counted;  // its corners lie outside
  count({.anatomy = "spine", .seed = 4, .axes = oblique}, counted);
  EXPECT_EQ(counted.skipped, 0) << "of " << counted.all;
  EXPECT_LT(counted.worst_mm, 5.0);
}

TEST(Vertebrae, AreFoundInNoiseThickSlicesScoliosisAndBesideScrews) {
  for (const std::uint64_t seed : {2U})
    for (const char* anatomy : {"spine", "thorax"}) {
      const std::string name = std::string(anatomy) + " " + std::to_string(seed);
      const auto check = [&](const char* what, const PhantomCt& phantom) {
        SCOPED_TRACE(name + ", " + what);
        Count counted;
        count(phantom, counted);
        expect_all_found(counted);
      };
      check("noise of 100 HU", {.anatomy = anatomy, .seed = seed, .noise_hu = 100.0});
      check("slices of 5 mm", {.anatomy = anatomy, .seed = seed, .spacing_mm = {1.6, 1.6, 5.0}});
      check("bent sideways by 20 mm", {.anatomy = anatomy, .seed = seed, .curve_mm = 20.0});
      check("with screws", {.anatomy = anatomy, .seed = seed, .has_screws = true});
      check("a short CT", {.anatomy = anatomy, .seed = seed, .cropped_mm = {60.0, 20.0, 70.0}});
    }
}

TEST(Vertebrae, AreNotFoundInAShellOrABlock) {
  const std::vector<Shape> shapes = {make_shape(Shape::Kind::kEllipsoid, {0, 0, 0}, {70, 90, 80}, {.water = 1.0}),
                                     make_shape(Shape::Kind::kBox, {0, 20, 0}, {12, 12, 60}, {.bone = 0.5})};
  Eigen::Affine3d lattice = Eigen::Affine3d::Identity();
  lattice.linear() *= 2.0;
  lattice.translation().setConstant(-99.0);
  const Volume<float> ct = ct_of_shapes(shapes, {100, 100, 100}, lattice);
  EXPECT_TRUE(find_vertebrae(ct, on_patient_axes(ct, 2.0)).empty());
  const Volume<float> air({20, 20, 20}, lattice, -1000.0F);
  EXPECT_TRUE(find_vertebrae(air, on_patient_axes(air, 2.0)).empty());
}

}  // namespace
}  // namespace isoshift::vertebrae_test
