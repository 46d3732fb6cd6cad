#include "tests/support/small_study.h"

#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "base/text_file.h"
#include "io/dicom/decode.h"
#include "io/dicom/rt_plan.h"
#include "tests/support/testdata.h"

namespace isoshift {

PhantomOptions small_phantom() {
  PhantomOptions options;
  options.placement.isocenter_patient_mm = Eigen::Vector3d(-12.5, 38.0, -410.0);
  options.placement.translation_mm = Eigen::Vector3d(4.3, -6.1, 3.2);
  options.placement.rotation_deg = Eigen::Vector3d(1.4, -2.1, 1.8);
  options.voxel_mm = 4.0;
  options.image_pixels = 96;
  options.photons = 0.0;
  return options;
}

SmallStudy::SmallStudy() {
  namespace fs = std::filesystem;
  const fs::path from = testdata("small/1");
  fs::create_directories(path() / "RTIMAGE");
  fs::copy(from / "CT", path() / "CT");
  for (const char* file : {"RTIMAGE/KV_G000.dcm", "RTIMAGE/KV_G090.dcm", "RTPLAN.dcm", "truth.json"})
    fs::copy_file(from / file, path() / file);
}

SmallStudy::SmallStudy(const PhantomOptions& options) {
  std::filesystem::create_directory(path());
  write_phantom_study(options, path(), {});
}

std::filesystem::path SmallStudy::ct_slice(int k) const { return path() / "CT" / fmt::format("CT{:04}.dcm", k); }

std::filesystem::path SmallStudy::image(int n) const {
  return path() / "RTIMAGE" / (n == 0 ? "KV_G000.dcm" : "KV_G090.dcm");
}

void draw(const SmallStudy& study, const std::vector<DrawnStructure>& structures) {
  const RtPlan plan = read_rt_plan(study.plan());
  DicomFile file;
  DicomItem dataset = file.dataset();
  put_identity(dataset, plan.identity);
  dataset.put(DCM_SOPClassUID, UID_RTStructureSetStorage);
  dataset.put(DCM_SOPInstanceUID, "1.2.3.4");
  dataset.put(DCM_Modality, "RTSTRUCT");
  dataset.put(DCM_SeriesInstanceUID, "1.2.3");
  dataset.put(DCM_StructureSetLabel, "DRAWN");
  for (std::size_t n = 0; n < structures.size(); ++n) {
    const double number = static_cast<double>(n + 1);
    DicomItem roi = dataset.append_item(DCM_StructureSetROISequence);
    roi.put(DCM_ROINumber, number);
    roi.put(DCM_ROIName, structures[n].name);
    roi.put(DCM_ReferencedFrameOfReferenceUID, plan.frame_of_reference_uid.value());
    DicomItem drawn = dataset.append_item(DCM_ROIContourSequence);
    drawn.put(DCM_ReferencedROINumber, number);
    for (const auto& points_mm : structures[n].contours) {
      DicomItem contour = drawn.append_item(DCM_ContourSequence);
      contour.put(DCM_ContourGeometricType, structures[n].geometric_type);
      contour.put(DCM_NumberOfContourPoints, static_cast<double>(points_mm.size()));
      contour.put(DCM_ContourData, std::span(points_mm.front().data(), 3 * points_mm.size()));
    }
    DicomItem observation = dataset.append_item(DCM_RTROIObservationsSequence);
    observation.put(DCM_ObservationNumber, number);
    observation.put(DCM_ReferencedROINumber, number);
    observation.put(DCM_RTROIInterpretedType, "ORGAN");
  }
  file.write(study.structures());
}

std::vector<Eigen::Vector3d> rectangle(const Eigen::Vector3d& center_mm, double width_mm, double height_mm) {
  std::vector<Eigen::Vector3d> corners;
  for (const auto& [x, y] : {std::pair(-0.5, -0.5), {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}})
    corners.push_back(center_mm + Eigen::Vector3d(x * width_mm, y * height_mm, 0));
  return corners;
}

void join_images(const SmallStudy& study) {
  std::vector<std::uint16_t> pixels;
  for (const int n : {0, 1}) {
    const DicomFile image = DicomFile::read(study.image(n), DicomFile::Extent::kWhole);
    for (const std::int32_t value : decode_frame(image, pixel_format(image.dataset()), 0))
      pixels.push_back(static_cast<std::uint16_t>(value));
  }
  edit(study.image(0), [&](DicomItem d) {
    d.erase(DCM_ExposureSequence);
    d.erase(DCM_GantryAngle);
    for (const int n : {0, 1}) {
      DicomItem exposure = d.append_item(DCM_ExposureSequence);
      exposure.put(DCM_ReferencedFrameNumber, fmt::format("{}", n + 1));
      exposure.put(DCM_KVP, 120.0);
      exposure.put(DCM_GantryAngle, 90.0 * n);
    }
    d.put(DCM_NumberOfFrames, "2");
    d.put_pixels(pixels);
  });
  std::filesystem::remove(study.image(1));
}

CommandOutcome register_study(const SmallStudy& study, const std::vector<std::string>& more) {
  std::vector<std::string> arguments = {"register", study.path().string(), "-o", study.output().string()};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return run_command(arguments);
}

nlohmann::json result_of(const SmallStudy& study) {
  return nlohmann::json::parse(text_of_file(study.output() / "result.json"));
}

void edit(const std::filesystem::path& path, const std::function<void(DicomItem)>& change) {
  DicomFile file = DicomFile::read(path, DicomFile::Extent::kWhole);
  change(file.dataset());
  const std::filesystem::path changed = path.string() + ".changed";
  file.write(changed);
  std::filesystem::rename(changed, path);
}

}  // namespace isoshift
