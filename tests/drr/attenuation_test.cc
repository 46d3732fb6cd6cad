#include "drr/attenuation.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace isoshift::attenuation_test {
namespace {

TEST(Attenuation, PhysicalCurveIsThatOfAlgorithmsMd) {
  AttenuationModel model;
  EXPECT_FLOAT_EQ(model.attenuation_per_mm(0, Beam::kKilovoltage), 0.0205F);
  EXPECT_FLOAT_EQ(model.attenuation_per_mm(-300, Beam::kKilovoltage), 0.0205F * 0.7F);
  EXPECT_FLOAT_EQ(model.attenuation_per_mm(1000, Beam::kKilovoltage), 0.0205F * 2.6F);
  EXPECT_FLOAT_EQ(model.attenuation_per_mm(0, Beam::kMegavoltage), 0.0050F);
  EXPECT_FLOAT_EQ(model.attenuation_per_mm(1000, Beam::kMegavoltage), 0.0050F * 1.95F);
}

TEST(Attenuation, ThresholdActsPerVoxel) {
  AttenuationModel model;
  EXPECT_EQ(model.attenuation_per_mm(-540.5F, Beam::kKilovoltage), 0.0F);
  EXPECT_FLOAT_EQ(model.attenuation_per_mm(-540, Beam::kKilovoltage), 0.0205F * 0.46F);
  model.threshold_hu = -2000;
  EXPECT_EQ(model.attenuation_per_mm(-1500, Beam::kKilovoltage), 0.0F);  // never negative
}

TEST(Attenuation, WindowedCurveRisesFromLowToHigh) {
  AttenuationModel model{.kind = AttenuationModel::Kind::kWindowed};
  EXPECT_EQ(model.attenuation_per_mm(-540, Beam::kKilovoltage), 0.0F);
  EXPECT_FLOAT_EQ(model.attenuation_per_mm(480, Beam::kKilovoltage), 0.5F);
  EXPECT_FLOAT_EQ(model.attenuation_per_mm(3000, Beam::kKilovoltage), 1.0F);
  model.window_high_hu = -600;
  EXPECT_THROW(model.check(), UsageError);
}

}  // namespace
}  // namespace isoshift::attenuation_test
