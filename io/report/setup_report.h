#pragma once
// The one page model: every format of the result is made from it, so that no two can disagree.

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/config/site_file.h"
#include "io/dicom/identity.h"
#include "io/report/view_picture.h"
#include "setup/couch_shift.h"
#include "setup/verdict.h"

namespace isoshift {

// Angles in degrees here: this is where numbers meet people. Frames and signs: docs/conventions.md.
struct SetupReport {
  // A square of a view, and where it matches the DRR best.
  struct Part {
    Eigen::Vector2d center_px = Eigen::Vector2d::Zero();
    double width_px = 0.0;
    Eigen::Vector2d displacement_mm = Eigen::Vector2d::Zero();  // along columns and rows, at the isocenter
    double correlation = 0.0, best_correlation = 0.0;           // where the pose puts it, and there
    bool has_signal = false, disagrees = false;
  };
  struct View {
    std::string label;
    std::string sop_class_uid, sop_instance_uid;
    std::string sha256;                // of the file
    int frame = 1;                     // of the instance, counted from 1
    std::string acquired;              // "2026-03-01 10:15:00"; empty: unknown
    std::string origin;                // ReportedValuesOrigin: ACTUAL, PLAN; empty: unknown
    std::optional<double> gantry_deg;  // absent for a view given by its matrix
    Eigen::Vector3d source_room_mm = Eigen::Vector3d::Zero();
    double pixel_mm = 0.0;  // at the isocenter
    int columns = 0, rows = 0;
    bool is_megavoltage = false;
    double similarity_start = -1.0;
    double similarity_final = -1.0;
    std::optional<double> left_out_mm, left_out_deg;  // how far the pose moves without this view
    std::vector<Part> parts;
    ViewPicture picture;
  };
  struct Stage {
    std::string name;
    std::string similarity;
    std::string optimizer;
    std::vector<std::pair<std::string, double>> parameters;  // what the preset says, by name
    int evaluations = 0;
    double seconds = 0.0;
    double value = 0.0;  // the similarity reached
    std::string termination;
    std::optional<double> spread_mm, spread_deg;  // between searches from different starts
    std::vector<double> best;                     // the similarity reached so far, evaluation by evaluation
  };
  struct Sigma {
    Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();
    Eigen::Vector3d rotation_deg = Eigen::Vector3d::Zero();
  };
  // What the images would match like if they were not what they say they are.
  struct Alternative {
    std::string description;
    double similarity = 0.0;
    double as_is = 0.0;
  };

  // What the site's file decided about this result.
  struct Site {
    std::string name, sha256;
    std::string anatomy;               // whose action level it is
    std::optional<ActionLevel> level;  // unset: none
    CouchDof couch_dof = CouchDof::kSix;
    std::optional<SiteFile::Scale> couch_scale;
    LengthUnit length_unit = LengthUnit::kMm;
    std::optional<SiteFile::Release> automatic_release;
  };
  // A point of the patient at which a person wants to know what is left over.
  struct Point {
    std::string name;
    Eigen::Vector3d room_mm = Eigen::Vector3d::Zero();  // as planned, from the isocenter, IEC 61217 fixed
  };

  std::string made_on;  // local time, "2026-03-01T10:16:02+0100"
  std::string version, commit;
  Verdict verdict = Verdict::kRejected;
  std::vector<std::string> reasons;
  std::optional<Site> site;

  Identity identity;  // for reports that people read; not in file names or logs
  std::string plan_label, plan_approval, plan_sha256;
  std::string patient_position;
  Eigen::Vector3d isocenter_patient_mm = Eigen::Vector3d::Zero();
  TableAngles table;
  std::optional<Eigen::Vector3d> table_position_mm;  // lateral, longitudinal, vertical read-outs at imaging, IEC 61217
  std::vector<Point> points;
  Eigen::Isometry3d setup_error = Eigen::Isometry3d::Identity();
  std::vector<Eigen::Vector3d> unobservable_room;
  bool translation_only = false;
  std::optional<Sigma> sigma;  // one standard deviation, IEC 61217 fixed

  std::vector<View> views;
  std::vector<Stage> stages;
  std::vector<Alternative> alternatives;
  std::string preset = "setup";
  std::vector<std::string> region;  // what was chosen to be compared, in words; empty: everything
  std::uint64_t seed = 1;
  std::string attenuation;
  double threshold_hu = 0.0;
  std::optional<std::array<double, 2>> window_hu;  // low, high; where attenuation is windowed
  std::string renderer, device;
  std::vector<std::pair<std::string, std::string>> renderer_settings;  // name and value of what it was asked to do
  double seconds_load = 0.0, seconds_register = 0.0, seconds_total = 0.0;
  double seconds_rendering = 0.0, seconds_similarity = 0.0;  // of seconds_register

  struct Machine {
    std::string name, sha256;
  };
  std::optional<Machine> machine;        // the machine profile that was applied
  std::string ct_series_uid, ct_sha256;  // of all its slices' files
  std::string plan_uid, plan_class_uid;  // empty: there was no plan
  std::string spatial_registration_uid;  // empty: none was written
  std::vector<std::string> overrides, warnings, left_aside;
};

// Whether the shift is larger than the site's action level. kUnset: there is none, or it cannot be told.
enum class Action { kUnset, kWithin, kExceeds };
std::string_view to_string(Action action);

// What may be shown of the result: components along an unobservable direction are absent, and without a shift
// (rejected) all of the couch's are.
struct ShownShift {
  std::array<std::optional<double>, 3> setup_error_mm;  // x, y, z, IEC 61217 fixed
  std::array<double, 3> setup_error_deg;                // rx, ry, rz of R = Rz Rx Ry
  std::array<std::optional<double>, 3> sigma_mm;        // x, y, z; absent where the component is
  std::array<std::optional<double>, 3> sigma_deg;       // about x, y, z
  bool withheld = false;                                // the verdict forbids a couch shift
  std::array<std::optional<double>, 3> couch_mm;        // lateral, longitudinal, vertical
  std::array<std::optional<double>, 3> couch_sigma_mm;
  std::array<double, 3> couch_deg;         // yaw, pitch, roll: change of the read-outs
  std::array<double, 3> couch_target_deg;  // yaw, pitch, roll: resulting read-outs
  std::array<bool, 3> can_rotate;          // yaw, pitch, roll: whether the site's couch can
  // What remains when it has applied what it can: at the isocenter, 50 mm from it along the patient, and at the points
  // of the report. Nothing where a component is not determined.
  struct LeftOver {
    std::string at;
    Eigen::Vector3d mm = Eigen::Vector3d::Zero();  // IEC 61217 fixed
  };
  std::vector<LeftOver> left_over;
  Action action = Action::kUnset;
  std::vector<std::string> action_reasons;
};
ShownShift shown_shift(const SetupReport& report);

// The setup error without what lies along directions that were not measured: no number is made from that.
Eigen::Isometry3d known_setup_error(const SetupReport& report);

}  // namespace isoshift
