#pragma once
// Follows a target from X-ray to X-ray: every moment is registered from where the filter expects the target, and
// corrects the filter.

#include <memory>
#include <optional>
#include <vector>

#include "drr/renderer_pyramid.h"
#include "registration/motion/kalman.h"
#include "registration/motion/predictor.h"
#include "registration/region.h"
#include "registration/search.h"

namespace isoshift {

struct TrackingOptions {
  Dof dof = Dof::kTranslation;
  double box_mm = 12.0;               // the search box about the expected position
  double box_rad = 0.05;              // the same for rotations
  double first_reach_mm = 25.0;       // about the planned position, until the target is found, and after it is lost
  double pixel_mm = 1.0;              // at the isocenter
  double measurement_sigma_mm = 0.3;  // of a registration, per axis that is seen
  double lost_share = 0.6;            // of the usual similarity: with less, the registration has failed
  double latency_s = 0.3;             // from an X-ray to the beam
  PredictorKind predictor = PredictorKind::kRls;
  PredictorOptions predictor_options;
  std::uint64_t seed = 1;
};

enum class FrameStatus {
  kMeasured,  // in all directions
  kPartly,    // not along the direction of the views: the filter predicts that component
  kBridged,   // the registration failed: the filter predicts all components
};
std::string_view to_string(FrameStatus status);

// Positions are displacements of the target from where it was planned, mm, IEC 61217 fixed.
struct TrackedFrame {
  double time_s = 0.0;
  FrameStatus status = FrameStatus::kBridged;
  bool is_known = false;                       // the target has been found by now; else the numbers below mean nothing
  bool is_lost = false;                        // for several moments
  std::optional<Eigen::Vector3d> measured_mm;  // components along an unseen direction come from the filter
  Eigen::Vector3d filtered_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d predicted_mm = Eigen::Vector3d::Zero();  // for one latency later
  Eigen::Vector3d sigma_mm = Eigen::Vector3d::Zero();      // of filtered_mm, one standard deviation
  bool is_warm = false;                                    // the predictor has seen enough
  std::vector<Eigen::Vector3d> unseen_room;                // unit directions along which the views cannot tell
  double similarity = 0.0;
};

class Tracker {
 public:
  // Renderers and region are borrowed. The target is a point of the patient.
  Tracker(const RendererPyramid& renderers, const ProjectedRegion& region,
          const Eigen::Isometry3d& planned_room_from_patient, const Eigen::Vector3d& target_patient_mm,
          TrackingOptions options);

  // Registers the views of one moment, which is later than all before. If there are no views, because none could be
  // used, the filter bridges the moment. Throws UsageError for a time that does not advance.
  TrackedFrame track(double time_s, std::vector<FixedImage> views);

 private:
  struct Found {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    double similarity = 0.0;
    bool at_bound = false;
  };
  std::optional<Found> find(const FixedViews& views, const Eigen::Vector3d& expected_mm,
                            const std::vector<Eigen::Vector3d>& unseen) const;
  bool is_lost(const Found& found, const std::vector<Eigen::Vector3d>& unseen) const;

  const RendererPyramid& renderers_;
  const ProjectedRegion& region_;
  Eigen::Isometry3d planned_;
  Eigen::Vector3d target_patient_mm_;
  TrackingOptions options_;
  ConstantVelocityKalman filter_;
  std::unique_ptr<Predictor> predictor_;
  Eigen::Matrix3d rotation_ = Eigen::Matrix3d::Identity();  // of the last pose, for six DOF
  std::vector<double> similarities_;                        // of the last good ones
  std::optional<double> last_time_s_, last_measured_s_;
  int lost_in_a_row_ = 0;
};

}  // namespace isoshift
