#pragma once
// Whether a Spatial Registration object, of any program, says what it means, and who would read it otherwise: what
// dciodvfy cannot know (docs/dicom.md, 4.5 and 6.3).

#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace isoshift {

struct RegistrationFinding {
  bool is_error = false;  // against the standard, or read differently by programs; else only worth knowing
  std::string text;
};

struct CheckedRegistration {
  std::string registered_frame_uid;       // dataset-level Frame of Reference UID: usually the planning CT's
  std::string source_frame_uid;           // of the item that is not the identity
  bool source_is_that_of_images = false;  // that item lists images: their frame's origin may lie anywhere
  // Takes a point of the source frame to the registered one (PS3.3 C.20.2.1.1), as it stands in the file, if there is
  // one such matrix of 16 numbers. It need not be rigid: the findings say.
  std::optional<Eigen::Affine3d> registered_from_source;
  std::vector<RegistrationFinding> findings;

  bool has_errors() const;
};

// Throws Error for a file that is no Spatial Registration.
CheckedRegistration check_registration(const std::filesystem::path& path);

// How far two registrations of the same frames lie apart.
struct RegistrationDifference {
  double translation_mm = 0.0;  // between where the two have the machine's isocenter (the source's origin) in the CT
  double angle_rad = 0.0;
  bool other_is_inverted = false;  // the inverse of the other one lies much nearer
};
RegistrationDifference difference_between(const Eigen::Isometry3d& registered_from_source,
                                          const Eigen::Isometry3d& other);

}  // namespace isoshift
