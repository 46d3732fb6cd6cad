#pragma once
// DRRs of a patient whose bodies have moved apart. Line integrals add: the DRR is the sum of those of the bodies, each
// at its own pose.

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "drr/renderer.h"

namespace isoshift {

// How much of the attenuation belongs to a body, in 255ths, on a lattice of its own: between voxel centers it is
// interpolated, outside it is 0. Shares of all bodies of a CT that add up to 255 everywhere divide the CT without rest.
using BodyShare = Volume<std::uint8_t>;

// What one body adds to pixels of a view.
struct BodyDrr {
  std::vector<std::uint32_t> places;           // in the list of pixels: of those whose rays meet the body
  std::vector<float> line_integrals;           // of these
  std::vector<MotionDerivatives> derivatives;  // of these, by this body's motion
};

class BodyRenderers {
 public:
  // Renders on the CPU, with kind `cpu` or, as the oracle, `trilinear`. Bodies may be empty.
  BodyRenderers(RendererKind kind, const Volume<float>& ct_hu, const AttenuationModel& model,
                std::span<const Beam> beams, std::span<const BodyShare> shares);

  std::size_t count() const { return bodies_.size(); }

  // One body's part of the listed pixels (row * columns + column). Only pixels that the body's box covers are rendered.
  BodyDrr part_with_derivatives(std::size_t body, const XrayView& view, const Eigen::Isometry3d& room_from_patient,
                                std::span<const std::uint32_t> pixels) const;

  // Adds one body's line integrals to those of the listed pixels.
  void add(std::size_t body, const XrayView& view, const Eigen::Isometry3d& room_from_patient,
           std::span<const std::uint32_t> pixels, std::span<float> line_integrals) const;

  // How far apart two poses put any corner of the body's box; 0 for a body of nothing.
  double distance_mm(std::size_t body, const Eigen::Isometry3d& one, const Eigen::Isometry3d& other) const;

  // Where the body's attenuation has its center.
  const Eigen::Vector3d& center_patient_mm(std::size_t body) const { return bodies_[body].center_patient_mm; }

 private:
  struct Body {
    std::unique_ptr<Renderer> renderer;               // none for a body of nothing
    std::vector<Eigen::Vector3d> corners_patient_mm;  // of its box, a voxel wider
    Eigen::Vector3d center_patient_mm = Eigen::Vector3d::Zero();
  };
  BodyDrr part(std::size_t body, const XrayView& view, const Eigen::Isometry3d& room_from_patient,
               std::span<const std::uint32_t> pixels, bool with_derivatives) const;

  std::vector<Body> bodies_;
};

}  // namespace isoshift
