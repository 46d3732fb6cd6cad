// OpenGL: its objects, and what a user reads where it cannot be had.

#include <epoxy/gl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <numeric>

#include "base/error.h"
#include "drr/gl/context.h"
#include "drr/gl/objects.h"
#include "geometry/rotation.h"
#include "tests/drr/test_views.h"
#include "tests/support/command.h"

namespace isoshift::gl_test {
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

// The context that tests share, made current.
GlContext& software() {
  GlContext& context = gl_context(GlDevice::kSoftware);
  context.make_current();
  return context;
}

TEST(Gl, SoftwareSaysThatItIs) {
  const GlContext& context = software();
  EXPECT_TRUE(context.is_software()) << context.renderer();
  EXPECT_THAT(context.version(), testing::MatchesRegex("4[.][56] .*"));
  EXPECT_EQ(context.device_name(), "Mesa on the CPU");
  EXPECT_TRUE(context.is_robust());
  // Gl.OnZinkOverLavapipe would otherwise be llvmpipe again.
  const char* driver = std::getenv("GALLIUM_DRIVER");
  EXPECT_THAT(context.renderer(), HasSubstr(driver != nullptr ? driver : "llvmpipe"));
}

TEST(Gl, AProcessHasOneContextAndCompilesAProgramOnce) {
  GlContext& context = software();
  EXPECT_EQ(&gl_context(GlDevice::kSoftware), &context);
  const ShaderSource one{"layout(local_size_x = 1) in;\nvoid main() {}\n", "one.comp"};
  const ShaderSource other{"layout(local_size_x = 2) in;\nvoid main() {}\n", "other.comp"};
  const Program& program = context.program(one);
  EXPECT_NE(&context.program(other), &program);
  EXPECT_EQ(&context.program(one), &program);
}

TEST(Gl, DevicesAreTakenUntilOneWorks) {
  // llvmpipe, also where the system lists it as a GPU, does not hide the GPU behind it.
  const std::vector<std::string> names = {"GPU 0 (/dev/dri/renderD128)", "GPU 1 (/dev/dri/renderD129)", "GPU 2"};
  const std::vector<std::optional<std::string>> reasons = {
      "its EGL display cannot be opened: EGL_NOT_INITIALIZED (0x3001)", "what it offers is llvmpipe", std::nullopt};
  EXPECT_EQ(first_usable(names, [&](std::size_t n) { return reasons[n]; }), 2U);
  EXPECT_EQ(error_of([&] { first_usable(std::span(names).first(2), [&](std::size_t n) { return reasons[n]; }); }),
            "GPU 0 (/dev/dri/renderD128): its EGL display cannot be opened: EGL_NOT_INITIALIZED (0x3001); "
            "GPU 1 (/dev/dri/renderD129): what it offers is llvmpipe");
}

TEST(Gl, AGpuIsNamedByNumberOrUuid) {
  const std::string uuid = "1f0e8a2255aa4be0b1d30f64c1d2e3f4";
  const GlChoice any, second(GlDevice::kHardware, "1");
  const GlChoice by_uuid(GlDevice::kHardware, "GPU-1F0E8A22-55aa-4be0-b1d3-0f64c1d2e3f4");
  EXPECT_TRUE(any.means_number(5) && any.means_uuid(uuid) && any.means_uuid(""));
  EXPECT_TRUE(second.means_number(1) && !second.means_number(0) && second.means_uuid(uuid));
  EXPECT_TRUE(by_uuid.means_number(0) && by_uuid.means_uuid(uuid));
  EXPECT_FALSE(by_uuid.means_uuid("2f0e8a2255aa4be0b1d30f64c1d2e3f4") || by_uuid.means_uuid(""));
}

TEST(Gl, ADeviceThatIsNotThereIsRefused) {
  EXPECT_THAT(error_of([] { gl_context({GlDevice::kSoftware, "7"}); }),
              HasSubstr("no software OpenGL: Mesa on the CPU: is not the one asked for"));
}

TEST(Gl, ALostContextIsAnErrorAndAnotherIsOpened) {
  GlContext& lost = software();
  const auto asked = glGetGraphicsResetStatus;
  glGetGraphicsResetStatus = []() -> GLenum { return GL_GUILTY_CONTEXT_RESET; };
  const std::string error = error_of([&] { lost.check("rendering"); });
  glGetGraphicsResetStatus = asked;
  EXPECT_THAT(error, testing::AllOf(HasSubstr("rendering: the GPU was reset, what was running on it had to be ended."),
                                    HasSubstr("Use --renderer cpu")));
  EXPECT_THAT(error_of([&] { lost.make_current(); }), HasSubstr("was lost"));
  EXPECT_NE(&software(), &lost);
  EXPECT_NO_THROW(software().check("rendering"));
}

TEST(Gl, ObjectsMayEndWithoutAContext) {
  auto context = std::make_unique<GlContext>(GlDevice::kSoftware);
  auto buffer = std::make_unique<Buffer>();
  context.reset();
  EXPECT_NO_FATAL_FAILURE(buffer.reset());
}

TEST(Gl, ShaderErrorsNameFileLineAndDriver) {
  const GlContext& context = software();
  const std::string error = error_of(
      [] { Program(ShaderSource{"layout(local_size_x = 1) in;\nvoid main() {\n  nonsense;\n}\n", "drr/test.comp"}); });
  EXPECT_THAT(error, HasSubstr("drr/test.comp: does not compile on " + context.renderer()));
  EXPECT_THAT(error, HasSubstr("0:3("));  // line 3
  EXPECT_THAT(error, HasSubstr("nonsense"));
}

TEST(Gl, BuffersGiveBackWhatTheyGot) {
  software();
  Buffer buffer;
  const std::array<float, 3> sent = {1.5F, -2.0F, 3.25F};
  buffer.upload(std::as_bytes(std::span(sent)));
  Buffer moved = std::move(buffer);
  std::vector<float> received;
  moved.append_to(received, 0);
  EXPECT_THAT(received, testing::IsEmpty());
  moved.append_to(received, 3);
  moved.append_to(received, 2);
  EXPECT_THAT(received, testing::ElementsAre(1.5F, -2.0F, 3.25F, 1.5F, -2.0F));
}

TEST(Gl, LargeBuffersGiveBackAllOfTheirParts) {
  software();
  std::vector<float> sent(2 * MappedCopy::kMostBytes / sizeof(float) + 5), received = {-1.0F};
  std::iota(sent.begin(), sent.end(), 0.0F);
  Buffer buffer;
  buffer.upload(std::as_bytes(std::span(sent)));
  buffer.append_to(received, sent.size());
  sent.insert(sent.begin(), -1.0F);
  EXPECT_EQ(received, sent);
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
  EXPECT_THAT(outcome.out, HasSubstr("--renderer auto is cpu: no hardware OpenGL: there is no GPU that EGL knows"));
}

TEST_F(GlEnvironment, WithoutTheLibrariesTheReasonIsSaid) {
  struct Missing {
    const char *files, *message;
  };
  for (const auto& [files, message] :
       {Missing{"/usr/lib/*/libEGL.so.1", "the library libEGL.so.1 is missing (Debian package libegl1)"},
        Missing{"/usr/lib/*/libOpenGL.so.0 /usr/lib/*/libGL.so.1",
                "the library libOpenGL.so.0 is missing (Debian package libopengl0)"}}) {
    const CommandOutcome outcome = run_shell(fmt::format(
        "unshare -m sh -c 'for library in {}; do "
        "[ ! -e $library ] || mount --bind /dev/null \"$(readlink -f $library)\"; done; {} inspect --devices'",
        files, ISOSHIFT_PROGRAM));
    if (outcome.out.find("unshare") != std::string::npos || outcome.out.find("mount") != std::string::npos)
      GTEST_SKIP() << "no mount namespace can be made here; needs root";
    EXPECT_EQ(outcome.exit_status, 0);
    EXPECT_THAT(outcome.out, HasSubstr(message));
  }
}

TEST_F(GlEnvironment, DevicesAreListedWithLimitsAndSelfCheck) {
  const CommandOutcome outcome = devices("");
  EXPECT_THAT(outcome.out, HasSubstr("OpenGL, software: Mesa on the CPU, "));
  EXPECT_THAT(outcome.out,
              testing::ContainsRegex("Limits: volumes of [0-9]+ voxels along an edge, [0-9]+ MB of images"));
  EXPECT_THAT(outcome.out, testing::ContainsRegex("Self-check: passed, line integrals within 0[.]0.* [(][0-9]+ ms[)]"));
}

TEST_F(GlEnvironment, AnOlderOpenGlIsRefused) {
  const CommandOutcome outcome = devices("MESA_GL_VERSION_OVERRIDE=4.3");
  EXPECT_THAT(outcome.out, HasSubstr("OpenGL, software: none; no software OpenGL: Mesa on the CPU: "));
  EXPECT_THAT(outcome.out, testing::AnyOf(HasSubstr("it has no OpenGL 4.5: EGL_BAD"), HasSubstr("its OpenGL is 4.3")));
}

}  // namespace
}  // namespace isoshift::gl_test
