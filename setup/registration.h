#pragma once
// What registration finds, as plain data: registration fills it, reports print it.

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "setup/finding.h"
#include "setup/irradiated_field.h"
#include "setup/verdict.h"

namespace isoshift {

// A square of a view, and where it matches the DRR best within a search distance.
struct ViewPart {
  Eigen::Vector2d center_px = Eigen::Vector2d::Zero();  // in the X-ray as acquired
  double width_px = 0.0;
  Eigen::Vector2d displacement_mm = Eigen::Vector2d::Zero();  // along columns and rows, at the isocenter
  double correlation = 0.0;                                   // of X-ray and DRR where the pose puts it
  double best_correlation = 0.0;                              // where it matches best
  bool has_signal = false;                                    // it matches clearly somewhere
  bool disagrees = false;  // it has signal, and matches elsewhere than the pose puts it
};

struct ViewConsistency {
  std::vector<ViewPart> parts;
  int with_signal() const;
  int disagreeing() const;
};

// How far the pose moves when one view is left out: translation at the isocenter and angle.
struct LeftOutView {
  double distance_mm = 0.0;
  double angle_rad = 0.0;
};

// How far one view alone would want the anatomy from where all views together put it, as root mean square over 100 mm
// about the isocenter, in this view; and how far it would be expected to, if the views agreed.
struct Contradiction {
  double mm = 0.0;
  double sigma_mm = 0.0;
};

// The motion that one view alone would want of the patient as a whole, on top of the pose that all views together want:
// in the room and about the isocenter, its translation (mm) and then its rotation vector (rad). What the view hardly
// sees has a large variance. Errors of the view's geometry are in it (isoshift qa geometry).
struct WantedMotion {
  Eigen::Matrix<double, 6, 1> motion = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

// How well one view matches: gradient correlation over all compared pixels, twice as large as those of the last stage.
struct ViewMatch {
  std::string label;  // of the X-ray
  double similarity_start = -1.0;
  double similarity_final = -1.0;
  bool has_all_excluded = true;  // false: what should be excluded covers nearly all of the view, and was compared
  IrradiatedField field;         // in which it was compared
  ViewConsistency consistency;   // of its parts with the pose found
  std::optional<LeftOutView> left_out;         // with three or more views
  std::optional<Contradiction> contradiction;  // with two or more views
  std::optional<WantedMotion> wanted;          // likewise, if rotations were searched, too
};

// How well the images would match if they were not what they say they are.
struct Alternative {
  std::string description;    // "view 1 mirrored"
  double similarity = 0.0;    // gradient correlation that the search reaches with this alternative,
  double as_is = 0.0;         // and that the same search reaches with the images as they are
  double distance_mm = 0.0;   // between the poses found: translation at the isocenter,
  double angle_rad = 0.0;     // and rotation
  bool is_ruled_out = false;  // by the probability of all that the images show of the bodies, not by similarity
};

// How far the setup error found may lie from the true one: the covariance of the motion between the two, in the room
// and about the isocenter, of the translation (mm) and then the rotation vector (rad).
struct Uncertainty {
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();

  // One standard deviation per axis: of where the isocenter's anatomy lies, of where anatomy lies that is found at a
  // point, and of the rotation vector.
  Eigen::Vector3d sigma_translation_mm() const;
  Eigen::Vector3d sigma_at_mm(const Eigen::Vector3d& found_room_mm) const;
  Eigen::Vector3d sigma_rotation_rad() const;

  // Of where anatomy lies that is found at a point.
  Eigen::Matrix3d covariance_at_mm2(const Eigen::Vector3d& found_room_mm) const;
};

// From one standard deviation per axis.
Uncertainty uncertainty_of_independent_axes(const Eigen::Vector3d& translation_mm, const Eigen::Vector3d& rotation_rad);

struct StageReport {
  std::string name;
  std::string similarity;
  std::string optimizer;
  std::vector<std::pair<std::string, double>> parameters;  // what the preset says; the names end with the unit
  int evaluations = 0;
  double seconds = 0.0;
  double value = 0.0;  // the similarity reached
  std::string termination = "not run";
  bool reached_limit = false;  // the evaluations ran out before the search converged
  // If the stage searched from several starts: how far the poses at which they ended lie from the best of these poses,
  // at most. Poses that match clearly worse than the best one (a tenth more is unexplained) do not count.
  std::optional<double> spread_mm, spread_rad;
  std::vector<double> best;  // the similarity reached after each evaluation
};

// What a rigid part of the patient did against the target: how far its center lies off once the target is right, and
// how it is turned there.
struct BodyMotion {
  std::string name;
  std::optional<int> vertebra;  // counted from the one nearest to the target, positive toward the head; nothing: none
  Eigen::Vector3d center_room_mm = Eigen::Vector3d::Zero();  // as planned, mm from the isocenter, IEC 61217 fixed
  Eigen::Vector3d displacement_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero();  // rotation vector
  Eigen::Vector3d sigma_mm = Eigen::Vector3d::Zero();      // one standard deviation of the displacement
  double carries_target = 0.0;                             // its share of the target; all shares add up to 1
  double image_share = 0.0;  // of what is known about its place, in the direction known least; springs are the rest
  bool breathes = false;     // it may lie elsewhere in every view: these numbers are of the first one

  // Whether the images, and not only the springs to its neighbors, say where it lies.
  bool is_determined() const;
};

// How far a drawn structure lies off once the target is right, if it goes with the bones near it.
struct StructureMotion {
  std::string name;
  Eigen::Vector3d displacement_mm = Eigen::Vector3d::Zero();  // of its center
  double most_mm = 0.0;                                       // of points of its surface
  bool is_determined = true;                                  // the bones near it are, and do not breathe
};

// How well X-rays and DRRs match where the target was found: correlations of their gradients, mean over the views.
struct TargetMatch {
  // On pixels of 2 mm, of the 70 % of the pixels that agree best: what has changed in some places (metal, fluid) is
  // trimmed away, while another patient or another vertebra disagrees in most. Within 20 mm, because a small target
  // that moved by itself could be trimmed away in 40 mm.
  double of_most_within_40_mm = 0.0, of_most_within_20_mm = 0.0;
  // On pixels of 4 mm, where noise and coarse images hardly count, within 40 mm: of all pixels; and of small parts each
  // for itself, their median, weighted by the gradients of the DRR.
  double of_all = 0.0, of_parts = 0.0;
};

struct Registration {
  std::vector<Finding> findings = {{.check = Check::kNotRun, .consequence = Verdict::kRejected}};
  std::string renderer, device;   // what rendered the DRRs
  std::string compared_with_cpu;  // how well rays of the DRRs from a GPU agree with those of the CPU
  Eigen::Isometry3d actual_room_from_patient = Eigen::Isometry3d::Identity();
  std::vector<Eigen::Vector3d> unobservable_room;  // unit directions along which the views cannot tell
  std::optional<Uncertainty> uncertainty;          // nothing: the images do not determine the pose
  std::optional<Uncertainty> by_imagers;           // the imagers' part of it; nothing: no machine profile tells of any
  std::vector<StageReport> stages;
  std::vector<Alternative> alternatives;  // empty: the preset does not check them
  // Where the patient has bent: what bones did against the target. The pose is then the target's. Empty: the patient as
  // a whole was registered.
  std::vector<BodyMotion> bodies;
  std::vector<StructureMotion> structures;  // other than the target, near bones; where bodies answered
  double target_image_share = 0.0;  // of what is known about where the target lies; springs between bodies are the rest
  TargetMatch target_match;
  double target_deformation_mm = 0.0;  // how far the target's surface lies from where a rigid motion puts it, at most
  double seconds = 0.0, seconds_rendering = 0.0, seconds_similarity = 0.0;  // in all, and of that in the search

  Verdict verdict() const { return verdict_of(findings); }
  std::vector<std::string> reasons() const { return in_words(findings); }  // why the verdict is not `accepted`
  int evaluations() const;
};

}  // namespace isoshift
