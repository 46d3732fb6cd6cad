// OpenGL: its objects, and what a user reads where it cannot be had.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "drr/gl/context.h"
#include "drr/gl/objects.h"
#include "geometry/rotation.h"
#include "tests/drr/test_views.h"
#include "tests/support/command.h"

namespace isoshift {
namespace {

using testing::HasSubstr;

template <class Function>
std::string error_of(Function&& function) {
  try {
    function();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(Gl, SoftwareSaysThatItIs) {
  const GlContext context(GlDevice::kSoftware);
  EXPECT_TRUE(context.is_software()) << context.renderer();
  EXPECT_THAT(context.version(), testing::StartsWith("4.5"));
}

TEST(Gl, ShaderErrorsNameFileLineAndDriver) {
  const GlContext context(GlDevice::kSoftware);
  const std::string error = error_of(
      [] { Program(ShaderSource{"layout(local_size_x = 1) in;\nvoid main() {\n  nonsense;\n}\n", "drr/test.comp"}); });
  EXPECT_THAT(error, HasSubstr("drr/test.comp: does not compile on llvmpipe"));
  EXPECT_THAT(error, HasSubstr("0:3("));  // line 3
  EXPECT_THAT(error, HasSubstr("nonsense"));
}

TEST(Gl, BuffersGiveBackWhatTheyGot) {
  const GlContext context(GlDevice::kSoftware);
  Buffer buffer;
  const std::array<float, 3> sent = {1.5F, -2.0F, 3.25F};
  buffer.upload(std::as_bytes(std::span(sent)));
  Buffer moved = std::move(buffer);
  std::array<float, 3> received{};
  moved.download(std::as_writable_bytes(std::span(received)));
  EXPECT_EQ(sent, received);
}

TEST(Gl, MatricesKeepTheirColumns) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = rotation_z(rad_from_deg(90));
  pose.translation() = Eigen::Vector3d(10, 20, 30);
  const glm::vec4 moved = to_glm(pose.matrix()) * glm::vec4(1, 0, 0, 1);
  EXPECT_NEAR(moved.x, 10, 1e-6);
  EXPECT_NEAR(moved.y, 21, 1e-6);
  EXPECT_NEAR(moved.z, 30, 1e-6);
}

TEST(Gl, AVolumeBeyondTheLimitsIsRefusedByName) {
  const Volume<float> long_ct = centered_volume({5000, 2, 2}, {0.1, 1, 1}, 0.0F);
  EXPECT_THAT(
      error_of([&] { make_renderer(RendererKind::kRaycast, long_ct, {}, kBothBeams, {.gl = GlDevice::kSoftware}); }),
      testing::AllOf(HasSubstr("a CT of 5000 x 2 x 2 voxels is too large for this OpenGL, whose limit is"),
                     HasSubstr("Use --renderer cpu")));
}

// The whole program in its own process, where the environment can be taken away from it.
class GlEnvironment : public testing::Test {
 protected:
  CommandOutcome devices(const std::string& environment) {
    return run_shell(environment + " " + std::string(ISOSHIFT_PROGRAM) + " inspect --devices");
  }
};

TEST_F(GlEnvironment, WithoutAnEglDriverTheReasonIsSaid) {
  const CommandOutcome outcome = devices("__EGL_VENDOR_LIBRARY_FILENAMES=/nonexistent.json");
  EXPECT_EQ(outcome.exit_status, 0);
  EXPECT_THAT(outcome.out, HasSubstr("OpenGL, hardware: none; no hardware OpenGL: there is no GPU that EGL knows."));
  EXPECT_THAT(outcome.out, HasSubstr("OpenGL, software: none; no software OpenGL: Mesa is missing"));
  EXPECT_THAT(outcome.out, HasSubstr("--renderer auto is cpu"));
}

TEST_F(GlEnvironment, WithoutTheEglLibraryTheReasonIsSaid) {
  const CommandOutcome outcome = run_shell(fmt::format(
      "unshare -m sh -c 'mount --bind /dev/null \"$(readlink -f /usr/lib/*/libEGL.so.1)\" && {} inspect --devices'",
      ISOSHIFT_PROGRAM));
  if (outcome.out.find("unshare") != std::string::npos || outcome.out.find("mount") != std::string::npos)
    GTEST_SKIP() << "no mount namespace can be made here; needs root";
  EXPECT_EQ(outcome.exit_status, 0);
  EXPECT_THAT(outcome.out, HasSubstr("the library libEGL.so.1 is missing (Debian package libegl1)"));
}

TEST_F(GlEnvironment, AnOlderOpenGlIsRefused) {
  const CommandOutcome outcome = devices("MESA_GL_VERSION_OVERRIDE=4.3");
  EXPECT_THAT(outcome.out, testing::AnyOf(HasSubstr("OpenGL, software: none; no software OpenGL: it has no OpenGL 4.5"),
                                          HasSubstr("OpenGL, software: none; no software OpenGL: its OpenGL is 4.3")));
}

}  // namespace
}  // namespace isoshift
