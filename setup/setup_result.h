#pragma once
// The result of a setup registration: what registration found, what was registered, and what a site decided about it.
// Every format is made from it, so that no two can disagree.

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "setup/couch_shift.h"
#include "setup/identity.h"
#include "setup/registration.h"
#include "setup/site_rules.h"
#include "setup/start.h"
#include "setup/target.h"
#include "setup/view_picture.h"

namespace isoshift {

// Frames and signs: docs/conventions.md.
struct SetupResult : Registration {
  struct View {
    std::string label;
    std::string sop_class_uid, sop_instance_uid;
    std::string sha256;                                          // of the file
    int frame = 1;                                               // of the instance, counted from 1
    std::string acquired;                                        // "2026-03-01 10:15:00"; empty: unknown
    std::string origin;                                          // ReportedValuesOrigin: ACTUAL, PLAN; empty: unknown
    std::optional<double> gantry_deg;                            // absent for a view given by its matrix
    std::string machine;                                         // RadiationMachineName; empty: unknown
    std::optional<Eigen::Matrix<double, 3, 4>> pixel_from_room;  // XrayView's
    std::optional<double> sid_mm;                                // RTImageSID, or what supplied it
    Eigen::Vector3d source_room_mm = Eigen::Vector3d::Zero();
    double pixel_mm = 0.0;  // at the isocenter
    int columns = 0, rows = 0;
    bool is_megavoltage = false;
    bool is_receptor_corrected = false;  // by a machine profile: pixel_from_room is not that of the files
    ViewMatch match;
    ViewPicture picture;
  };
  // A point of the patient at which a person wants to know what remains after the couch shift.
  struct Point {
    std::string name;
    Eigen::Vector3d room_mm = Eigen::Vector3d::Zero();  // as planned, from the isocenter, IEC 61217 fixed
  };

  std::string made_on;  // local time, "2026-03-01T10:16:02+0100"
  std::string version, commit;
  std::optional<SiteRules> site;

  Identity identity;  // for reports that people read; not in file names or logs
  std::string plan_label, plan_approval, plan_sha256;
  std::string patient_position;
  Eigen::Vector3d isocenter_patient_mm = Eigen::Vector3d::Zero();
  TableAngles table;
  std::optional<Eigen::Vector3d> table_position_mm;  // lateral, longitudinal, vertical read-outs at imaging, IEC 61217
  std::vector<Point> points;
  std::optional<Target> target;
  Eigen::Isometry3d setup_error = Eigen::Isometry3d::Identity();
  bool translation_only = false;
  std::optional<Start> start;  // nothing: the planned pose
  bool is_searched = true;     // false: the pose is that of the start, and was only judged

  std::vector<View> views;
  std::string preset = "setup";
  std::vector<std::string> region;  // what was chosen to be compared, in words; empty: everything
  std::uint64_t seed = 1;
  std::string attenuation;
  double threshold_hu = 0.0;
  std::optional<std::array<double, 2>> window_hu;                      // low, high; where attenuation is windowed
  std::vector<std::pair<std::string, std::string>> renderer_settings;  // name and value of each setting of the renderer
  double seconds_load = 0.0, seconds_total = 0.0;

  struct Machine {
    std::string name, sha256;
  };
  std::optional<Machine> machine;        // the machine profile that was applied
  std::string ct_series_uid, ct_sha256;  // of all its slices' files
  std::string ct_frame_uid;              // FrameOfReferenceUID
  std::string structure_set_uid;         // empty: there was none
  std::string plan_uid, plan_class_uid;  // empty: there was no plan
  std::string spatial_registration_uid;  // empty: none was written
  std::vector<std::string> overrides, warnings, left_aside;
};

// A setup error without its part along directions that were not measured, since no number may be made from that part.
Eigen::Isometry3d known_setup_error(Eigen::Isometry3d setup_error,
                                    const std::vector<Eigen::Vector3d>& unobservable_room);
inline Eigen::Isometry3d known_setup_error(const SetupResult& result) {
  return known_setup_error(result.setup_error, result.unobservable_room);
}

}  // namespace isoshift
