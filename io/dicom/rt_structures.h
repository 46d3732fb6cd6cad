#pragma once
// RT Structure Set: what was drawn on the planning CT (PS3.3 A.19, C.8.8.5, C.8.8.6; docs/dicom.md, SS-1).

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/dicom/dicom_dataset.h"
#include "io/dicom/identity.h"

namespace isoshift {

// A closed planar polygon: the last point is joined to the first.
struct Contour {
  std::vector<Eigen::Vector3d> points_patient_mm;  // at least three
  std::optional<double> slab_thickness_mm;         // ContourSlabThickness (retired), where it is more than 0
};

struct Structure {
  int number = 0;
  std::string name;
  std::string interpreted_type;                       // RTROIInterpretedType, such as ORGAN; empty where not told
  std::optional<std::string> frame_of_reference_uid;  // ReferencedFrameOfReferenceUID
  std::vector<Contour> contours;
  int ignored_contours = 0;  // those that enclose nothing: points, open lines, fewer than three points
};

struct RtStructures {
  std::filesystem::path path;
  Identity identity;
  std::string sop_instance_uid;
  std::string approval_status;  // ApprovalStatus; may be empty
  std::string label;
  std::vector<Structure> structures;
};

// What a structure is a volume of by the beginning of its name, as TG-263 names them: "PTV", "CTV" (an ITV, too),
// "GTV", or empty. Programs that know no types write none, or ORGAN for all.
std::string_view target_type_by_name(const Structure& structure);

// Whether a dataset of a structure set holds a closed contour: one of points alone, such as a setup isocenter, does
// not.
bool holds_closed_contour(const DicomItem& dataset);

RtStructures read_rt_structures(const std::filesystem::path& path);

// The structure with this name; if there is none, the only structure whose name differs only in upper and lower case.
// Throws Error, with the names in the file, if no structure or several structures fit, or if the structure has no
// closed contour.
const Structure& structure_named(const RtStructures& structures, std::string_view name);

}  // namespace isoshift
