// Our DRRs beside those of `plastimatch drr -i exact` (Debian package plastimatch, 1.9.4): do they agree, and how long
// does either take? Both see the same volume of attenuation, through the same camera, on all cores.
//
//   compare_plastimatch CT_FOLDER [--renderer cpu] [--size 512] [--json FILE]
//
// What plastimatch does, from its drr.cxx, proj_matrix.cxx and pcmd_drr.cxx, each confirmed by running 1.9.4:
// - -a 10 -N 36 makes ten images in one run. The source begins at the isocenter's +x (LPS) and turns about z toward -y,
//   so that image n is that of gantry angle 90 - 36 n degrees for a head-first supine patient. With -n (the direction
//   from isocenter to source) it makes one image, the same as of that angle, and ignores -a and -N.
// - -y is added to these angles in radians, though its help says degrees: it is not used here.
// - -o is in LPS. Row numbers grow along -vup, column numbers along vup x normal, the panel is centered, and PFM
//   files begin with the first row: with --vup along z that is the receptor of bench_view(), nothing is flipped.
// - -P none takes voxels for attenuation per mm. The integral is divided by 10 ("mm to cm"), which -s 10 undoes.
// - -i exact is Siddon's: constant voxels, exact path lengths. Hence `siddon` is compared too and must agree closely.
//   But the last voxel of every ray is left out, hence the layer of air around the CT (read_ct).
// - "Total time" begins after the volume was read (and after HU were converted, were they) and ends after the last
//   image. It includes the writing of images and matrices, which "I/O time" gives per image.

#include <fmt/format.h>
#include <sys/wait.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/error.h"
#include "base/median.h"
#include "base/output_folder.h"
#include "bench/scene.h"
#include "geometry/patient_setup.h"
#include "io/dicom/ct_series.h"
#include "io/dicom/decoder_process.h"
#include "io/study/study_files.h"

namespace isoshift {
namespace {

constexpr int kPoses = 10;
constexpr double kStepDeg = 360.0 / kPoses;
constexpr int kTimedRoundsOfOurs = 5;
constexpr int kRunsOfPlastimatch = 3;
constexpr double kLeastCorrelation = 0.99;  // a mirrored or turned image has less
constexpr double kMostSiddonRms = 1e-4;     // both exact: 5e-7 was measured; a shift by 0.01 pixels gives 6e-4
constexpr double kNoThresholdHu = -1e9;

using Drrs = std::vector<std::vector<float>>;  // pixels of one image per pose

struct Options {
  std::filesystem::path ct_folder, json;
  std::string renderer = "cpu";
  int size = 512;
};

// plastimatch's standard output. Throws Error with what it said where it is missing or fails.
std::string run_plastimatch(const std::string& arguments) {
  const std::string command =
      fmt::format("OMP_NUM_THREADS={} plastimatch {}", std::thread::hardware_concurrency(), arguments);
  FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) throw Error("no shell can be started to run plastimatch");
  std::string output;
  std::array<char, 4096> block{};
  while (const std::size_t count = std::fread(block.data(), 1, block.size(), pipe)) output.append(block.data(), count);
  const int status = ::pclose(pipe);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 127)
    throw Error("plastimatch is not installed (Debian package plastimatch)");
  if (status != 0) throw Error(fmt::format("plastimatch failed:\n{}\n{}", command, output));
  return output;
}

// The sum of the numbers behind each `label`.
double sum_behind(std::string_view label, const std::string& output) {
  if (output.find(label) == std::string::npos)
    throw Error(fmt::format("plastimatch did not say \"{}\":\n{}", label, output));
  double sum = 0.0;
  for (std::size_t at = output.find(label); at != std::string::npos; at = output.find(label, at + 1))
    sum += std::strtod(output.c_str() + at + label.size(), nullptr);
  return sum;
}

void write_volume(const std::filesystem::path& path, const Volume<float>& volume) {
  const Eigen::Vector3d spacing_mm = volume.spacing_mm(), first_mm = volume.patient_from_voxel.translation();
  std::string file = fmt::format(
      "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = False\n"
      "TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = {} {} {}\nElementSpacing = {} {} {}\nDimSize = {} {} {}\n"
      "ElementType = MET_FLOAT\nElementDataFile = LOCAL\n",
      first_mm.x(), first_mm.y(), first_mm.z(), spacing_mm.x(), spacing_mm.y(), spacing_mm.z(), volume.size.x(),
      volume.size.y(), volume.size.z());
  file.append(reinterpret_cast<const char*>(volume.voxels.data()), volume.voxels.size() * sizeof(float));
  write_text(path, file);
}

std::vector<float> read_pfm(const std::filesystem::path& path, int size) {
  std::ifstream file(path, std::ios::binary);
  std::string magic;
  int columns = 0, rows = 0;
  double scale = 0.0;  // negative: little endian
  file >> magic >> columns >> rows >> scale;
  file.get();
  std::vector<float> pixels(static_cast<std::size_t>(size) * size);
  const bool fits = magic == "Pf" && columns == size && rows == size && scale < 0.0;
  if (fits)
    file.read(reinterpret_cast<char*>(pixels.data()), static_cast<std::streamsize>(pixels.size() * sizeof(float)));
  if (!fits || !file)
    throw Error(fmt::format("plastimatch wrote no image of {0} x {0} pixels: {1}", size, path.string()));
  return pixels;
}

// The CT in HU with a layer of air outermost, for both programs: plastimatch leaves out the last voxel of every ray.
// Where the scan ends within the patient that is 0.2 % of the rms, enough to hide a difference of geometry.
Volume<float> read_ct(const std::filesystem::path& folder) {
  const StudyFiles files = scan_study({folder});
  if (files.cts.size() != 1)
    throw Error(fmt::format("{}: holds {} CT series, expected one", folder.string(), files.cts.size()));
  Notes notes;
  Volume<float> hu = read_ct_series(files.cts.front().files, {}, notes, [](std::size_t, std::size_t) {}).hu;
  if (!hu.patient_from_voxel.linear().isApprox(Eigen::Matrix3d(hu.spacing_mm().asDiagonal()), 1e-6))
    throw Error(fmt::format("{}: voxel axes are not the patient's x, y, z, as the comparison needs", folder.string()));
  for (int k = 0; k < hu.size.z(); ++k)
    for (int j = 0; j < hu.size.y(); ++j)
      for (int i = 0; i < hu.size.x(); ++i) {
        const Eigen::Array3i voxel(i, j, k);
        if ((voxel == 0).any() || (voxel == hu.size.array() - 1).any()) hu.at(i, j, k) = -1000.0F;
      }
  return hu;
}

struct Rendered {
  Drrs drrs;
  std::vector<double> ms_per_drr;          // of each timed run over all poses
  std::vector<double> writing_ms_per_drr;  // the part of it that goes into files
};

Rendered render_with_plastimatch(const std::filesystem::path& folder, const Volume<float>& attenuation_per_mm,
                                 const Eigen::Vector3d& isocenter_patient_mm, int size) {
  write_volume(folder / "attenuation.mha", attenuation_per_mm);
  // The panel, SAD and SID of bench_view().
  const std::string arguments = fmt::format(
      "drr -i exact -P none -s 10 -a {} -N {} --vup '0 0 1' --sad 1000 --sid 1500 -r '{} {}' -z '410 410' "
      "-o '{} {} {}' -O '{}' '{}'",
      kPoses, kStepDeg, size, size, isocenter_patient_mm.x(), isocenter_patient_mm.y(), isocenter_patient_mm.z(),
      (folder / "drr").string(), (folder / "attenuation.mha").string());
  Rendered rendered;
  for (int run = 0; run < kRunsOfPlastimatch; ++run) {
    const std::string output = run_plastimatch(arguments);
    rendered.ms_per_drr.push_back(1e3 * sum_behind("Total time:", output) / kPoses);
    rendered.writing_ms_per_drr.push_back(1e3 * sum_behind("I/O time:", output) / kPoses);
  }
  for (int n = 0; n < kPoses; ++n) rendered.drrs.push_back(read_pfm(folder / fmt::format("drr{:04}.pfm", n), size));
  return rendered;
}

// One pose per call, as registration needs them; when render() returns, the pixels lie in main memory. The first round
// warms up and keeps the images; `timed_rounds` more are timed.
Rendered render_with_ours(Renderer& renderer, const Eigen::Vector3d& isocenter_patient_mm, int size, int timed_rounds) {
  const std::array pose = {planned_room_from_patient(PatientPosition::kHfs, {}, isocenter_patient_mm)};
  std::array<XrayView, kPoses> views;
  for (int n = 0; n < kPoses; ++n) views[n] = bench_view(90.0 - n * kStepDeg, size);

  Rendered rendered;
  for (const XrayView& view : views) {
    const RenderResult drr = renderer.render(std::span(&view, 1), pose, PixelSet::all());
    rendered.drrs.emplace_back(drr.line_integrals(0, 0).begin(), drr.line_integrals(0, 0).end());
  }
  for (int round = 0; round < timed_rounds; ++round) {
    const auto begin = std::chrono::steady_clock::now();
    for (const XrayView& view : views) renderer.render(std::span(&view, 1), pose, PixelSet::all());
    const std::chrono::duration<double, std::milli> ms = std::chrono::steady_clock::now() - begin;
    rendered.ms_per_drr.push_back(ms.count() / kPoses);
  }
  return rendered;
}

struct Agreement {
  double relative_rms = -1.0;  // rms of the difference over rms of plastimatch's values, all images
  double correlation = 1.0;    // of the worst image
  double mean_ratio = -1.0;    // ours over plastimatch's, all images
};

Agreement compare(const Drrs& ours, const Drrs& theirs) {
  Agreement agreement;
  Eigen::Vector4d sums = Eigen::Vector4d::Zero();  // of ours, theirs, difference squared, theirs squared
  for (int n = 0; n < kPoses; ++n) {
    const auto count = static_cast<Eigen::Index>(theirs[n].size());
    const Eigen::ArrayXd a = Eigen::Map<const Eigen::ArrayXf>(ours[n].data(), count).cast<double>();
    const Eigen::ArrayXd b = Eigen::Map<const Eigen::ArrayXf>(theirs[n].data(), count).cast<double>();
    sums += Eigen::Vector4d(a.sum(), b.sum(), (a - b).square().sum(), b.square().sum());
    const Eigen::ArrayXd da = a - a.mean(), db = b - b.mean();
    const double norm = std::sqrt(da.square().sum() * db.square().sum());  // 0 for a blank image
    agreement.correlation = std::min(agreement.correlation, norm > 0.0 ? (da * db).sum() / norm : 0.0);
  }
  agreement.relative_rms = std::sqrt(sums[2] / sums[3]);
  agreement.mean_ratio = sums[0] / sums[1];
  return agreement;
}

// Prints one case and returns it as JSON. Throws Error if images do not agree: then the times compare nothing.
nlohmann::json compare_case(const Volume<float>& ct_hu, double threshold_hu, RendererKind kind, int size) {
  const bool has_threshold = threshold_hu != kNoThresholdHu;
  fmt::print("\n{}\n", has_threshold ? fmt::format("Threshold {} HU", threshold_hu) : "No threshold");
  const AttenuationModel model{.threshold_hu = threshold_hu};
  const Eigen::Vector3d isocenter_patient_mm =
      ct_hu.patient_from_voxel * Eigen::Vector3d((ct_hu.size.cast<double>().array() - 1.0) / 2.0);

  const OutputFolder folder(std::filesystem::temp_directory_path() / "compare_plastimatch", false);  // never committed
  const Rendered theirs = render_with_plastimatch(folder.path(), attenuation_volume(ct_hu, model, Beam::kKilovoltage),
                                                  isocenter_patient_mm, size);
  const double their_ms = median(theirs.ms_per_drr), writing_ms = median(theirs.writing_ms_per_drr);
  nlohmann::json result = {{"threshold_hu", has_threshold ? nlohmann::json(threshold_hu) : nlohmann::json()},
                           {"plastimatch_ms_per_drr", their_ms},
                           {"plastimatch_runs_ms_per_drr", theirs.ms_per_drr},
                           {"plastimatch_writing_ms_per_drr", writing_ms}};
  fmt::print("  plastimatch  {:8.2f} ms per DRR, of which {:.2f} ms write files\n", their_ms, writing_ms);

  std::vector kinds = {kind};
  if (kind != RendererKind::kSiddon) kinds.push_back(RendererKind::kSiddon);
  for (const RendererKind compared : kinds) {
    const auto renderer = make_renderer(compared, ct_hu, model, std::array{Beam::kKilovoltage});
    const Rendered ours =
        render_with_ours(*renderer, isocenter_patient_mm, size, compared == kind ? kTimedRoundsOfOurs : 0);
    const Agreement agreement = compare(ours.drrs, theirs.drrs);
    const std::string name(to_string(compared));
    if (compared == kind) {
      const double our_ms = median(ours.ms_per_drr), ratio = their_ms / our_ms;
      fmt::print("  {:<11}  {:8.2f} ms per DRR on {}: {:.2f} times as fast\n", name, our_ms, renderer->device(), ratio);
      result.update({{"device", renderer->device()}, {"ms_per_drr", our_ms}, {"ratio", ratio}});
      result["runs_ms_per_drr"] = ours.ms_per_drr;
    }
    fmt::print("  {:<11}  rms difference {:.5f} % of rms, correlation of the worst image {:.7f}, mean ratio {:.6f}\n",
               name, 100.0 * agreement.relative_rms, agreement.correlation, agreement.mean_ratio);
    result["agreement"][name] = {{"relative_rms", agreement.relative_rms},
                                 {"lowest_correlation", agreement.correlation},
                                 {"mean_ratio", agreement.mean_ratio}};
    if (!(agreement.correlation > kLeastCorrelation) ||
        (compared == RendererKind::kSiddon && !(agreement.relative_rms < kMostSiddonRms)))
      throw Error(fmt::format("the images of {} are not plastimatch's: the geometries differ", name));
  }
  return result;
}

void run(const Options& options) {
  if (!options.json.empty() && std::filesystem::exists(options.json))
    throw Error(fmt::format("{}: exists already", options.json.string()));
  const RendererKind kind = renderer_kind_from(options.renderer).value();
  std::string version = run_plastimatch("--version");
  version.erase(version.find_last_not_of('\n') + 1);
  const Volume<float> ct_hu = read_ct(options.ct_folder);
  const Eigen::Vector3i& voxels = ct_hu.size;
  const unsigned threads = std::thread::hardware_concurrency();
  fmt::print("CT of {} x {} x {} voxels, {} images of {} x {} pixels\n", voxels.x(), voxels.y(), voxels.z(), kPoses,
             options.size, options.size);
  fmt::print("{} and isoshift, renderer {}; {} threads for either\n", version, options.renderer, threads);

  nlohmann::json result = {{"plastimatch", version},
                           {"renderer", options.renderer},
                           {"threads", threads},
                           {"ct_voxels", {voxels.x(), voxels.y(), voxels.z()}},
                           {"pixels", {options.size, options.size}}};
  for (const double threshold_hu : {AttenuationModel{}.threshold_hu, kNoThresholdHu})
    result["cases"].push_back(compare_case(ct_hu, threshold_hu, kind, options.size));
  if (!options.json.empty()) write_text(options.json, result.dump(2) + "\n");
}

}  // namespace
}  // namespace isoshift

int main(int argc, char** argv) try {
  // The program of the same build.
  isoshift::use_decoder(isoshift::decoder_of("/proc/self/exe"));
  isoshift::Options options;
  std::vector<std::string> renderers(isoshift::kRendererKinds.size());
  std::ranges::transform(isoshift::kRendererKinds, renderers.begin(), [](auto kind) { return to_string(kind); });
  CLI::App app("Compares DRRs with those of plastimatch drr -i exact: agreement and time", "compare_plastimatch");
  app.add_option("ct_folder", options.ct_folder, "Folder of one DICOM CT series")->required()->type_name("CT_FOLDER");
  app.option_defaults()->always_capture_default();
  app.add_option("--renderer", options.renderer, "Renderer to compare")->check(CLI::IsMember(renderers));
  app.add_option("--size", options.size, "Pixels along each edge of the panel")->check(CLI::Range(16, 4096));
  app.add_option("--json", options.json, "Write the figures there too")->type_name("FILE");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  isoshift::run(options);
  return 0;
} catch (const std::exception& error) {
  std::cerr << "error: " << error.what() << "\n";
  return 1;
}
