#pragma once
// From a folder to everything one registration needs, checked: DICOM ends here.

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "geometry/patient_setup.h"
#include "geometry/xray_image.h"
#include "io/ct_series.h"
#include "io/notes.h"
#include "io/rt_image.h"
#include "io/rt_plan.h"

namespace isoshift {

// The files below some paths, sorted by what they are.
struct StudyFiles {
  struct LeftAside {
    std::filesystem::path path;
    std::string reason;
  };
  std::map<std::string, std::vector<std::filesystem::path>> ct_series;  // by SeriesInstanceUID
  std::vector<std::filesystem::path> rt_images;
  std::vector<std::filesystem::path> rt_plans;
  std::vector<std::filesystem::path> rt_structures;
  std::vector<LeftAside> left_aside;
};

// Reads the headers of all files below `paths` (files or folders), in the order of their names. A file that is no DICOM
// is left aside; one that begins as DICOM and cannot be read is an Error.
StudyFiles scan_study(const std::vector<std::filesystem::path>& paths);

// What to register and what a person supplies or allows.
struct StudyRequest {
  std::filesystem::path study;                // a folder (or file) searched for all parts not named below
  std::vector<std::filesystem::path> ct;      // folders or files of the CT
  std::vector<std::filesystem::path> images;  // RT Images
  std::optional<std::filesystem::path> plan;
  std::optional<Eigen::Vector3d> isocenter_patient_mm;
  RtImageSwitches switches;
  Allowances allowed;
};

struct Study {
  CtSeries ct;
  std::optional<RtPlan> plan;
  std::vector<RtImage> rt_images;  // headers with switches applied, in order of acquisition
  std::vector<XrayImage> xrays;    // the same images, ready for registration
  PatientPosition patient_position = PatientPosition::kHfs;
  TableAngles table;  // at imaging, the same for all views
  Eigen::Vector3d isocenter_patient_mm = Eigen::Vector3d::Zero();
  Eigen::Isometry3d planned_room_from_patient = Eigen::Isometry3d::Identity();
};

// Finds, reads and checks the parts. Everything the images lack is reported in one Error, with the switch that supplies
// it; so is every check that fails without being allowed.
Study load_study(const StudyRequest& request, Notes& notes, const Progress& progress);

}  // namespace isoshift
