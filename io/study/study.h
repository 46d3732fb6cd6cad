#pragma once
// Makes the checked input of one registration from a folder. Code that uses a Study needs no DICOM.

#include <memory>
#include <optional>
#include <vector>

#include "geometry/patient_setup.h"
#include "geometry/xray_image.h"
#include "io/config/machine_profile.h"
#include "io/dicom/notes.h"
#include "io/dicom/rt_image.h"
#include "io/dicom/rt_plan.h"
#include "io/dicom/rt_structures.h"
#include "io/study/ct_store.h"
#include "io/study/session.h"
#include "io/study/study_files.h"

namespace isoshift {

// What to register, and what the user supplies or allows.
struct StudyRequest {
  StudyParts parts;
  std::optional<Eigen::Vector3d> isocenter_patient_mm;
  RtImageSwitches switches;
  std::optional<MachineProfile> machine;
  Allowances allowed;
  double max_span_s = kDefaultUntoldSpanS;  // views without table read-outs that are further apart need a review
  bool one_per_imager = false;  // uses only the earliest X-ray of each label: the others show a moving target later
};

struct Study {
  std::shared_ptr<const CtSeries> ct;
  std::optional<RtPlan> plan;
  std::optional<RtStructures> structures;
  UnusedStructures unused_structures;              // where there are none
  std::vector<std::filesystem::path> image_files;  // of all X-rays of the study, including those that are not used
  std::vector<RtImage> rt_images;  // headers with machine profile and switches applied, in order of acquisition
  std::vector<XrayImage> xrays;    // the same images, ready for registration
  std::optional<MachineProfile> machine;
  PatientPosition patient_position = PatientPosition::kHfs;
  TableAngles table;  // at imaging, the same for all views
  Eigen::Vector3d isocenter_patient_mm = Eigen::Vector3d::Zero();
  Eigen::Isometry3d planned_room_from_patient = Eigen::Isometry3d::Identity();
  std::vector<std::string> doubts;  // why every result of this study needs a person's review
};

// Finds, reads and checks the parts of the study. One Error names every attribute that the images lack, with the switch
// that supplies it, and every failed check that was not allowed. The CT is taken from the store if it was read last.
Study load_study(const StudyRequest& request, Notes& notes, const Progress& progress, CtStore& cts);
inline Study load_study(const StudyRequest& request, Notes& notes, const Progress& progress) {
  CtStore none;
  return load_study(request, notes, progress, none);
}

}  // namespace isoshift
