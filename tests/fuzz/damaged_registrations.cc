// Registers a small phantom study of which one file is damaged (DicomMutator), again and again, and counts what comes
// of it. A result that is accepted although it lies more than 0.5 mm from the truth is named with its seed, and the
// exit status is then 1; so is one that takes longer than 30 s.
//
//   damaged_registrations [count=100] [first seed=1]

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/text_file.h"
#include "io/dicom/decoder_process.h"
#include "tests/fuzz/dicom_mutator.h"
#include "tests/support/command.h"
#include "tests/support/small_study.h"
#include "workflow/register/truth.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

// How far the edge of a target of 30 mm around the isocenter lies off: by the translation, and by the rotation.
double off_mm(const Eigen::Isometry3d& found, const Eigen::Isometry3d& expected) {
  constexpr double kRadiusMm = 30.0;
  const double angle_rad = Eigen::AngleAxisd(found.linear() * expected.linear().transpose()).angle();
  return (found.translation() - expected.translation()).norm() + kRadiusMm * angle_rad;
}

int run(std::uint64_t count, std::uint64_t first_seed) {
  const SmallStudy study;
  if (register_study(study).exit_status != 0) throw std::runtime_error("the whole study is not accepted");
  const Eigen::Isometry3d expected = read_setup_error(study.output() / "result.json");
  std::vector<fs::path> xrays = {study.image(0), study.image(1)}, slices;
  for (const auto& entry : fs::directory_iterator(study.path() / "CT")) slices.push_back(entry.path());
  std::ranges::sort(slices);
  std::map<int, std::uint64_t> outcomes;  // by exit status
  std::uint64_t wrong = 0, slow = 0;
  double slowest_s = 0.0;
  for (std::uint64_t seed = first_seed; seed < first_seed + count; ++seed) {
    const fs::path& file = seed % 4 == 0   ? study.plan()
                           : seed % 4 == 1 ? slices[seed / 4 % slices.size()]
                                           : xrays[seed % 2];
    const std::string original = text_of_file(file);
    std::ofstream(file, std::ios::binary) << DicomMutator(seed).mutated(original);
    const auto start = std::chrono::steady_clock::now();
    const CommandOutcome outcome =
        run_command({"register", study.path().string(), "-o", study.output().string(), "--overwrite"});
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    slowest_s = std::max(slowest_s, seconds);
    slow += seconds > 30.0 ? 1 : 0;
    ++outcomes[outcome.exit_status];
    if (outcome.exit_status == 0) {
      const double off = off_mm(read_setup_error(study.output() / "result.json"), expected);
      if (off > 0.5) {
        ++wrong;
        std::cerr << fmt::format("seed {} ({}): accepted, {:.2f} mm off\n", seed, file.filename().string(), off);
      }
    }
    std::ofstream(file, std::ios::binary) << original;
  }
  std::cout << fmt::format(
      "{} registrations, seeds {} to {}: {} accepted, {} review, {} rejected, {} refused, {} others; {} accepted more "
      "than 0.5 mm off, {} longer than 30 s; the slowest took {:.1f} s\n",
      count, first_seed, first_seed + count - 1, outcomes[0], outcomes[3], outcomes[4], outcomes[1],
      count - outcomes[0] - outcomes[1] - outcomes[3] - outcomes[4], wrong, slow, slowest_s);
  return wrong + slow > 0 ? 1 : 0;
}

}  // namespace
}  // namespace isoshift

int main(int argc, char** argv) {
  isoshift::use_decoder(isoshift::decoder_of(ISOSHIFT_PROGRAM));
  return isoshift::run(argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 100,
                       argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1);
}
