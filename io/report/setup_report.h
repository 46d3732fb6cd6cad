#pragma once
// The one page model: every format of the result is made from it, so that no two can disagree.

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "geometry/couch_shift.h"
#include "geometry/verdict.h"

namespace isoshift {

// Angles in degrees here: this is where numbers meet people. Frames and signs: docs/conventions.md.
struct SetupReport {
  struct View {
    std::string label;
    std::string sop_instance_uid;
    double gantry_deg = 0.0;
    double similarity_start = -1.0;
    double similarity_final = -1.0;
  };
  struct Stage {
    std::string name;
    std::string similarity;
    int evaluations = 0;
    double seconds = 0.0;
    std::string termination;
  };

  Verdict verdict = Verdict::kRejected;
  std::vector<std::string> reasons;

  std::string patient_id, patient_name;  // for the report a person reads; not in file names or logs
  std::string plan_label;
  std::string patient_position;
  Eigen::Vector3d isocenter_patient_mm = Eigen::Vector3d::Zero();
  TableAngles table;
  Eigen::Isometry3d setup_error = Eigen::Isometry3d::Identity();
  std::vector<Eigen::Vector3d> unobservable_room;
  bool translation_only = false;

  std::vector<View> views;
  std::vector<Stage> stages;
  std::string preset = "setup";
  std::uint64_t seed = 1;
  std::string attenuation;
  double threshold_hu = 0.0;
  std::optional<std::array<double, 2>> window_hu;  // low, high; where attenuation is windowed
  std::string renderer, device;
  std::vector<std::pair<std::string, std::string>> renderer_settings;  // name and value of what it was asked to do
  double seconds_load = 0.0, seconds_register = 0.0, seconds_total = 0.0;

  std::string ct_series_uid;
  std::string plan_uid;                  // empty: there was no plan
  std::string spatial_registration_uid;  // empty: none was written
  std::vector<std::string> overrides, warnings, left_aside;
};

// What may be shown of the result: components along an unobservable direction are absent, and without a shift
// (rejected) all of the couch's are.
struct ShownShift {
  std::array<std::optional<double>, 3> setup_error_mm;  // x, y, z, IEC 61217 fixed
  std::array<double, 3> setup_error_deg;                // rx, ry, rz of R = Rz Rx Ry
  bool withheld = false;                                // the verdict forbids a couch shift
  std::array<std::optional<double>, 3> couch_mm;        // lateral, longitudinal, vertical
  std::array<double, 3> couch_deg;                      // yaw, pitch, roll: change of the read-outs
  std::array<double, 3> couch_target_deg;               // yaw, pitch, roll: resulting read-outs
};
ShownShift shown_shift(const SetupReport& report);

// One rounding for every format a person reads: to 0.1, halves away from zero, with sign, "-0.0" never.
std::string rounded(double value);

// result.json, full precision. docs/result.schema.json describes it.
std::string json_report(const SetupReport& report);

// report.txt, for a person.
std::string text_report(const SetupReport& report);

}  // namespace isoshift
