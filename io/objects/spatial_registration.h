#pragma once
// DICOM Spatial Registration (PS3.3 A.39, C.20.2): item 1 the planning CT with an exact identity, item 2 the treatment
// frame of reference with the one matrix that takes it to the CT.

#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/dicom/dicom_dataset.h"
#include "io/study/study.h"

namespace isoshift {

// Takes a point of the treatment frame to the planning CT: p_ct = M p_treatment. The treatment frame has its origin at
// the machine's isocenter and the axes of the patient as nominally set up (PS3.3 C.20.2.1.1; docs/dicom.md, 4.4). Its
// translation column is the point of the CT that now lies at the machine's isocenter.
Eigen::Isometry3d ct_from_treatment(const Eigen::Isometry3d& planned_room_from_patient,
                                    const Eigen::Isometry3d& actual_room_from_patient);

// The inverse: where the patient lies, from that matrix.
Eigen::Isometry3d actual_room_from_patient(const Eigen::Isometry3d& planned_room_from_patient,
                                           const Eigen::Isometry3d& ct_from_treatment);

// The well-known frame of reference "IEC 61217 Fixed Coordinate System Frame of Reference" (PS3.6, table A-2).
inline constexpr const char* kIecFixedFrameUid = "1.2.840.10008.1.4.3.1";

// Which frame the registration takes to the CT: the treatment frame, or the room's own axes.
enum class RegistrationSource { kTreatment, kIecFixed };

// What ContentLabel and ContentDescription say of an accepted pose, of one that a person must review, and of one that
// was set by hand.
inline constexpr const char *kLabelOfAccepted = "SETUP_2D3D", *kLabelOfReview = "SETUP_REVIEW",
                            *kLabelOfHand = "SETUP_BY_HAND", *kReviewDescription = "NOT ACCEPTED: REVIEW",
                            *kHandDescription = "SET BY HAND: REVIEW";

struct SpatialRegistrationOptions {
  std::string content_label = kLabelOfAccepted;  // CS
  std::string content_description;               // LO
  RegistrationSource source = RegistrationSource::kTreatment;
};

// Writes the object whole or not at all, reads it back and compares. Returns its SOP Instance UID. Adds a warning where
// the images' frame of reference had to be replaced.
std::string write_spatial_registration(const Study& study, const Eigen::Isometry3d& actual_room_from_patient,
                                       const SpatialRegistrationOptions& options, const std::filesystem::path& path,
                                       Notes& notes);

// A Spatial Registration object of any program. Throws Error for anything else.
DicomFile open_spatial_registration(const std::filesystem::path& path);

// The part of a Spatial Registration that positions patients: per item the source frame and the composed matrix.
struct SpatialRegistration {
  struct Item {
    std::string frame_of_reference_uid;
    Eigen::Isometry3d registered_from_source = Eigen::Isometry3d::Identity();
  };
  std::string sop_instance_uid;
  std::string frame_of_reference_uid;  // the registered frame
  std::vector<Item> items;
};

// Throws Error for a matrix that is not rigid within 1e-4.
SpatialRegistration read_spatial_registration(const std::filesystem::path& path);

}  // namespace isoshift
