#include "io/dicom/rt_structures.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>
#include <utility>

#include "base/error.h"

namespace isoshift {
namespace {

// Files with more are broken or made to harm. An automatic segmentation of the whole body has about 100 structures on
// 1000 slices; points take 24 bytes each once read, so that no file can claim more than 240 MB.
constexpr std::size_t kMaxStructures = 1000;
constexpr std::size_t kMaxContours = 200'000;
constexpr std::size_t kMaxPoints = 10'000'000;
constexpr std::size_t kLeastPoints = 3;  // of a contour that encloses something

void check_count(std::size_t count, std::size_t limit, const std::string& where, std::string_view of_what) {
  if (count > limit) throw Error(fmt::format("{}: more than {} {}: not a file to be read", where, limit, of_what));
}

// CLOSEDPLANAR_XOR asks for what even-odd does with all contours of a plane (docs/dicom.md, SS-1).
bool is_closed(const DicomItem& contour) {
  const auto type = contour.text(DCM_ContourGeometricType);
  return type == "CLOSED_PLANAR" || type == "CLOSEDPLANAR_XOR";
}

Contour read_contour(const DicomItem& item) {
  const std::vector<double> numbers = item.numbers(DCM_ContourData);
  const std::size_t points = numbers.size() / 3;
  const double said = item.number(DCM_NumberOfContourPoints).value_or(static_cast<double>(points));
  if (numbers.size() != 3 * points || said != static_cast<double>(points))
    throw Error(fmt::format("{}: {} has {} values, expected 3 for each of {:.6g} points ({})", item.where(),
                            described(DCM_ContourData), numbers.size(), said, described(DCM_NumberOfContourPoints)));
  Contour contour;
  contour.points_patient_mm.reserve(points);
  for (std::size_t n = 0; n < points; ++n) contour.points_patient_mm.emplace_back(numbers.data() + 3 * n);
  if (const auto thickness_mm = item.number(DCM_RETIRED_ContourSlabThickness); thickness_mm && *thickness_mm > 0.0)
    contour.slab_thickness_mm = thickness_mm;
  return contour;
}

// The structure that an item of another sequence refers to.
Structure& referred_structure(std::vector<Structure>& structures, const DicomItem& item) {
  const int number = item.required_integer(DCM_ReferencedROINumber);
  const auto structure = std::ranges::find(structures, number, &Structure::number);
  if (structure == structures.end())
    throw Error(fmt::format("{}: {} is {}, a number that no item of {} has", item.where(),
                            described(DCM_ReferencedROINumber), number, described(DCM_StructureSetROISequence)));
  return *structure;
}

void read_contours(const DicomItem& dataset, std::vector<Structure>& structures) {
  std::size_t contours = 0, points = 0;
  std::set<int> drawn;
  for (const DicomItem& roi : dataset.items(DCM_ROIContourSequence)) {
    Structure& structure = referred_structure(structures, roi);
    if (!drawn.insert(structure.number).second)
      throw Error(fmt::format("{}: {} is {}, as in an earlier item; expected each number once", roi.where(),
                              described(DCM_ReferencedROINumber), structure.number));
    for (const DicomItem& item : roi.items(DCM_ContourSequence)) {
      check_count(++contours, kMaxContours, dataset.where(), "contours");
      Contour contour = is_closed(item) ? read_contour(item) : Contour{};
      check_count(points += contour.points_patient_mm.size(), kMaxPoints, dataset.where(), "points");
      if (contour.points_patient_mm.size() < kLeastPoints)
        ++structure.ignored_contours;
      else
        structure.contours.push_back(std::move(contour));
    }
  }
}

// A structure may have several observations (PS3.3 C.8.8.8), which agree on what it is.
void read_observation(const DicomItem& observation, std::vector<Structure>& structures) {
  const std::string type = observation.text(DCM_RTROIInterpretedType).value_or("");
  Structure& structure = referred_structure(structures, observation);
  if (type.empty()) return;
  if (!structure.interpreted_type.empty() && structure.interpreted_type != type)
    throw Error(fmt::format("{}: {} of structure {} \"{}\" is {}, and {} in an earlier item", observation.where(),
                            described(DCM_RTROIInterpretedType), structure.number, structure.name, type,
                            structure.interpreted_type));
  structure.interpreted_type = type;
}

bool equal_but_for_case(std::string_view one, std::string_view other) {
  const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + ('a' - 'A')) : c; };
  return std::ranges::equal(one, other, {}, lower, lower);
}

}  // namespace

std::string_view target_type_by_name(const Structure& structure) {
  if (!structure.interpreted_type.empty() && structure.interpreted_type != "ORGAN") return "";
  for (const auto& [beginning, type] :
       {std::pair("PTV", "PTV"), std::pair("CTV", "CTV"), std::pair("ITV", "CTV"), std::pair("GTV", "GTV")})
    if (equal_but_for_case(std::string_view(structure.name).substr(0, 3), beginning)) return type;
  return "";
}

bool holds_closed_contour(const DicomItem& dataset) {
  for (const DicomItem& roi : dataset.items(DCM_ROIContourSequence))
    for (const DicomItem& item : roi.items(DCM_ContourSequence))
      if (is_closed(item) && item.has_value(DCM_ContourData) &&
          item.number(DCM_NumberOfContourPoints).value_or(kLeastPoints) >= kLeastPoints)
        return true;
  return false;
}

RtStructures read_rt_structures(const std::filesystem::path& path) {
  const DicomFile file = DicomFile::read(path, DicomFile::Extent::kHeader);
  const DicomItem dataset = file.dataset();
  RtStructures read;
  expect_modality(dataset, "RTSTRUCT");
  read.path = path;
  read.identity = read_identity(dataset);
  read.sop_instance_uid = dataset.required_uid(DCM_SOPInstanceUID);
  read.approval_status = dataset.text(DCM_ApprovalStatus).value_or("");
  read.label = dataset.text(DCM_StructureSetLabel).value_or("");
  for (const DicomItem& roi : dataset.items(DCM_StructureSetROISequence)) {
    Structure structure;
    structure.number = roi.required_integer(DCM_ROINumber);
    structure.name = roi.text(DCM_ROIName).value_or("");
    structure.frame_of_reference_uid = roi.uid(DCM_ReferencedFrameOfReferenceUID);
    if (std::ranges::find(read.structures, structure.number, &Structure::number) != read.structures.end())
      throw Error(fmt::format("{}: {} is {}, as in an earlier item; expected each number once", roi.where(),
                              described(DCM_ROINumber), structure.number));
    read.structures.push_back(std::move(structure));
    check_count(read.structures.size(), kMaxStructures, path.string(), "structures");
  }
  read_contours(dataset, read.structures);
  for (const DicomItem& observation : dataset.items(DCM_RTROIObservationsSequence))
    read_observation(observation, read.structures);
  return read;
}

const Structure& structure_named(const RtStructures& structures, std::string_view name) {
  std::vector<const Structure*> meant;
  for (const Structure& structure : structures.structures)
    if (structure.name == name) meant.push_back(&structure);
  if (meant.empty())
    for (const Structure& structure : structures.structures)
      if (equal_but_for_case(structure.name, name)) meant.push_back(&structure);
  const std::string where = structures.path.string();
  if (meant.size() != 1) {
    std::vector<std::string> there;
    there.reserve(structures.structures.size());
    for (const Structure& structure : structures.structures) there.push_back(fmt::format("\"{}\"", structure.name));
    throw Error(fmt::format("{}: {} structure{} named \"{}\" ({}), expected one.\n       There are: {}{}", where,
                            meant.empty() ? "no" : fmt::format("{}", meant.size()), meant.empty() ? "" : "s", name,
                            described(DCM_ROIName), there.empty() ? "none" : fmt::format("{}", fmt::join(there, ", ")),
                            meant.size() > 1 ? ".\n       Names must differ: rename one in the planning system" : ""));
  }
  if (meant.front()->contours.empty())
    throw Error(fmt::format("{}: structure {} \"{}\" has no closed contour ({} CLOSED_PLANAR), so it encloses nothing",
                            where, meant.front()->number, meant.front()->name, described(DCM_ContourGeometricType)));
  return *meant.front();
}

}  // namespace isoshift
