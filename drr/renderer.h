#pragma once
// Digitally reconstructed radiographs. One interface, several renderers, batched over poses and views.
//
//   auto renderer = make_renderer(RendererKind::kCpu, ct_hu, AttenuationModel{}, beams);
//   RenderResult drrs = renderer->render(views, poses, PixelSet::all());
//   std::span<const float> pixels = drrs.line_integrals(pose, view);

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drr/attenuation.h"
#include "geometry/volume.h"
#include "geometry/xray_view.h"

namespace isoshift {

enum class RendererKind {
  kSiddon,     // oracle, double precision: exact for voxels of constant attenuation
  kTrilinear,  // oracle, double precision: exact for trilinear interpolation between voxel centers
  kCpu,        // trilinear ray casting in single precision on all cores
  kRaycast,    // the same in an OpenGL compute shader
};

inline constexpr std::array kRendererKinds = {RendererKind::kSiddon, RendererKind::kTrilinear, RendererKind::kCpu,
                                              RendererKind::kRaycast};

std::string_view to_string(RendererKind kind);
std::optional<RendererKind> renderer_kind_from(std::string_view name);

// Which OpenGL to render on: a GPU, or Mesa's llvmpipe on the CPU, which is never taken unless asked for.
enum class GlDevice { kHardware, kSoftware };

// Which pixels of every view are rendered: all, or per view a list of indices (row * columns + column).
struct PixelSet {
  std::vector<std::vector<std::uint32_t>> of_view;  // empty: all pixels of all views

  static PixelSet all() { return {}; }
  std::size_t count(std::span<const XrayView> views, std::size_t view) const;
};

// Borrowed pixels of one render() call: valid until the renderer's next render() or its end.
class RenderResult {
 public:
  RenderResult(std::span<const float> values, std::vector<std::size_t> view_begins)
      : values_(values), view_begins_(std::move(view_begins)) {}

  // Line integrals of one pose and view, in the order of the pixel set (row-major for all pixels).
  std::span<const float> line_integrals(std::size_t pose, std::size_t view) const {
    const std::size_t begin = pose * view_begins_.back() + view_begins_[view];
    return values_.subspan(begin, view_begins_[view + 1] - view_begins_[view]);
  }

 private:
  std::span<const float> values_;
  std::vector<std::size_t> view_begins_;  // within one pose; the last entry is the pose's total
};

class Renderer {
 public:
  virtual ~Renderer() = default;

  // Line integrals of attenuation (dimensionless) from source to pixel center; 0 where a ray misses the volume.
  // Images come pose by pose and, within a pose, view by view. A volume outside what the ray passes is air.
  virtual RenderResult render(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                              const PixelSet& pixels) = 0;

  virtual RendererKind kind() const = 0;

  // What it runs on, in words, for the log and the result.
  virtual std::string device() const = 0;
};

// A renderer for views of the given beam qualities; rendering another one is a logic error. Keeps its own copy of the
// volume. `gl` matters to the kinds that use OpenGL. Throws UsageError for a model that fails its check, and Error with
// the reason where there is no such OpenGL or the volume exceeds its limits: never another renderer instead.
std::unique_ptr<Renderer> make_renderer(RendererKind kind, const Volume<float>& ct_hu, const AttenuationModel& model,
                                        std::span<const Beam> beams, GlDevice gl = GlDevice::kHardware);

// Throws Error if a DRR of a whole image is zero everywhere: a blank picture is never a result.
void require_not_empty(std::span<const float> line_integrals, std::string_view label);

}  // namespace isoshift
