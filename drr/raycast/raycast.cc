#include "drr/raycast/raycast.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <array>
#include <limits>
#include <tuple>

#include "base/error.h"
#include "base/option_name.h"
#include "drr/camera.h"
#include "drr/occupied_blocks.h"
#include "drr/of_beam.h"
#include "drr/raycast/raycast.comp.h"

namespace isoshift {
namespace {

// Binding slots and uniform locations, as in raycast.comp.
constexpr std::uint32_t kKvTexture = 0, kMvTexture = 1, kOccupiedTexture = 2;
constexpr std::uint32_t kCameras = 0, kViews = 1, kPixels = 2, kResult = 3, kRooms = 4, kDerivatives = 5;
enum Uniform : int {
  kPoses = 0,
  kViewCount = 1,
  kPixelsPerPose = 2,
  kHasPixelList = 3,
  kStepMm = 4,
  kMmFromVoxelAxes = 5,
  kBoxLow = 6,
  kBoxHigh = 7,
  kUnitPerMm = 8,
  kRays = 9,
};

constexpr int kBlockEdge = 8;
constexpr std::size_t kGroupSize = 64;
constexpr std::size_t kMaxGroups = 65535;  // what every OpenGL 4.5 allows along each axis

struct GlView {
  std::uint32_t first_pixel, columns, is_mv, in_squares;
};

struct GlCamera {
  glm::mat4 voxel_from_pixel;
  glm::vec4 row_step;
};

struct GlRoom {
  glm::mat4 room_from_pixel, room_from_gradient;
  glm::vec4 row_step;
};

glm::vec4 vec4_of(const Eigen::Vector3d& vector) { return glm::vec4(vector.x(), vector.y(), vector.z(), 0.0F); }

ShaderSource shader(Filtering filtering, bool with_derivatives) {
  std::string variant;
  if (filtering == Filtering::kEightBitWeights) variant += "#define EIGHT_BIT_WEIGHTS\n";
  if (with_derivatives) variant += "#define DERIVATIVES\n";
  return {variant + "#line 1\n" + kRaycastComp, "drr/raycast/raycast.comp"};
}

GlRoom room_of(const Camera& camera) {
  Eigen::Matrix4d room_from_gradient = Eigen::Matrix4d::Identity();
  room_from_gradient.topLeftCorner<3, 3>() = camera.voxel_from_room_axes.transpose();
  return {.room_from_pixel = to_glm(camera.room_matrix()),
          .room_from_gradient = to_glm(room_from_gradient),
          .row_step = vec4_of(camera.row_step_room_mm)};
}

template <class T>
std::span<const std::byte> bytes_of(const std::vector<T>& values) {
  return std::as_bytes(std::span(values));
}

}  // namespace

RaycastGlRenderer::RaycastGlRenderer(const Volume<float>& ct_hu, const AttenuationModel& model,
                                     std::span<const Beam> beams, const RendererOptions& options, Filtering filtering)
    : context_(gl_context(options.gl)),
      program_(context_.program(shader(filtering, false))),
      filtering_(filtering),
      voxel_from_patient_(ct_hu.patient_from_voxel.inverse()),
      step_mm_(ct_hu.spacing_mm().minCoeff()),
      rays_per_dispatch_(std::max<std::size_t>(1, options.rays_per_dispatch)) {
  const VolumePrecision precision = options.precision.value_or(kDefaultPrecision);
  VoxelBox box{.first = ct_hu.size, .last = Eigen::Vector3i::Constant(-1)};
  BlockGrid blocks;
  for (const Beam beam : beams) {
    const QuantizedVolume volume = quantized_attenuation(ct_hu, model, beam, precision);
    attenuation_.emplace(beam, volume);
    const VoxelBox of_beam = occupied_voxels(volume);
    box = {.first = box.first.cwiseMin(of_beam.first), .last = box.last.cwiseMax(of_beam.last)};
    // Beams differ in what attenuates at all only where a value rounds to 0.
    const BlockGrid of_this = interpolation_blocks(volume, kBlockEdge);
    if (blocks.occupied.empty()) blocks = of_this;
    std::ranges::transform(blocks.occupied, of_this.occupied, blocks.occupied.begin(), std::ranges::max);
  }
  box_low_ = box.first.cast<double>().array() - 1.0;
  box_high_ = box.last.cast<double>().array() + 1.0;
  occupied_.emplace(blocks.size, std::span<const std::uint8_t>(blocks.occupied));
  context_.check("uploading the CT");
}

RenderResult RaycastGlRenderer::render(std::span<const XrayView> views,
                                       std::span<const Eigen::Isometry3d> room_from_patient, const PixelSet& pixels) {
  return render_all(views, room_from_patient, pixels, false);
}

RenderResult RaycastGlRenderer::render_with_derivatives(std::span<const XrayView> views,
                                                        std::span<const Eigen::Isometry3d> room_from_patient,
                                                        const PixelSet& pixels) {
  return render_all(views, room_from_patient, pixels, true);
}

RenderResult RaycastGlRenderer::render_all(std::span<const XrayView> views,
                                           std::span<const Eigen::Isometry3d> room_from_patient, const PixelSet& pixels,
                                           bool with_derivatives) {
  context_.make_current();
  timer_.clear();
  std::vector<std::size_t> begins = checked_view_begins(views, room_from_patient, pixels);
  const std::size_t pixels_per_pose = begins.back();
  std::vector<float> line_integrals;
  std::vector<MotionDerivatives> derivatives;
  line_integrals.reserve(pixels_per_pose * room_from_patient.size());
  derivatives.reserve(with_derivatives ? line_integrals.capacity() : 0);
  upload_views(views, begins, pixels);
  const std::size_t at_once = poses_at_once(pixels_per_pose, with_derivatives);
  for (std::size_t first = 0; first < room_from_patient.size(); first += at_once) {
    const std::size_t count = std::min(at_once, room_from_patient.size() - first);
    dispatch(views, room_from_patient.subspan(first, count), pixels_per_pose, !pixels.of_view.empty(),
             with_derivatives);
    result_.append_to(line_integrals, count * pixels_per_pose);
    if (with_derivatives) derivatives_.append_to(derivatives, count * pixels_per_pose);
  }
  context_.check("rendering");
  return RenderResult(std::move(line_integrals), std::move(begins), std::move(derivatives));
}

Buffer& RaycastGlRenderer::render_on_gpu(std::span<const XrayView> views,
                                         std::span<const Eigen::Isometry3d> room_from_patient, const PixelSet& pixels) {
  render_all_on_gpu(views, room_from_patient, pixels, false);
  return result_;
}

ImagesOnGpu::WithDerivatives RaycastGlRenderer::render_with_derivatives_on_gpu(
    std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient, const PixelSet& pixels) {
  render_all_on_gpu(views, room_from_patient, pixels, true);
  return {.line_integrals = result_, .derivatives = derivatives_};
}

void RaycastGlRenderer::render_all_on_gpu(std::span<const XrayView> views,
                                          std::span<const Eigen::Isometry3d> room_from_patient, const PixelSet& pixels,
                                          bool with_derivatives) {
  context_.make_current();
  timer_.clear();
  const std::vector<std::size_t> begins = checked_view_begins(views, room_from_patient, pixels);
  if (room_from_patient.size() > poses_at_once(begins.back(), with_derivatives))
    throw Error("so many images exceed a storage buffer of this OpenGL");
  upload_views(views, begins, pixels);
  dispatch(views, room_from_patient, begins.back(), !pixels.of_view.empty(), with_derivatives);
  context_.check("rendering");
}

std::size_t RaycastGlRenderer::poses_at_once(std::size_t pixels_per_pose, bool with_derivatives) const {
  const std::size_t pose_bytes =
      std::max<std::size_t>(1, pixels_per_pose * (with_derivatives ? sizeof(MotionDerivatives) : sizeof(float)));
  const std::size_t count = static_cast<std::size_t>(context_.largest_buffer_bytes()) / pose_bytes;
  if (count == 0)
    throw Error(
        "images of this size exceed the storage buffers of this OpenGL.\n"
        "       Use " +
        option("renderer", "cpu"));
  return count;
}

void RaycastGlRenderer::poison(std::size_t line_integrals) {
  context_.make_current();
  result_.reserve(line_integrals * sizeof(float));
  result_.fill(std::numeric_limits<float>::quiet_NaN());
  derivatives_.reserve(line_integrals * sizeof(MotionDerivatives));
  derivatives_.fill(std::numeric_limits<float>::quiet_NaN());
}

void RaycastGlRenderer::upload_views(std::span<const XrayView> views, const std::vector<std::size_t>& begins,
                                     const PixelSet& pixels) {
  std::vector<GlView> gl_views;
  for (std::size_t v = 0; v < views.size(); ++v) {
    std::ignore = of_beam(attenuation_, views[v].beam);
    const bool in_squares = pixels.of_view.empty() && views[v].columns % 8 == 0 && views[v].rows % 8 == 0;
    gl_views.push_back({.first_pixel = static_cast<std::uint32_t>(begins[v]),
                        .columns = static_cast<std::uint32_t>(views[v].columns),
                        .is_mv = views[v].beam == Beam::kMegavoltage ? 1U : 0U,
                        .in_squares = in_squares ? 1U : 0U});
  }
  views_.upload(bytes_of(gl_views));
  std::vector<std::uint32_t> list = {0};  // stands in where all pixels are meant
  if (!pixels.of_view.empty()) {
    list.clear();
    for (const auto& of_view : pixels.of_view) list.insert(list.end(), of_view.begin(), of_view.end());
  }
  if (list == uploaded_pixels_) return;
  pixels_.upload(bytes_of(list));
  uploaded_pixels_ = std::move(list);
}

void RaycastGlRenderer::dispatch(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> poses,
                                 std::size_t pixels_per_pose, bool has_pixel_list, bool with_derivatives) {
  std::vector<GlCamera> cameras;
  std::vector<GlRoom> rooms;
  for (const Eigen::Isometry3d& pose : poses)
    for (const XrayView& view : views) {
      const Camera camera = make_camera(view, pose, voxel_from_patient_);
      cameras.push_back({.voxel_from_pixel = to_glm(camera.matrix()), .row_step = vec4_of(camera.row_step_voxel)});
      if (with_derivatives) rooms.push_back(room_of(camera));
    }
  cameras_.upload(bytes_of(cameras));
  result_.reserve(poses.size() * pixels_per_pose * sizeof(float));
  if (with_derivatives) {
    rooms_.upload(bytes_of(rooms));
    derivatives_.reserve(poses.size() * pixels_per_pose * sizeof(MotionDerivatives));
    rooms_.bind(kRooms);
    derivatives_.bind(kDerivatives);
  }

  if (with_derivatives && derivatives_program_ == nullptr)
    derivatives_program_ = &context_.program(shader(filtering_, true));
  (with_derivatives ? *derivatives_program_ : program_).use();
  const AttenuationTexture& kv = attenuation_.begin()->second;  // where a beam is absent, the other stands in unread
  const AttenuationTexture& mv = attenuation_.rbegin()->second;
  kv.texture.bind(kKvTexture);
  mv.texture.bind(kMvTexture);
  occupied_->bind(kOccupiedTexture);
  cameras_.bind(kCameras);
  views_.bind(kViews);
  pixels_.bind(kPixels);
  result_.bind(kResult);
  glUniform1ui(kViewCount, static_cast<GLuint>(views.size()));
  glUniform1ui(kPixelsPerPose, static_cast<GLuint>(pixels_per_pose));
  glUniform1ui(kHasPixelList, has_pixel_list ? 1U : 0U);
  glUniform1f(kStepMm, static_cast<GLfloat>(step_mm_));
  set_uniform(kMmFromVoxelAxes, Eigen::Matrix3d(voxel_from_patient_.linear().inverse()));
  set_uniform(kBoxLow, box_low_);
  set_uniform(kBoxHigh, box_high_);
  glUniform2f(kUnitPerMm, static_cast<GLfloat>(kv.unit_per_mm), static_cast<GLfloat>(mv.unit_per_mm));
  constexpr std::size_t kSamplesWithDerivatives = 7;
  const std::size_t rays_at_once =
      std::max<std::size_t>(1, rays_per_dispatch_ / (with_derivatives ? kSamplesWithDerivatives : 1));
  const std::size_t rays_each = std::clamp<std::size_t>(pixels_per_pose, 1, rays_at_once);
  const std::size_t poses_each = std::max<std::size_t>(1, rays_at_once / rays_each);
  for (std::size_t pose = 0; pose < poses.size(); pose += poses_each)
    for (std::size_t ray = 0; ray < pixels_per_pose; ray += rays_each) {
      const std::size_t poses_end = std::min(poses.size(), pose + poses_each),
                        rays_end = std::min(pixels_per_pose, ray + rays_each);
      glUniform2ui(kPoses, static_cast<GLuint>(pose), static_cast<GLuint>(poses_end));
      glUniform2ui(kRays, static_cast<GLuint>(ray), static_cast<GLuint>(rays_end));
      const std::size_t groups = (rays_end - ray + kGroupSize - 1) / kGroupSize;
      const auto running = timer_.run();
      glDispatchCompute(static_cast<GLuint>(std::min(groups, kMaxGroups)),
                        static_cast<GLuint>(std::min(poses_end - pose, kMaxGroups)), 1);
    }
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
}

}  // namespace isoshift
