#include "drr/splat/splat.h"

#include <epoxy/gl.h>

#include <cmath>
#include <limits>
#include <random>
#include <type_traits>

#include "base/error.h"
#include "base/option_name.h"
#include "drr/camera.h"
#include "drr/of_beam.h"
#include "drr/splat/splat.frag.h"
#include "drr/splat/splat.vert.h"

namespace isoshift {
namespace {

// Attribute and uniform locations and binding slots, as in splat.vert.
constexpr std::uint32_t kVoxel = 0, kAttenuation = 1, kNoise = 0;
enum Uniform : int {
  kSize = 0,
  kPixelFromVoxel = 1,
  kSourceVoxel = 5,
  kMmFromVoxelAxes = 6,
  kSidMm = 9,
  kWeight = 10,
  kSigmaPx = 11,
  kFocusWobbles = 12,
  kBilinear = 13,
  kImageSize = 14,
  kSeed = 15,
};

// Large enough to show no pattern: a table of 50 numbers prints structured noise.
constexpr int kNoiseEdge = 32;

ShaderSource vertex_shader(RendererKind kind) {
  const char* variant = kind == RendererKind::kSplatTexture ? "#define NOISE_TEXTURE\n#line 1\n" : "";
  return {variant + std::string(kSplatVert), "drr/splat/splat.vert"};
}

std::vector<Eigen::Vector2f> gaussian_pairs(std::uint32_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<float> gaussian;
  std::vector<Eigen::Vector2f> pairs(kNoiseEdge * kNoiseEdge * kNoiseEdge);
  for (Eigen::Vector2f& pair : pairs) pair = {gaussian(random), gaussian(random)};
  return pairs;
}

// The receptor of a view: what one step along its columns and rows is, in mm in the room.
struct Receptor {
  Eigen::Vector3d column_step_mm, row_step_mm;

  explicit Receptor(const XrayView& view) {
    const Eigen::Matrix3d way_from_pixel = view.pixel_from_room.leftCols<3>().inverse();
    column_step_mm = way_from_pixel.col(0);
    row_step_mm = way_from_pixel.col(1);
    sid_mm = std::abs(column_step_mm.cross(row_step_mm).normalized().dot(way_from_pixel.col(2)));
  }
  double pixel_area_mm2() const { return column_step_mm.cross(row_step_mm).norm(); }

  double sid_mm;  // along the central axis
};

}  // namespace

void SplatRenderer::Voxels::upload() {
  index_buffer.upload(std::as_bytes(std::span(index)));
  std::visit([&](const auto& values) { attenuation_buffer.upload(std::as_bytes(std::span(values))); }, attenuation);
}

SplatRenderer::SplatRenderer(RendererKind kind, const Volume<float>& ct_hu, const AttenuationModel& model,
                             std::span<const Beam> beams, const RendererOptions& options)
    : context_(gl_context(options.gl)),
      kind_(kind),
      program_(context_.program(vertex_shader(kind), {kSplatFrag, "drr/splat/splat.frag"})),
      image_(RenderTarget::Pixel::kOneFloat, RenderTarget::Depth::kNone),
      options_(options.splat),
      patient_from_voxel_(ct_hu.patient_from_voxel),
      voxel_from_patient_(ct_hu.patient_from_voxel.inverse()),
      size_(ct_hu.size) {
  if (ct_hu.voxels.size() > std::numeric_limits<std::uint32_t>::max())
    throw Error(
        "a CT of more than 4294967295 voxels cannot be splatted.\n"
        "       Use " +
        option("renderer", "cpu"));
  for (const Beam beam : beams) {
    const QuantizedVolume volume =
        quantized_attenuation(ct_hu, model, beam, options.precision.value_or(kDefaultPrecision));
    Voxels& kept = voxels_[beam];
    kept.unit_per_mm = volume.full_scale_per_mm();
    std::visit(
        [&]<class T>(const std::vector<T>& values) {
          std::vector<T> above;
          for (std::size_t n = 0; n < values.size(); ++n) {
            if (values[n] == T{}) continue;
            kept.index.push_back(static_cast<std::uint32_t>(n));
            above.push_back(values[n]);
          }
          kept.attenuation = std::move(above);
          constexpr auto kType = std::is_same_v<T, float>          ? VertexArray::Type::kFloat
                                 : std::is_same_v<T, std::uint8_t> ? VertexArray::Type::kUnitUint8
                                                                   : VertexArray::Type::kUnitUint16;
          kept.upload();
          kept.vertices.attribute(kVoxel, kept.index_buffer, VertexArray::Type::kUint32, 1, false);
          kept.vertices.attribute(kAttenuation, kept.attenuation_buffer, kType, 1, false);
        },
        volume.voxels);
  }
  if (kind == RendererKind::kSplatTexture)
    noise_.emplace(Eigen::Vector3i::Constant(kNoiseEdge),
                   std::span<const Eigen::Vector2f>(gaussian_pairs(options_.seed)));
  context_.check("uploading the voxels");
}

RenderResult SplatRenderer::render(std::span<const XrayView> views,
                                   std::span<const Eigen::Isometry3d> room_from_patient, const PixelSet& pixels) {
  context_.make_current();
  timer_.clear();
  refuse_line_scans(views, kind_);
  std::vector<std::size_t> begins = checked_view_begins(views, room_from_patient, pixels);
  std::vector<float> line_integrals(begins.back() * room_from_patient.size());
  for (std::size_t p = 0; p < room_from_patient.size(); ++p)
    for (std::size_t v = 0; v < views.size(); ++v) {
      const auto drr = std::span(line_integrals).subspan(p * begins.back() + begins[v], begins[v + 1] - begins[v]);
      draw(views[v], room_from_patient[p]);
      if (pixels.of_view.empty()) {
        image_.download(drr);
        continue;
      }
      // Voxels fall where they fall: a few pixels cost as much as all.
      whole_image_.resize(static_cast<std::size_t>(views[v].columns) * views[v].rows);
      image_.download(whole_image_);
      for (std::size_t n = 0; n < drr.size(); ++n) drr[n] = whole_image_[pixels.of_view[v][n]];
    }
  context_.check("rendering");
  return RenderResult(std::move(line_integrals), std::move(begins));
}

void SplatRenderer::draw(const XrayView& view, const Eigen::Isometry3d& room_from_patient) {
  Voxels& voxels = of_beam(voxels_, view.beam);
  const Receptor receptor(view);
  const double sigma_mm = options_.sigma_mm.value_or(
      default_sigma_mm(options_.wobble, patient_from_voxel_.linear().colwise().norm().maxCoeff(), view));
  const double voxel_mm3 = std::abs(patient_from_voxel_.linear().determinant());
  Eigen::Matrix4d pixel_from_voxel = Eigen::Matrix4d::Identity();
  pixel_from_voxel.topRows<3>() = view.pixel_from_room * room_from_patient.matrix() * patient_from_voxel_.matrix();

  image_.resize_and_use(view.columns, view.rows);
  image_.clear(0.0F);
  if (voxels.index.empty()) return;
  program_.use();
  if (kind_ != RendererKind::kSplatBuffers) voxels.upload();
  voxels.vertices.bind();
  if (noise_) noise_->bind(kNoise);
  glUniform3ui(kSize, static_cast<GLuint>(size_.x()), static_cast<GLuint>(size_.y()), static_cast<GLuint>(size_.z()));
  set_uniform(kPixelFromVoxel, pixel_from_voxel);
  set_uniform(kSourceVoxel, make_camera(view, room_from_patient, voxel_from_patient_).source_voxel);
  set_uniform(kMmFromVoxelAxes, Eigen::Matrix3d(patient_from_voxel_.linear()));
  glUniform1f(kSidMm, static_cast<GLfloat>(receptor.sid_mm));
  glUniform1f(kWeight, static_cast<GLfloat>(voxels.unit_per_mm * voxel_mm3 / receptor.pixel_area_mm2()));
  glUniform2f(kSigmaPx, static_cast<GLfloat>(sigma_mm / receptor.column_step_mm.norm()),
              static_cast<GLfloat>(sigma_mm / receptor.row_step_mm.norm()));
  glUniform1ui(kFocusWobbles, options_.wobble == SplatOptions::Wobble::kFocus ? 1U : 0U);
  const bool bilinear = options_.deposit == SplatOptions::Deposit::kBilinear;
  glUniform1ui(kBilinear, bilinear ? 1U : 0U);
  glUniform2f(kImageSize, static_cast<GLfloat>(view.columns), static_cast<GLfloat>(view.rows));
  if (kind_ != RendererKind::kSplatTexture) glUniform1ui(kSeed, options_.seed);
  glDisable(GL_DEPTH_TEST);
  glEnable(GL_BLEND);
  glBlendEquation(GL_FUNC_ADD);
  glBlendFunc(GL_ONE, GL_ONE);
  const auto running = timer_.run();
  glDrawArraysInstanced(GL_POINTS, 0, static_cast<GLsizei>(voxels.index.size()), bilinear ? 4 : 1);
}

}  // namespace isoshift
