#include "drr/raycast/rasterized.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <limits>

#include "drr/camera.h"
#include "drr/of_beam.h"
#include "drr/raycast/between_faces.frag.h"
#include "drr/raycast/bounding_faces.h"
#include "drr/raycast/faces.frag.h"
#include "drr/raycast/faces.vert.h"
#include "drr/raycast/screen.vert.h"

namespace isoshift {
namespace {

// Uniform locations of faces.vert.
enum FacesUniform : int { kClipFromVoxel = 0, kSourceVoxel = 4, kEdge = 5, kHighest = 6, kTowardSource = 7 };
// Binding slots and uniform locations of between_faces.frag.
constexpr std::uint32_t kAttenuation = 0, kFront = 1, kBack = 2, kPixels = 0;
enum IntegralUniform : int {
  kVoxelFromPixel = 0,
  kMmFromVoxelAxes = 4,
  kStepMm = 7,
  kUnitPerMm = 8,
  kColumns = 9,
  kOutputColumns = 10,
  kPixelCount = 11,
  kHasPixelList = 12,
};

constexpr int kListColumns = 1024;  // of the image that a list of pixels is rendered into

// Depths as fractions of the way from source to receptor: nothing that matters lies nearer to the source or behind
// both.
constexpr double kNear = 1e-3, kFar = 4.0;

// The whole volume as one block.
BlockGrid one_block() { return {.size = Eigen::Vector3i::Ones(), .occupied = {1}}; }

// OpenGL's clip coordinates: pixel centers of the view become pixel centers of the target, row 0 first in memory.
Eigen::Matrix4d clip_from_voxel(const XrayView& view, const Eigen::Isometry3d& room_from_patient,
                                const Eigen::Affine3d& patient_from_voxel) {
  const Eigen::Matrix<double, 3, 4> pixel_from_voxel =
      view.pixel_from_room * room_from_patient.matrix() * patient_from_voxel.matrix();
  Eigen::Matrix4d clip;
  const auto w = pixel_from_voxel.row(2);
  clip.row(0) = 2.0 / view.columns * (pixel_from_voxel.row(0) + 0.5 * w) - w;
  clip.row(1) = 2.0 / view.rows * (pixel_from_voxel.row(1) + 0.5 * w) - w;
  clip.row(2) = (kFar + kNear) / (kFar - kNear) * w;
  clip(2, 3) -= 2.0 * kFar * kNear / (kFar - kNear);
  clip.row(3) = w;
  return clip;
}

}  // namespace

RasterizedRaycaster::RasterizedRaycaster(RendererKind kind, const Volume<float>& ct_hu, const AttenuationModel& model,
                                         std::span<const Beam> beams, const RendererOptions& options)
    : context_(gl_context(options.gl)),
      kind_(kind),
      faces_program_(context_.program({kFacesVert, "drr/raycast/faces.vert"}, {kFacesFrag, "drr/raycast/faces.frag"})),
      integral_program_(context_.program({kScreenVert, "drr/raycast/screen.vert"},
                                         {kBetweenFacesFrag, "drr/raycast/between_faces.frag"})),
      front_(RenderTarget::Pixel::kFourFloats, RenderTarget::Depth::kFloat),
      back_(RenderTarget::Pixel::kFourFloats, RenderTarget::Depth::kFloat),
      result_(RenderTarget::Pixel::kOneFloat, RenderTarget::Depth::kNone),
      patient_from_voxel_(ct_hu.patient_from_voxel),
      voxel_from_patient_(ct_hu.patient_from_voxel.inverse()),
      size_(ct_hu.size),
      step_mm_(ct_hu.spacing_mm().minCoeff()) {
  const bool is_box = kind == RendererKind::kRaycastBox;
  block_edge_ =
      is_box ? Eigen::Vector3d(size_.cast<double>().array() + 1.0) : Eigen::Vector3d::Constant(options.block_edge);
  for (const Beam beam : beams) {
    const QuantizedVolume volume =
        quantized_attenuation(ct_hu, model, beam, options.precision.value_or(kDefaultPrecision));
    attenuation_.emplace(beam, volume);
    const std::vector<BlockFace> faces =
        bounding_faces(is_box ? one_block() : interpolation_blocks(volume, options.block_edge));
    Structure& structure = structures_[beam];
    structure.face_count = static_cast<int>(faces.size());
    if (faces.empty()) continue;
    structure.faces.upload(std::as_bytes(std::span(faces)));
    structure.vertices.attribute(0, structure.faces, VertexArray::Type::kUint16, 4, true);
  }
  context_.check("uploading the CT");
}

RenderResult RasterizedRaycaster::render(std::span<const XrayView> views,
                                         std::span<const Eigen::Isometry3d> room_from_patient, const PixelSet& pixels) {
  context_.make_current();
  timer_.clear();
  refuse_line_scans(views, kind_);
  std::vector<std::size_t> begins = checked_view_begins(views, room_from_patient, pixels);
  std::vector<float> line_integrals(begins.back() * room_from_patient.size());
  for (std::size_t p = 0; p < room_from_patient.size(); ++p)
    for (std::size_t v = 0; v < views.size(); ++v) {
      const auto drr = std::span(line_integrals).subspan(p * begins.back() + begins[v], begins[v + 1] - begins[v]);
      if (drr.empty()) continue;
      {
        const auto running = timer_.run();
        draw_faces(views[v], room_from_patient[p], false);
        draw_faces(views[v], room_from_patient[p], true);
        draw_line_integrals(views[v], room_from_patient[p],
                            pixels.of_view.empty() ? std::span<const std::uint32_t>() : pixels.of_view[v], drr.size());
      }
      result_.download(drr);
    }
  context_.check("rendering");
  return RenderResult(std::move(line_integrals), std::move(begins));
}

void RasterizedRaycaster::draw_faces(const XrayView& view, const Eigen::Isometry3d& room_from_patient, bool front) {
  const Structure& structure = of_beam(structures_, view.beam);
  RenderTarget& target = front ? front_ : back_;
  target.resize_and_use(view.columns, view.rows);
  target.clear(front ? 1.0F : 0.0F);
  if (structure.face_count == 0) return;
  faces_program_.use();
  structure.vertices.bind();
  set_uniform(kClipFromVoxel, clip_from_voxel(view, room_from_patient, patient_from_voxel_));
  set_uniform(kSourceVoxel, make_camera(view, room_from_patient, voxel_from_patient_).source_voxel);
  set_uniform(kEdge, block_edge_);
  set_uniform(kHighest, Eigen::Vector3d(size_.cast<double>()));
  glUniform1ui(kTowardSource, front ? 1U : 0U);
  glDisable(GL_BLEND);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(front ? GL_LESS : GL_GREATER);  // the first front face, the last back face
  glDrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, structure.face_count);
}

void RasterizedRaycaster::draw_line_integrals(const XrayView& view, const Eigen::Isometry3d& room_from_patient,
                                              std::span<const std::uint32_t> pixel_list, std::size_t count) {
  const bool has_list = !pixel_list.empty();
  const int columns = has_list ? std::min(kListColumns, static_cast<int>(count)) : view.columns;
  const int rows = (static_cast<int>(count) + columns - 1) / columns;
  const std::uint32_t none = 0;
  pixels_.upload(std::as_bytes(has_list ? pixel_list : std::span(&none, 1)));
  const AttenuationTexture& attenuation = of_beam(attenuation_, view.beam);

  result_.resize_and_use(columns, rows);
  integral_program_.use();
  of_beam(structures_, view.beam).vertices.bind();  // any will do: none of its attributes is read
  attenuation.texture.bind(kAttenuation);
  front_.bind(kFront);
  back_.bind(kBack);
  pixels_.bind(kPixels);
  set_uniform(kVoxelFromPixel, make_camera(view, room_from_patient, voxel_from_patient_).matrix());
  set_uniform(kMmFromVoxelAxes, Eigen::Matrix3d(patient_from_voxel_.linear()));
  glUniform1f(kStepMm, static_cast<GLfloat>(step_mm_));
  glUniform1f(kUnitPerMm, static_cast<GLfloat>(attenuation.unit_per_mm));
  glUniform1ui(kColumns, static_cast<GLuint>(view.columns));
  glUniform1ui(kOutputColumns, static_cast<GLuint>(columns));
  glUniform1ui(kPixelCount, static_cast<GLuint>(count));
  glUniform1ui(kHasPixelList, has_list ? 1U : 0U);
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_BLEND);
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

Image<std::array<float, 3>> RasterizedRaycaster::front_positions(const XrayView& view,
                                                                 const Eigen::Isometry3d& room_from_patient) {
  context_.make_current();
  draw_faces(view, room_from_patient, true);
  std::vector<float> colors(4 * static_cast<std::size_t>(view.columns) * view.rows);
  front_.download(colors);
  Image<std::array<float, 3>> image(view.columns, view.rows);
  for (std::size_t n = 0; n < image.pixels.size(); ++n)
    for (int axis = 0; axis < 3; ++axis)
      image.pixels[n][axis] = colors[4 * n + 3] == 0.0F ? std::numeric_limits<float>::quiet_NaN()
                                                        : colors[4 * n + axis] / static_cast<float>(size_[axis]);
  return image;
}

}  // namespace isoshift
