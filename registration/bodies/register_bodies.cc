#include "registration/bodies/register_bodies.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/stopwatch.h"
#include "geometry/linear_algebra.h"
#include "geometry/rotation.h"
#include "geometry/seen_motions.h"
#include "geometry/voxel_box.h"
#include "registration/bodies/body_objective.h"
#include "registration/bodies/carriers.h"
#include "registration/bodies/target_match.h"
#include "registration/bodies/target_search.h"
#include "registration/bodies/turned_views.h"
#include "registration/pose_parameters.h"
#include "registration/quality/findings.h"
#include "registration/quality/limits.h"

namespace isoshift {
namespace {

using Eigen::Vector3d;

constexpr double kNearTargetMm = 30.0;
constexpr double kConvergedMm = 0.1;
constexpr double kVoxelMm = 1.4, kCoarseVoxelMm = 3.0;  // the CT is reduced to voxels up to these edges

// The target's center, and points 30 mm from it.
std::vector<Vector3d> points_near(const Vector3d& center_room_mm) {
  std::vector<Vector3d> points = {center_room_mm};
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-kNearTargetMm, kNearTargetMm})
      points.push_back(points.front() + side * Vector3d::Unit(axis));
  return points;
}

// What the search found, as images and as certainty: of every view how well it matches, and what it alone would want.
void report_match(const BodyScene& scene, const Carriers& carriers, const CarriedTarget& target,
                  const Vector3d& center_room_mm, const BodyPoses& planned, const BodyPoses& poses,
                  double similarity_pixel_mm, RegistrationResult& result) {
  constexpr double kPixelMm = 2.0;
  const Eigen::Isometry3d& about = poses.front().front();
  const std::vector<FixedImage> level = scene.views.reduced_to(kPixelMm, about, 0.0);
  const std::vector<FixedImage> as_whole = scene.views.reduced_to(similarity_pixel_mm, about, 0.0);
  const std::vector<double> at_start = scene.fine.matches(as_whole, planned),
                            at_end = scene.fine.matches(as_whole, poses);
  result.target_match = match_near_target(scene, target.setup_error * center_room_mm, poses);
  const Objective pixels(*scene.fine.as_one, level, about, {.similarity = SimilarityKind::kGradientCorrelation});
  BodyObjective objective(scene.bodies, scene.fine.apart, pixels, BodyStage().tile_mm);
  const PoseSlots slots(scene.bodies, scene.fine.apart, poses);
  const std::vector<double> at_base(PoseSlots::kParameters * slots.count(), 0.0);
  const BodyObjective::Parts parts = objective.parts(slots, at_base);
  const Eigen::MatrixXd target_motion = product(carriers.motion_per_motions(), slots.motions_of_bodies(at_base));
  const std::vector<Vector3d> points = points_near(target.setup_error * center_room_mm);
  for (std::size_t view = 0; view < level.size(); ++view) {
    ViewMatch& match = result.views[view];
    match.left_out.reset();
    match.similarity_start = at_start[view];
    match.similarity_final = at_end[view];
    // The step from the common optimum to where this view and the springs are best.
    const QuadraticModel& alone = parts.views[view];
    const Eigen::MatrixXd held =
        alone.curvature + parts.springs.curvature +
        kSpringOfOneView * Eigen::MatrixXd::Identity(alone.curvature.rows(), alone.curvature.cols());
    const Eigen::MatrixXd seen =
        product(seen_motions(level[view].view, points) / pixels_per_mm(level[view].view), target_motion);
    const auto count = static_cast<double>(points.size());
    const Eigen::VectorXd wanted = solve_symmetric(held, alone.gradient + parts.springs.gradient);
    match.contradiction = {
        .mm = product(seen, wanted).norm() / std::sqrt(count),
        .sigma_mm = std::sqrt(product(seen, solve_symmetric(held, seen.transpose())).trace() / count)};
  }
}

// Bones two vertebrae and more from the target end short of where they lie: in `chest-bent` and in bent phantoms a
// third to two thirds of the axes lay within two of the covariance's sigmas.
constexpr double kSigmaOfMotions = 2.0;

// How every bone moved against the target: where its center lies, and how it is turned, once the target is right.
std::vector<BodyMotion> motions_of(const JointedBodies& bodies, const BodyRenderers& renderers,
                                   const Carriers& carriers, const CarriedTarget& target,
                                   const Eigen::Isometry3d& planned, const BodyPoses& poses,
                                   const BodyCertainty& certainty) {
  const Eigen::MatrixXd target_motion = carriers.motion_per_motions();
  std::vector<BodyMotion> motions;
  for (std::size_t n = 0; n < bodies.bodies.size(); ++n) {
    const JointedBodies::Body& body = bodies.bodies[n];
    if (body.is_soft) continue;
    const Vector3d center = planned * renderers.center_patient_mm(n);
    const Eigen::Isometry3d against = target.setup_error.inverse() * poses[n].front() * planned.inverse();
    Eigen::MatrixXd difference = -target_motion;
    difference.middleCols<6>(static_cast<Eigen::Index>(6 * n)) += Eigen::Matrix<double, 6, 6>::Identity();
    const Eigen::Matrix<double, 3, 6> at_center = place_per_motion(poses[n].front() * renderers.center_patient_mm(n));
    const Eigen::MatrixXd per_motions = product(target.setup_error.linear().transpose() * at_center, difference);
    const Vector3d variance = propagated(per_motions, certainty.covariance).diagonal();
    Eigen::MatrixXd own = Eigen::MatrixXd::Zero(3, difference.cols());
    own.middleCols<6>(static_cast<Eigen::Index>(6 * n)) = at_center;
    motions.push_back({.name = body.name,
                       .vertebra = body.is_vertebra ? std::optional(body.vertebra) : std::nullopt,
                       .center_room_mm = center,
                       .displacement_mm = against * center - center,
                       .rotation_rad = rotation_vector(against.linear()),
                       .sigma_mm = kSigmaOfMotions * variance.cwiseSqrt(),
                       .carries_target = carriers.shares()[n],
                       .image_share = image_share(propagated(own, certainty.covariance),
                                                  propagated(own, certainty.covariance_on_loose_springs)),
                       .breathes = body.breathes});
  }
  return motions;
}

// What part of a structure goes with bones that the images determine, and that lie at one place in all views. `motions`
// are of all bodies but those of soft tissue.
double determined_share(std::span<const double> shares, const JointedBodies& bodies,
                        std::span<const BodyMotion> motions) {
  double share = 0.0;
  auto motion = motions.begin();
  for (std::size_t n = 0; n < bodies.bodies.size(); ++n) {
    if (bodies.bodies[n].is_soft) continue;
    if (motion->is_determined() && !motion->breathes) share += shares[n];
    ++motion;
  }
  return share;
}

// Structures near bones are taken to go with the bones near them.
std::vector<StructureMotion> motions_of_structures(const BentPatient& patient, const Eigen::Isometry3d& planned,
                                                   const Eigen::Isometry3d& setup_error, const BodyPoses& poses,
                                                   std::span<const BodyMotion> bones) {
  constexpr double kMost = 0.8;
  std::vector<StructureMotion> motions;
  for (const Target& structure : patient.structures) {
    const Carriers carriers(patient.parts, structure, planned, {});
    if (!carriers.exist()) continue;
    const Carriers::Off off = carriers.off_from(setup_error, poses);
    motions.push_back({.name = structure.name,
                       .displacement_mm = off.center_mm,
                       .most_mm = off.most_mm,
                       .is_determined = determined_share(carriers.shares(), patient.parts.bodies, bones) >= kMost});
  }
  return motions;
}

RenderedBodies rendered(const Volume<float>& ct_hu, const AttenuationModel& attenuation, std::span<const Beam> beams,
                        const JointedBodies& bodies, double voxel_mm) {
  const CoarserCt ct = coarser_ct(ct_hu, attenuation, block_of(ct_hu.spacing_mm(), ct_hu.size, voxel_mm));
  return {.apart = BodyRenderers(RendererKind::kCpu, ct.hu, ct.model, beams, bodies.shares),
          .as_one = make_renderer(RendererKind::kCpu, ct.hu, ct.model, beams)};
}

// Whether nothing but the whole image was chosen, and all six degrees of freedom were searched and checked.
bool can_bodies_answer(const RegistrationOptions& options, const RegistrationResult& whole) {
  const bool is_whole = options.region == nullptr || !options.region->has_volume();
  return is_whole && options.is_searched && options.dof == Dof::kRigid && options.check_alternatives &&
         whole.unobservable_room.empty();
}

// Whether parts of every view near the target have a signal and match where the whole puts them.
bool do_parts_match_near(std::span<const FixedImage> images, const Vector3d& target_room_mm,
                         const RegistrationResult& whole) {
  for (std::size_t view = 0; view < images.size(); ++view) {
    const XrayView& camera = images[view].view;
    const auto target_px = camera.project(target_room_mm);
    int with_signal = 0, disagreeing = 0;
    for (const ViewPart& part : whole.views[view].consistency.parts) {
      if (!target_px || !part.has_signal) continue;
      const double away_mm = (part.center_px - *target_px).norm() / pixels_per_mm(camera);
      if (away_mm > limits::kPartsNearMm) continue;
      if (part.disagrees && away_mm <= limits::kPartsNextToMm) return false;
      ++with_signal;
      disagreeing += part.disagrees ? 1 : 0;
    }
    if (with_signal < limits::kLeastPartsNear || limits::kOneDisagreesOf * disagreeing > with_signal) return false;
  }
  return true;
}

}  // namespace

BentPatient::BentPatient(const Volume<float>& ct_hu, const AttenuationModel& attenuation, std::span<const Beam> beams,
                         PatientBodies parts_of_patient, Target target_of_patient,
                         std::vector<Target> structures_of_patient)
    : parts(std::move(parts_of_patient)),
      target(std::move(target_of_patient)),
      structures(std::move(structures_of_patient)),
      fine(rendered(ct_hu, attenuation, beams, parts.bodies, kVoxelMm)),
      coarse(rendered(ct_hu, attenuation, beams, parts.bodies, kCoarseVoxelMm)) {}

bool may_have_bent(const RegistrationOptions& options, std::span<const FixedImage> images,
                   const RegistrationResult& whole) {
  if (!can_bodies_answer(options, whole)) return false;
  switch (whole.verdict()) {
    case Verdict::kAccepted: return !do_parts_match_near(images, target_found_room_mm(options, whole), whole);
    case Verdict::kReview: return true;
    case Verdict::kRejected: return false;
  }
  return false;
}

bool may_target_lie_elsewhere(const RendererPyramid& renderers, std::span<const FixedImage> images,
                              const RegistrationOptions& options, const RegistrationResult& whole) {
  if (!can_bodies_answer(options, whole) || whole.verdict() != Verdict::kAccepted) return false;
  const FixedViews views = compared_views(options, images);
  Renderer& renderer = renderers.with_voxels_up_to(kVoxelMm);
  const Eigen::Isometry3d& found = whole.actual_room_from_patient;
  const CoarseMatch near = match_near_target(views, renderer, found, target_found_room_mm(options, whole));
  if (near.of_all >= limits::kLeastNear || near.of_parts >= limits::kLeastPartsOfNear) return false;
  const double everywhere = match_of_parts_everywhere(views, renderer, found);
  return everywhere >= limits::kLeastEverywhere && near.of_parts < everywhere - limits::kLessThanEverywhere;
}

void register_bodies(const BentPatient& patient, std::span<const FixedImage> images,
                     const Eigen::Isometry3d& planned_room_from_patient, const RegistrationOptions& options,
                     RegistrationResult& result, const SearchProgress& progress) {
  const Stopwatch watch;
  const Carriers carriers(patient.parts, patient.target, planned_room_from_patient, patient.parts.named_carriers);
  if (!carriers.exist()) {
    result.findings.push_back({.check = Check::kNoBone});
    return;
  }
  const FixedViews fixed = compared_views(options, images);
  const BodySearchOptions search;
  const BodyScene scene{.bodies = patient.parts.bodies,
                        .fine = patient.fine,
                        .coarse = patient.coarse,
                        .views = fixed,
                        .whole_room_from_patient = result.actual_room_from_patient};
  const TargetSearchResult found = search_target(scene, carriers, search, progress);
  const BodyCertainty certainty = certainty_of(scene, found.poses, search.stages.back());
  const CarriedTarget target = carriers.target_at(found.poses, certainty);
  result.actual_room_from_patient = target.setup_error * planned_room_from_patient;
  result.uncertainty = Uncertainty{.covariance = target.covariance};
  if (result.by_imagers) result.uncertainty->covariance += result.by_imagers->covariance;
  result.target_deformation_mm = target.deformation_mm;
  result.target_image_share = target.image_share;
  std::ranges::copy(found.stages, std::back_inserter(result.stages));
  // Soft tissue may still creep. What counts is the target.
  result.stages.back().reached_limit = result.stages.back().reached_limit && target.left_mm > kConvergedMm;
  report_match(scene, carriers, target, patient.target.center_room_mm, at_one_pose(scene, planned_room_from_patient),
               found.poses, 2.0 * options.stages.back().pixel_mm, result);
  if (!result.wanted_by_views.empty()) {
    TurnedViews turned(scene, found.poses);
    result.apart = turned.apart(result.wanted_by_views);
    if (result.turn.is_clear()) result.turn.share_of_bodies_gain = turned.share_explained_by(result.turn);
  }
  result.bodies = motions_of(patient.parts.bodies, patient.fine.apart, carriers, target, planned_room_from_patient,
                             found.poses, certainty);
  result.structures =
      motions_of_structures(patient, planned_room_from_patient, target.setup_error, found.poses, result.bodies);
  std::ranges::copy(found.alternatives, std::back_inserter(result.alternatives));
  result.findings = findings_about(parameters_from_setup_error(target.setup_error), options, result);
  result.seconds += watch.seconds();
}

}  // namespace isoshift
