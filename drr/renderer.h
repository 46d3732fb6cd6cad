#pragma once
// Digitally reconstructed radiographs. One interface, several renderers, batched over poses and views.
//
//   auto renderer = make_renderer(RendererKind::kCpu, ct_hu, AttenuationModel{}, beams);
//   RenderResult drrs = renderer->render(views, poses, PixelSet::all());
//   std::span<const float> pixels = drrs.line_integrals(pose, view);

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drr/attenuation.h"
#include "drr/gl/device.h"
#include "drr/quantized_volume.h"
#include "geometry/image.h"
#include "geometry/volume.h"
#include "geometry/xray_view.h"

namespace isoshift {

enum class RendererKind {
  kSiddon,     // oracle, double precision: exact for voxels of constant attenuation
  kTrilinear,  // oracle, double precision: exact for trilinear interpolation between voxel centers
  kCpu,        // ray casting in single precision on all cores, plane by plane
  kRaycast,    // ray casting in an OpenGL compute shader
  // The founding paper's, on OpenGL's rasterizer:
  kRaycastBox,        // rays from the front to the back of the volume's box
  kRaycastCuberille,  // rays from the first front to the last back face of the blocks above the threshold
  kSplat,             // wobbled splatting, voxels sent for every image, random numbers computed
  kSplatTexture,      // the same, random numbers from a small texture
  kSplatBuffers,      // the same as kSplat, voxels kept by OpenGL
};

inline constexpr std::array kRendererKinds = {
    RendererKind::kSiddon,  RendererKind::kTrilinear,    RendererKind::kCpu,
    RendererKind::kRaycast, RendererKind::kRaycastBox,   RendererKind::kRaycastCuberille,
    RendererKind::kSplat,   RendererKind::kSplatTexture, RendererKind::kSplatBuffers};

std::string_view to_string(RendererKind kind);
std::optional<RendererKind> renderer_kind_from(std::string_view name);
bool uses_gl(RendererKind kind);
bool is_oracle(RendererKind kind);
bool is_splatting(RendererKind kind);

// Wobbled splatting (docs/renderers.md, "Splatting").
struct SplatOptions {
  enum class Wobble {
    kFocus,  // the focal spot moves for every voxel: the blur grows with the height above the receptor
    kVoxel,  // the voxel moves
  };
  enum class Deposit {
    kNearest,   // a voxel falls into one pixel
    kBilinear,  // into four, shared by distance
  };

  Wobble wobble = Wobble::kFocus;
  Deposit deposit = Deposit::kNearest;
  std::optional<double> sigma_mm;  // of the wobble, in two axes of the receptor; 0: none; unset: default_sigma_mm()
  std::uint32_t seed = 1;          // the only source of randomness
};

// The sigma that blurs a voxel at the isocenter by half its largest edge: 0.5 * spacing * SID / (SID - SAD) for the
// focal spot. Throws Error for a receptor that does not lie behind the isocenter, where the focal spot cannot blur it.
double default_sigma_mm(SplatOptions::Wobble wobble, double largest_spacing_mm, const XrayView& view);

struct RendererOptions {
  GlChoice gl;                               // of the kinds that use OpenGL
  std::optional<VolumePrecision> precision;  // unset: u16. The oracles keep floats
  // Of kRaycast: many rays at once keep a GPU from everybody else, and drivers end what takes too long. What is
  // rendered does not depend on it.
  std::size_t rays_per_dispatch = std::size_t{1} << 24;
  int block_edge = 2;  // of kRaycastCuberille, voxels
  SplatOptions splat;

  // Throws UsageError for what a renderer of this kind cannot do.
  void check(RendererKind kind) const;
};

// Which pixels of every view are rendered: all, or per view a list of indices (row * columns + column).
struct PixelSet {
  std::vector<std::vector<std::uint32_t>> of_view;  // empty: all pixels of all views

  static PixelSet all() { return {}; }
  // A share of every view's pixels, drawn without replacement, in rising order; the same for the same seed.
  static PixelSet random(std::span<const XrayView> views, double fraction, std::uint64_t seed);
  std::size_t count(std::span<const XrayView> views, std::size_t view) const;
};

// How a line integral changes if the patient, at the pose rendered, moves in the room: per mm of translation along x, y
// and z, and per rad of rotation about x, y and z through the isocenter. The motion is exp(theta) in front of the pose.
using MotionDerivatives = Eigen::Matrix<float, 6, 1>;

// The pixels of one render() call.
class RenderResult {
 public:
  RenderResult(std::vector<float> values, std::vector<std::size_t> view_begins,
               std::vector<MotionDerivatives> derivatives = {})
      : values_(std::move(values)), derivatives_(std::move(derivatives)), view_begins_(std::move(view_begins)) {}

  // Line integrals of one pose and view, in the order of the pixel set (row-major for all pixels).
  std::span<const float> line_integrals(std::size_t pose, std::size_t view) const& {
    return part_of(std::span(values_), pose, view);
  }
  std::span<const float> line_integrals(std::size_t pose,
                                        std::size_t view) const&& = delete;  // they would not outlive it

  // The same pixels' derivatives; only render_with_derivatives() makes them.
  std::span<const MotionDerivatives> derivatives(std::size_t pose, std::size_t view) const& {
    return part_of(std::span(derivatives_), pose, view);
  }
  std::span<const MotionDerivatives> derivatives(std::size_t pose, std::size_t view) const&& = delete;

 private:
  template <class T>
  std::span<const T> part_of(std::span<const T> all, std::size_t pose, std::size_t view) const {
    const std::size_t begin = pose * view_begins_.back() + view_begins_[view];
    return all.subspan(begin, view_begins_[view + 1] - view_begins_[view]);
  }

  std::vector<float> values_;
  std::vector<MotionDerivatives> derivatives_;
  std::vector<std::size_t> view_begins_;  // within one pose; the last entry is the pose's total
};

class ImagesOnGpu;

class Renderer {
 public:
  virtual ~Renderer() = default;

  // Line integrals of attenuation (dimensionless) from source to pixel center; 0 where a ray misses the volume.
  // Images come pose by pose and, within a pose, view by view. A volume outside what the ray passes is air. Renderers
  // on the CPU may be called from several threads at once; those on OpenGL from one.
  virtual RenderResult render(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                              const PixelSet& pixels) = 0;

  // The same, and every line integral's derivatives, from the same walk along the ray (docs/algorithms.md,
  // "Derivatives"). Throws UsageError if this renderer has none.
  virtual RenderResult render_with_derivatives(std::span<const XrayView> views,
                                               std::span<const Eigen::Isometry3d> room_from_patient,
                                               const PixelSet& pixels);
  virtual bool has_derivatives() const { return false; }

  virtual RendererKind kind() const = 0;

  // What it runs on, in words, for the log and the result.
  virtual std::string device() const = 0;

  // How long the GPU was busy with the last render(), by its own clock and without transfers from it; nothing where
  // there is no OpenGL.
  virtual std::optional<double> gpu_seconds() const { return std::nullopt; }

  // If it can leave its line integrals on the GPU: how (drr/images_on_gpu.h).
  virtual ImagesOnGpu* on_gpu() { return nullptr; }
};

// A renderer for views of the given beam qualities; to render a view of another quality is a logic error. Keeps its own
// copy of the volume. Throws UsageError for a model or options that fail their check. Throws Error with the reason if
// the OpenGL that the renderer needs is not available, or if the volume exceeds its limits: no other renderer is ever
// used instead.
std::unique_ptr<Renderer> make_renderer(RendererKind kind, const Volume<float>& ct_hu, const AttenuationModel& model,
                                        std::span<const Beam> beams, const RendererOptions& options = {});

// The same of attenuation that is known already; for the kinds that know no model: trilinear and cpu. Another kind is a
// logic error.
std::unique_ptr<Renderer> make_renderer(RendererKind kind, AttenuationByBeam attenuation_per_mm,
                                        const RendererOptions& options = {});

// All pixels of a view as an image.
Image<float> image_of(const XrayView& view, std::span<const float> line_integrals);

// Throws Error if a DRR of a whole image is zero everywhere: a blank picture is never a result.
void require_not_empty(std::span<const float> line_integrals, std::string_view label);

}  // namespace isoshift
