#pragma once
// Checks a Spatial Registration object of any program for faults that dciodvfy cannot see: objects that contradict
// themselves, and objects that some programs read differently (docs/dicom.md, 4.5 and 6.3).

#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "io/dicom/identity.h"

namespace isoshift {

struct RegistrationFinding {
  bool is_error = false;  // against the standard, or read differently by programs; else only worth knowing
  std::string text;
};

struct CheckedRegistration {
  std::filesystem::path path;
  Identity identity;
  bool is_by_isoshift = false;                     // its Manufacturer says so
  std::string registered_frame_uid;                // dataset-level Frame of Reference UID: usually the planning CT's
  std::string source_frame_uid;                    // of the one item of another frame
  bool source_is_that_of_images = false;           // that item lists images: their frame's origin may lie anywhere
  std::set<std::string> referenced_instance_uids;  // of all images and objects that it names anywhere
  // Takes a point of the source frame to the registered one (PS3.3 C.20.2.1.1), as it stands in the file, if there is
  // one such matrix of 16 numbers. It need not be rigid: the findings say.
  std::optional<Eigen::Affine3d> registered_from_source;
  std::vector<RegistrationFinding> findings;

  void error(std::string text) { findings.push_back({.is_error = true, .text = std::move(text)}); }
  void note(std::string text) { findings.push_back({.is_error = false, .text = std::move(text)}); }
  bool has_errors() const;
};

// Throws Error for a file that is not a Spatial Registration.
CheckedRegistration check_registration(const std::filesystem::path& path);

}  // namespace isoshift
