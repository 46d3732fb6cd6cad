#pragma once
// A phantom study small enough to be made, broken and read in every test.

#include <Eigen/Core>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "io/dicom/dicom_dataset.h"
#include "phantom/study_writer.h"
#include "tests/support/command.h"
#include "tests/support/temporary_folder.h"

namespace isoshift {

// 4 mm voxels and 96 x 96 pixels, without noise: quick, and precise enough for what uses it.
PhantomOptions small_phantom();

// A study folder with one phantom in it. Tests change its files with edit().
class SmallStudy {
 public:
  SmallStudy();  // that of small_phantom(), copied from testdata/small/1: its first fraction
  explicit SmallStudy(const PhantomOptions& options);

  std::filesystem::path path() const { return folder_ / "study"; }
  std::filesystem::path output() const { return folder_ / "result"; }
  std::filesystem::path ct_slice(int k) const;
  std::filesystem::path image(int n) const;  // 0: gantry 0, 1: gantry 90
  std::filesystem::path plan() const { return path() / "RTPLAN.dcm"; }
  std::filesystem::path structures() const { return path() / "RTSTRUCT.dcm"; }  // there once drawn: draw()
  std::filesystem::path truth() const { return path() / "truth.json"; }

 private:
  TemporaryFolder folder_;
};

// A structure as a planning system would write it.
struct DrawnStructure {
  std::string name;
  std::vector<std::vector<Eigen::Vector3d>> contours;  // patient mm
  std::string geometric_type = "CLOSED_PLANAR";
};

// Writes the study's structure set, of its patient and in its frame of reference: numbered from 1, all of type ORGAN.
void draw(const SmallStudy& study, const std::vector<DrawnStructure>& structures);

// A rectangle around `center_mm` in the plane of its z.
std::vector<Eigen::Vector3d> rectangle(const Eigen::Vector3d& center_mm, double width_mm, double height_mm);

// isoshift register STUDY -o OUTPUT, with more arguments.
CommandOutcome register_study(const SmallStudy& study, const std::vector<std::string>& more = {});

// The result.json that this has written.
nlohmann::json result_of(const SmallStudy& study);

// Puts the second image into the first one's file: two frames, each with its item in the Exposure Sequence.
void join_images(const SmallStudy& study);

// Changes a DICOM file in place.
void edit(const std::filesystem::path& path, const std::function<void(DicomItem)>& change);

}  // namespace isoshift
