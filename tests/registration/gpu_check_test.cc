// The self-check: what works passes, and devices that compute something else fail, each in a way that was seen
// somewhere.

#include "registration/gpu_check.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <utility>

#include "drr/raycast/raycast.h"
#include "tests/support/gpu.h"

namespace isoshift::gpu_check_test {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

std::unique_ptr<Renderer> on_llvmpipe(const Volume<float>& ct_hu, const AttenuationModel& model,
                                      std::span<const Beam> beams, Filtering filtering) {
  return std::make_unique<RaycastGlRenderer>(ct_hu, model, beams, RendererOptions{.gl = GlDevice::kSoftware},
                                             filtering);
}

// What a result is made of.
struct Parts {
  std::vector<float> line_integrals;
  std::vector<MotionDerivatives> derivatives;
  std::vector<std::size_t> begins = {0};

  Parts(const RenderResult& result, std::span<const XrayView> views, std::size_t poses, const PixelSet& pixels,
        bool with_derivatives) {
    for (std::size_t view = 0; view < views.size(); ++view) begins.push_back(begins.back() + pixels.count(views, view));
    for (std::size_t pose = 0; pose < poses; ++pose)
      for (std::size_t view = 0; view < views.size(); ++view) {
        std::ranges::copy(result.line_integrals(pose, view), std::back_inserter(line_integrals));
        if (with_derivatives) std::ranges::copy(result.derivatives(pose, view), std::back_inserter(derivatives));
      }
  }
  RenderResult result() && { return {std::move(line_integrals), std::move(begins), std::move(derivatives)}; }
};

// A renderer that does not do what it should.
class Spoiled : public Renderer {
 public:
  using Spoil = std::function<void(std::vector<float>& line_integrals, std::size_t poses)>;
  Spoiled(std::unique_ptr<Renderer> renderer, Spoil spoil) : renderer_(std::move(renderer)), spoil_(std::move(spoil)) {}

  RenderResult render(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                      const PixelSet& pixels) override {
    Parts parts(renderer_->render(views, room_from_patient, pixels), views, room_from_patient.size(), pixels, false);
    spoil_(parts.line_integrals, room_from_patient.size());
    return std::move(parts).result();
  }
  RendererKind kind() const override { return RendererKind::kRaycast; }
  std::string device() const override { return "a GPU that fails"; }

 private:
  std::unique_ptr<Renderer> renderer_;
  Spoil spoil_;
};

// An oracle whose derivatives are not what they should be.
class OtherDerivatives : public Renderer {
 public:
  using Spoil = std::function<void(MotionDerivatives& derivatives)>;
  OtherDerivatives(std::unique_ptr<Renderer> renderer, Spoil spoil)
      : renderer_(std::move(renderer)), spoil_(std::move(spoil)) {}

  RenderResult render(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                      const PixelSet& pixels) override {
    return renderer_->render(views, room_from_patient, pixels);
  }
  RenderResult render_with_derivatives(std::span<const XrayView> views,
                                       std::span<const Eigen::Isometry3d> room_from_patient,
                                       const PixelSet& pixels) override {
    Parts parts(renderer_->render_with_derivatives(views, room_from_patient, pixels), views, room_from_patient.size(),
                pixels, true);
    std::ranges::for_each(parts.derivatives, spoil_);
    return std::move(parts).result();
  }
  bool has_derivatives() const override { return true; }
  RendererKind kind() const override { return RendererKind::kRaycast; }
  std::string device() const override { return "a GPU that fails"; }

 private:
  std::unique_ptr<Renderer> renderer_;
  Spoil spoil_;
};

// For the table of docs/renderers.md, "Before a GPU is trusted", which is made from this program's --gtest_output.
void record(const std::string& what, const RenderingCheck& check) {
  testing::Test::RecordProperty(what, fmt::format("{:.6g}", check.largest_of_waves));
  testing::Test::RecordProperty(what + "_result", check.failure ? "fails" : "passes");
}

RenderingCheck check_of_derivatives(const OtherDerivatives::Spoil& spoil) {
  return check_rendering([&](const auto& ct_hu, const auto& model, auto beams) {
    return std::make_unique<OtherDerivatives>(make_renderer(RendererKind::kTrilinear, ct_hu, model, beams), spoil);
  });
}

// The check of a device that samples the volume elsewhere.
RenderingCheck check_of_moved(const Eigen::Affine3d& moved_from_voxel) {
  return check_rendering([&](const auto& ct_hu, const auto& model, auto beams) {
    Volume<float> moved = ct_hu;
    moved.patient_from_voxel = moved.patient_from_voxel * moved_from_voxel;
    return make_renderer(RendererKind::kTrilinear, moved, model, beams);
  });
}

RenderingCheck check_of_spoiled(const Spoiled::Spoil& spoil) {
  return check_rendering([&](const auto& ct_hu, const auto& model, auto beams) {
    return std::make_unique<Spoiled>(make_renderer(RendererKind::kTrilinear, ct_hu, model, beams), spoil);
  });
}

TEST(GpuCheck, LlvmpipePassesAndSaysByHowMuch) {
  const GpuCheck& check = gpu_check(GlDevice::kSoftware);
  EXPECT_EQ(check.failure, std::nullopt);
  EXPECT_EQ(&gpu_check(GlDevice::kSoftware), &check) << "once per process";
  EXPECT_GT(check.rendering.largest, 0.0);
  EXPECT_GT(check.rendering.slopes, 0.0);
  EXPECT_GT(check.rendering.samples_per_second, 0.0);
  EXPECT_LT(check.similarity.largest, 1e-5);
  EXPECT_GT(check.similarity.models, 0.0);
  EXPECT_LT(check.similarity.models, 1e-4);
  EXPECT_THAT(check.words(), testing::StartsWith("passed, line integrals within 0.0"));
}

TEST(GpuCheck, TheGpuPasses_hardware) {
  ISOSHIFT_SKIP_WITHOUT_GPU();
  EXPECT_EQ(gpu_check(GlDevice::kHardware).failure, std::nullopt);
}

TEST(GpuCheck, WeightsOfEightBitsPass) {
  for (const auto& [filtering, name] : {std::pair(Filtering::kTextureUnits, "texture_units"),
                                        std::pair(Filtering::kEightBitWeights, "eight_bit_weights")}) {
    const RenderingCheck check =
        check_rendering([&, filtering = filtering](const auto& ct_hu, const auto& model, auto beams) {
          return on_llvmpipe(ct_hu, model, beams, filtering);
        });
    record(name, check);
    EXPECT_EQ(check.failure, std::nullopt);
  }
}

TEST(GpuCheck, SamplesATenthOfAVoxelBesideFail) {
  for (int axis = 0; axis < 3; ++axis) {
    Vector3d moved = Vector3d::Zero();
    moved[axis] = 0.1;
    const RenderingCheck check = check_of_moved(Eigen::Affine3d(Eigen::Translation3d(moved)));
    record(fmt::format("moved_along_{}", "xyz"[axis]), check);
    EXPECT_THAT(check.failure.value_or("passed"), HasSubstr("its line integrals differ from the reference by"));
  }
}

TEST(GpuCheck, AxesThatAreSwappedFail) {
  Eigen::Affine3d swapped = Eigen::Affine3d::Identity();
  swapped.linear() << 0, 1, 0, 1, 0, 0, 0, 0, 1;
  EXPECT_NE(check_of_moved(swapped).failure, std::nullopt);
}

TEST(GpuCheck, VoxelsWithoutInterpolationFail) {
  const RenderingCheck check = check_rendering([](const auto& ct_hu, const auto& model, auto beams) {
    return make_renderer(RendererKind::kSiddon, ct_hu, model, beams);
  });
  record("siddon", check);
  EXPECT_NE(check.failure, std::nullopt);
}

TEST(GpuCheck, ABeamInsteadOfTheOtherFails) {
  EXPECT_NE(check_rendering([](const auto& ct_hu, const auto& model, auto) {
              const Volume<float> kv = attenuation_volume(ct_hu, model, Beam::kKilovoltage);
              return make_renderer(RendererKind::kTrilinear,
                                   AttenuationByBeam{{Beam::kKilovoltage, kv}, {Beam::kMegavoltage, kv}});
            }).failure,
            std::nullopt);
}

TEST(GpuCheck, APixelThatIsNotWrittenFails) {
  EXPECT_THAT(check_of_spoiled([](auto& line_integrals, std::size_t) {
                line_integrals.back() = std::numeric_limits<float>::quiet_NaN();
              }).failure.value_or("passed"),
              HasSubstr("not every pixel was rendered"));
}

TEST(GpuCheck, ABlackImageFails) {
  EXPECT_NE(
      check_of_spoiled([](auto& line_integrals, std::size_t) { std::ranges::fill(line_integrals, 0.0F); }).failure,
      std::nullopt);
}

TEST(GpuCheck, AnImageThatDependsOnOthersFails) {
  EXPECT_THAT(check_of_spoiled([](auto& line_integrals, std::size_t poses) {
                if (poses > 1) line_integrals.back() *= 1.0001F;
                line_integrals[line_integrals.size() / 2] *= poses > 1 ? 1.0001F : 1.0F;
              }).failure.value_or("passed"),
              HasSubstr("an image depends on what is rendered beside it"));
}

TEST(GpuCheck, WrongDerivativesFail) {
  EXPECT_EQ(check_of_derivatives([](MotionDerivatives&) {}).failure, std::nullopt);
  for (int axis = 0; axis < 6; ++axis)
    for (const float factor : {0.8F, -1.0F, std::numeric_limits<float>::quiet_NaN()})
      EXPECT_THAT(check_of_derivatives([&](MotionDerivatives& derivatives) {
                    derivatives[axis] *= factor;
                  }).failure.value_or("passed"),
                  HasSubstr("derivatives of its line integrals differ"));
}

TEST(GpuCheck, DispatchesGrowWithTheSpeedOfADevice) {
  EXPECT_EQ(rays_per_dispatch(1e7), std::size_t{1} << 16);
  EXPECT_EQ(rays_per_dispatch(1e9), 250000U);
  EXPECT_EQ(rays_per_dispatch(1e12), std::size_t{1} << 24);
}

}  // namespace
}  // namespace isoshift::gpu_check_test
