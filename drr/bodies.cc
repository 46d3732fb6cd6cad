#include "drr/bodies.h"

#include <algorithm>
#include <array>

#include "base/parallel.h"
#include "drr/interpolation.h"
#include "geometry/voxel_box.h"

namespace isoshift {
namespace {

// A body's share at a place, 0 to 1.
float share_at(const BodyShare& share, const Eigen::Vector3d& voxel) {
  const Eigen::Vector3i lower = voxel.array().floor().cast<int>();
  if ((lower.array() < -1).any() || (lower.array() >= share.size.array()).any()) return 0.0F;
  return static_cast<float>(interpolate(share, lower, voxel - lower.cast<double>()) / 255.0);
}

// The corners of a box of voxels, `wider` voxels beyond their centers.
std::array<Eigen::Vector3d, 8> corners_of(const VoxelBox& box, double wider) {
  std::array<Eigen::Vector3d, 8> corners;
  for (int n = 0; n < 8; ++n)
    for (int axis = 0; axis < 3; ++axis)
      corners[n][axis] = ((n >> axis) & 1) != 0 ? box.last[axis] + wider : box.first[axis] - wider;
  return corners;
}

// The voxels of a CT where a share is not 0, or becomes so within a voxel of its own lattice.
VoxelBox box_in(const Volume<float>& ct, const BodyShare& share) {
  VoxelBox occupied = occupied_voxels(share.voxels.data(), share.size);
  if (occupied.is_empty()) return occupied;
  const Eigen::Affine3d ct_from_share = ct.patient_from_voxel.inverse() * share.patient_from_voxel;
  Eigen::AlignedBox3d reached;
  for (const Eigen::Vector3d& corner : corners_of(occupied, 1.0)) reached.extend(ct_from_share * corner);
  return {.first = reached.min().array().floor().max(0.0).cast<int>(),
          .last = reached.max().array().ceil().min(ct.size.array().cast<double>() - 1.0).cast<int>()};
}

Eigen::Vector3d center_of_mass(const Volume<float>& volume) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double mass = 0.0;
  for (int k = 0; k < volume.size.z(); ++k)
    for (int j = 0; j < volume.size.y(); ++j)
      for (int i = 0; i < volume.size.x(); ++i) {
        const double value = volume.at(i, j, k);
        sum += value * Eigen::Vector3d(i, j, k);
        mass += value;
      }
  return volume.patient_from_voxel * Eigen::Vector3d(mass > 0.0 ? Eigen::Vector3d(sum / mass) : sum);
}

// The places in a list of the pixels whose rays may meet a box: those within its projection. All of them if the box
// reaches behind the source.
std::vector<std::uint32_t> covered(std::span<const std::uint32_t> pixels, const XrayView& view,
                                   const Eigen::Isometry3d& room_from_patient,
                                   std::span<const Eigen::Vector3d> corners_patient_mm) {
  Eigen::AlignedBox2d shadow;
  bool is_behind = false;
  for (const Eigen::Vector3d& corner : corners_patient_mm) {
    const auto pixel = view.project(room_from_patient * corner);
    if (pixel) shadow.extend(*pixel);
    is_behind = is_behind || !pixel;
  }
  std::vector<std::uint32_t> places;
  const auto columns = static_cast<std::uint32_t>(view.columns);
  for (std::uint32_t n = 0; n < pixels.size(); ++n)
    if (is_behind || shadow.contains(Eigen::Vector2d(pixels[n] % columns, pixels[n] / columns))) places.push_back(n);
  return places;
}

// The attenuation of a body: that of the CT times its share, in the box where the share is not 0. Empty for a body of
// nothing.
AttenuationByBeam attenuation_of_body(const Volume<float>& ct_hu, const AttenuationModel& model,
                                      std::span<const Beam> beams, const BodyShare& share) {
  AttenuationByBeam result;
  const VoxelBox box = box_in(ct_hu, share);
  if (box.is_empty()) return result;
  const Eigen::Affine3d lattice = ct_hu.patient_from_voxel * Eigen::Translation3d(box.first.cast<double>());
  const Eigen::Affine3d share_from_voxel = share.patient_from_voxel.inverse() * lattice;
  for (const Beam beam : beams) result.emplace(beam, Volume<float>(box.size(), lattice));
  const Eigen::Vector3i& size = result.begin()->second.size;
  const Eigen::Vector3d along_row = share_from_voxel.linear().col(0);
  parallel_for(0, size.z(), [&](int k) {
    for (int j = 0; j < size.y(); ++j) {
      const Eigen::Vector3d row_start = share_from_voxel * Eigen::Vector3d(0.0, j, k);
      for (int i = 0; i < size.x(); ++i) {
        const float part = share_at(share, row_start + i * along_row);
        if (part == 0.0F) continue;
        const float hu = ct_hu.at(box.first.x() + i, box.first.y() + j, box.first.z() + k);
        for (auto& [beam, volume] : result) volume.at(i, j, k) = part * model.attenuation_per_mm(hu, beam);
      }
    }
  });
  return result;
}

}  // namespace

BodyRenderers::BodyRenderers(RendererKind kind, const Volume<float>& ct_hu, const AttenuationModel& model,
                             std::span<const Beam> beams, std::span<const BodyShare> shares) {
  for (const BodyShare& share : shares) {
    Body& body = bodies_.emplace_back();
    AttenuationByBeam attenuation = attenuation_of_body(ct_hu, model, beams, share);
    if (attenuation.empty()) continue;
    const Volume<float>& volume = attenuation.begin()->second;
    const VoxelBox all{.first = Eigen::Vector3i::Zero(), .last = volume.size.array() - 1};
    for (const Eigen::Vector3d& corner : corners_of(all, 1.0))
      body.corners_patient_mm.push_back(volume.patient_from_voxel * corner);
    body.center_patient_mm = center_of_mass(volume);
    body.renderer = make_renderer(kind, std::move(attenuation));
  }
}

BodyDrr BodyRenderers::part(std::size_t body, const XrayView& view, const Eigen::Isometry3d& room_from_patient,
                            std::span<const std::uint32_t> pixels, bool with_derivatives) const {
  BodyDrr part;
  const Body& of = bodies_[body];
  if (!of.renderer) return part;
  const std::vector<std::uint32_t> places = covered(pixels, view, room_from_patient, of.corners_patient_mm);
  if (places.empty()) return part;
  PixelSet listed{.of_view = {{}}};
  for (const std::uint32_t place : places) listed.of_view.front().push_back(pixels[place]);
  const auto views = std::span(&view, 1);
  const auto poses = std::span(&room_from_patient, 1);
  const RenderResult drr = with_derivatives ? of.renderer->render_with_derivatives(views, poses, listed)
                                            : of.renderer->render(views, poses, listed);
  const std::span<const float> line_integrals = drr.line_integrals(0, 0);
  for (std::size_t n = 0; n < places.size(); ++n) {
    if (line_integrals[n] == 0.0F) continue;
    part.places.push_back(places[n]);
    part.line_integrals.push_back(line_integrals[n]);
    if (with_derivatives) part.derivatives.push_back(drr.derivatives(0, 0)[n]);
  }
  return part;
}

BodyDrr BodyRenderers::part_with_derivatives(std::size_t body, const XrayView& view,
                                             const Eigen::Isometry3d& room_from_patient,
                                             std::span<const std::uint32_t> pixels) const {
  return part(body, view, room_from_patient, pixels, true);
}

void BodyRenderers::add(std::size_t body, const XrayView& view, const Eigen::Isometry3d& room_from_patient,
                        std::span<const std::uint32_t> pixels, std::span<float> line_integrals) const {
  const BodyDrr drr = part(body, view, room_from_patient, pixels, false);
  for (std::size_t n = 0; n < drr.places.size(); ++n) line_integrals[drr.places[n]] += drr.line_integrals[n];
}

double BodyRenderers::distance_mm(std::size_t body, const Eigen::Isometry3d& one,
                                  const Eigen::Isometry3d& other) const {
  double farthest = 0.0;
  for (const Eigen::Vector3d& corner : bodies_[body].corners_patient_mm)
    farthest = std::max(farthest, (one * corner - other * corner).norm());
  return farthest;
}

}  // namespace isoshift
