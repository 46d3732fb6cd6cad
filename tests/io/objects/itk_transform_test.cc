#include "io/objects/itk_transform.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <vector>

#include "base/error.h"
#include "geometry/rotation.h"
#include "tests/support/command.h"
#include "tests/support/pose_near.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::itk_transform_test {
namespace {

using testing::HasSubstr;

class ItkTransform : public testing::Test {
 protected:
  ItkTransform() {
    pose_.linear() = rotation_from_zxy({.z_rad = 0.3, .x_rad = -0.2, .y_rad = 0.1});
    pose_.translation() = Eigen::Vector3d(12.25, -3.5, 1e-3);
  }
  Eigen::Isometry3d read(const std::string& text) const {
    std::ofstream(path()) << text;
    return read_itk_transform(path());
  }
  Eigen::Isometry3d read(const std::string& kind, const std::string& parameters, const std::string& fixed) const {
    return read(
        fmt::format("#Insight Transform File V1.0\n#Transform 0\nTransform: {}_double_3_3\nParameters: {}\n"
                    "FixedParameters: {}\n",
                    kind, parameters, fixed));
  }
  std::string refusal(const std::string& text) const {
    try {
      read(text);
    } catch (const Error& error) {
      return error.what();
    }
    return "read";
  }
  std::filesystem::path path() const { return folder_ / "a.tfm"; }

  Eigen::Isometry3d pose_ = Eigen::Isometry3d::Identity();
  TemporaryFolder folder_;
};

TEST_F(ItkTransform, OnesOwnIsReadAsItWas) {
  EXPECT_TRUE(read(itk_transform(pose_)).matrix() == pose_.matrix());
  EXPECT_TRUE(is_itk_transform(path()));
  std::ofstream(path()) << "{}";
  EXPECT_FALSE(is_itk_transform(path()));
}

// y = R (x - c) + c + t: the numbers of the file, by hand. The point (1, 2, 3) turned by 90 degrees about z at (10, 0,
// 0).
TEST_F(ItkTransform, EveryKindIsReadAboutItsCenter) {
  const auto moved = [&](const std::string& kind, const std::string& parameters, const std::string& fixed) {
    return Eigen::Vector3d(read(kind, parameters, fixed) * Eigen::Vector3d(1, 2, 3));
  };
  const Eigen::Vector3d expected(8 + 5, -9 + 6, 3 + 7);
  EXPECT_THAT(moved("AffineTransform", "0 -1 0 1 0 0 0 0 1 5 6 7", "10 0 0"), VectorNear(expected, 1e-12));
  EXPECT_THAT(moved("MatrixOffsetTransformBase", "0 -1 0 1 0 0 0 0 1 5 6 7", "10 0 0"), VectorNear(expected, 1e-12));
  EXPECT_THAT(moved("Euler3DTransform", "0 0 1.5707963267948966 5 6 7", "10 0 0 0"), VectorNear(expected, 1e-12));
  EXPECT_THAT(moved("VersorRigid3DTransform", "0 0 0.7071067811865476 5 6 7", "10 0 0"), VectorNear(expected, 1e-12));
  EXPECT_THAT(moved("TranslationTransform", "5 6 7", ""), VectorNear(Eigen::Vector3d(6, 8, 10), 1e-12));
}

TEST_F(ItkTransform, EulerAnglesHaveTheOrderThatTheFileSays) {
  const Eigen::Matrix3d zxy = read("Euler3DTransform", "0.3 0.2 0.1 0 0 0", "0 0 0 0").linear();
  EXPECT_TRUE(zxy.isApprox(rotation_z(0.1) * rotation_x(0.3) * rotation_y(0.2)));
  const Eigen::Matrix3d zyx = read("Euler3DTransform", "0.3 0.2 0.1 0 0 0", "0 0 0 1").linear();
  EXPECT_TRUE(zyx.isApprox(rotation_z(0.1) * rotation_y(0.2) * rotation_x(0.3)));
}

TEST_F(ItkTransform, WhatIsNoRigidTransformIsNamed) {
  const std::string first = "#Insight Transform File V1.0\n";
  EXPECT_THAT(refusal(first), HasSubstr("a.tfm: holds no transform"));
  EXPECT_THAT(refusal(itk_transform(pose_) + itk_transform(pose_)), HasSubstr("a.tfm: holds several transforms"));
  EXPECT_THAT(refusal(itk_transform(pose_) + "Parameters: 1 0 0 0 1 0 0 0 1 0 0 0\n"),
              HasSubstr("a.tfm: has two lines of Parameters, expected one"));
  EXPECT_THAT(refusal(itk_transform(pose_) + "FixedParameters: 1 2 3\n"),
              HasSubstr("a.tfm: has two lines of FixedParameters, expected one"));
  EXPECT_THAT(refusal(first + "Transform: BSplineTransform_double_3_3\nParameters: 1\n"),
              HasSubstr("a.tfm: is a BSplineTransform, expected a rigid transform"));
  EXPECT_THAT(refusal(first + "Transform: AffineTransform_double_3_3\nParameters: 1 2 x\n"),
              HasSubstr("a.tfm: Parameters: holds \"x\", which is not a finite number"));
  EXPECT_THAT(refusal(first + "Transform: AffineTransform_double_3_3\nParameters: 1 2\n"),
              HasSubstr("a.tfm: AffineTransform has 2 parameters, expected 12"));
  EXPECT_THAT(refusal(first + "Transform: TranslationTransform_double_3_3\nParameters: 1 2 3\nFixedParameters: 1 2\n"),
              HasSubstr("a.tfm: has 2 FixedParameters, expected the 3 of a center"));
  EXPECT_THAT(refusal(first + "Transform: AffineTransform_double_3_3\nParameters: 2 0 0 0 2 0 0 0 2 0 0 0\n"),
              HasSubstr("a.tfm: is not rigid"));
}

constexpr int kEdge = 40;  // voxels of 1 mm, from (-20, -20, -20) mm on

// An image that is brightest at a point.
void write_blob(const std::filesystem::path& path, const Eigen::Vector3d& at_mm) {
  std::ofstream file(path, std::ios::binary);
  file << fmt::format(
      "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nOffset = -20 -20 -20\n"
      "ElementSpacing = 1 1 1\nDimSize = {0} {0} {0}\nElementType = MET_FLOAT\nElementDataFile = LOCAL\n",
      kEdge);
  for (int k = 0; k < kEdge; ++k)
    for (int j = 0; j < kEdge; ++j)
      for (int i = 0; i < kEdge; ++i) {
        const auto value = static_cast<float>(
            1000.0 * std::exp(-(Eigen::Vector3d(i - 20, j - 20, k - 20) - at_mm).squaredNorm() / 18.0));
        file.write(reinterpret_cast<const char*>(&value), sizeof value);
      }
}

// The center of its brightness.
Eigen::Vector3d blob_in(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::vector<float> voxels(kEdge * kEdge * kEdge);
  file.seekg(-static_cast<std::streamoff>(voxels.size() * sizeof(float)), std::ios::end);
  file.read(reinterpret_cast<char*>(voxels.data()), static_cast<std::streamsize>(voxels.size() * sizeof(float)));
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double weight = 0.0;
  for (int n = 0; n < static_cast<int>(voxels.size()); ++n) {
    const double value = voxels[static_cast<std::size_t>(n)];
    sum += value * Eigen::Vector3d(n % kEdge - 20, n / kEdge % kEdge - 20, n / kEdge / kEdge - 20);
    weight += value;
  }
  return sum / weight;
}

// plastimatch reads what we write, by ITK's own reader, writes the same, and shows anatomy of the moving image at q
// where we say it lies in the fixed one.
TEST_F(ItkTransform, PlastimatchMeansTheSame) {
  std::ofstream(path()) << itk_transform(pose_);
  const Eigen::Vector3d in_fixed(-4, 3, 6), in_moving = pose_ * in_fixed;
  write_blob(folder_ / "moving.mha", in_moving);
  const CommandOutcome outcome = run_shell(
      fmt::format("cd '{}' && plastimatch xf-convert --input a.tfm --output b.tfm && "
                  "plastimatch warp --input moving.mha --xf a.tfm --output-img warped.mha --output-type float",
                  folder_.path().string()));
  ASSERT_EQ(outcome.exit_status, 0) << outcome.out;
  EXPECT_THAT(read_itk_transform(folder_ / "b.tfm"), PoseNear(pose_, 1e-9, 1e-9));
  EXPECT_THAT(blob_in(folder_ / "warped.mha"), VectorNear(in_fixed, 0.1));
  EXPECT_GT((in_moving - in_fixed).norm(), 10.0);
}

}  // namespace
}  // namespace isoshift::itk_transform_test
