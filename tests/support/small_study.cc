#include "tests/support/small_study.h"

#include <fmt/format.h>

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

SmallStudy::SmallStudy(const PhantomOptions& options) {
  std::filesystem::create_directory(path());
  write_phantom_study(options, path(), {});
}

std::filesystem::path SmallStudy::ct_slice(int k) const { return path() / "CT" / fmt::format("CT{:04}.dcm", k); }

std::filesystem::path SmallStudy::image(int n) const {
  return path() / "RTIMAGE" / (n == 0 ? "KV_G000.dcm" : "KV_G090.dcm");
}

CommandOutcome register_study(const SmallStudy& study, const std::vector<std::string>& more) {
  std::vector<std::string> arguments = {"register", study.path().string(), "-o", study.output().string()};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return run_command(arguments);
}

void edit(const std::filesystem::path& path, const std::function<void(DicomItem)>& change) {
  DicomFile file = DicomFile::read(path, DicomFile::Extent::kWhole);
  change(file.dataset());
  const std::filesystem::path changed = path.string() + ".changed";
  file.write(changed);
  std::filesystem::rename(changed, path);
}

}  // namespace isoshift
