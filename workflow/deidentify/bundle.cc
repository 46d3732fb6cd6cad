#include "workflow/deidentify/bundle.h"

#include <fmt/format.h>
#include <link.h>

#include <algorithm>
#include <set>

#include "base/error.h"
#include "base/output_folder.h"
#include "base/sha256.h"
#include "base/text_file.h"
#include "base/version.h"
#include "io/dicom/ct_series.h"
#include "io/objects/spatial_registration.h"
#include "io/report/result_folder.h"
#include "workflow/deidentify/deidentified_result.h"

namespace isoshift {
namespace {

// A file that a result names must be that which was registered.
void check_is_the_same(const std::filesystem::path& file, const std::string& sha256) {
  if (!sha256.empty() && sha256_of_file(file) != sha256)
    throw Error(fmt::format("{}: is not the file that was registered: its SHA-256 is another", file.string()));
}

void check_is_the_ct(const std::vector<std::filesystem::path>& files, const std::string& sha256) {
  Notes none;
  if (sha256.empty() || read_ct_series(files, {{"gaps", "as registered"}}, none, {}).sha256 == sha256) return;
  throw Error(fmt::format("{}: the CT is not that which was registered: its SHA-256 is another",
                          files.front().parent_path().string()));
}

void expect_found(bool is_found, std::string_view what, const std::string& uid) {
  if (!is_found) throw Error(fmt::format("the study does not hold the {} of the result, {}", what, uid));
}

// Of all X-rays those that the result names, each once.
std::vector<StudyFiles::Image> images_of(const SetupResult& result, const std::vector<StudyFiles::Image>& all) {
  std::vector<StudyFiles::Image> images;
  std::set<std::string> taken;
  for (const SetupResult::View& view : result.views)
    for (const StudyFiles::Image& image : all) {
      if (image.sop_instance_uid != view.sop_instance_uid || !taken.insert(view.sop_instance_uid).second) continue;
      check_is_the_same(image.file, view.sha256);
      images.push_back(image);
    }
  return images;
}

// What of the study the result names, but for its structure set.
StudyFiles named_files(const SetupResult& result, const StudyFiles& study) {
  StudyFiles files;
  for (const StudyFiles::Ct& ct : study.cts)
    if (ct.series_instance_uid == result.ct_series_uid) files.cts.push_back(ct);
  expect_found(!files.cts.empty(), "CT", result.ct_series_uid);
  check_is_the_ct(files.cts.front().files, result.ct_sha256);
  std::vector<StudyFiles::Image> rt_images = study.images;
  std::ranges::copy(study.drrs, std::back_inserter(rt_images));
  files.images = images_of(result, rt_images);
  files.other_xrays = images_of(result, study.other_xrays);
  for (const SetupResult::View& view : result.views) {
    const auto has = [&](const std::vector<StudyFiles::Image>& images) {
      return std::ranges::count(images, view.sop_instance_uid, &StudyFiles::Image::sop_instance_uid) > 0;
    };
    expect_found(has(files.images) || has(files.other_xrays), "X-ray " + view.label, view.sop_instance_uid);
  }
  if (result.plan_uid.empty()) return files;
  const auto plan = std::ranges::find(study.plans, result.plan_uid, &StudyFiles::Plan::sop_instance_uid);
  expect_found(plan != study.plans.end(), "plan", result.plan_uid);
  check_is_the_same(plan->file, result.plan_sha256);
  files.plans.push_back(*plan);
  return files;
}

// The same with the structure set that was registered.
StudyFiles registered_files(const SetupResult& result, const StudyFiles& study) {
  StudyFiles files = named_files(result, study);
  if (result.structure_set_uid.empty()) return files;
  const auto registered =
      std::ranges::find(study.structures, result.structure_set_uid, &StudyFiles::Structures::sop_instance_uid);
  expect_found(registered != study.structures.end(), "structure set", result.structure_set_uid);
  files.structures.push_back(*registered);
  return files;
}

std::string versions() {
  std::string text = fmt::format("isoshift {} ({})\n", kVersion, kCommit);
  if (std::filesystem::exists("/etc/os-release")) text += "\n" + text_of_file("/etc/os-release");
  text += "\nLibraries:\n";
  ::dl_iterate_phdr(
      [](dl_phdr_info* info, std::size_t, void* lines) {
        std::error_code none;
        const auto file = std::filesystem::canonical(info->dlpi_name, none);  // with the version behind the name
        if (!file.empty()) *static_cast<std::string*>(lines) += file.filename().string() + "\n";
        return 0;
      },
      &text);
  return text;
}

std::string read_me(const SetupResult& result) {
  return fmt::format(
      "A registration by isoshift, de-identified.\n\n"
      "study/        what was registered (DICOM)\n"
      "result/       what came of it; hashes of files are those of the originals\n"
      "versions.txt  of isoshift and its libraries, where this bundle was made; result/result.json names the version\n"
      "              that registered\n\n"
      "To register it again:\n"
      "  isoshift register study -o again --preset {} --seed {}\n"
      "and with the options that result/result.json tells of: region, overrides, machine, start.\n\n"
      "Before you give it away: look at the pixels, and read result/report.txt.\n",
      result.preset, result.seed);
}

}  // namespace

DeidentifiedFiles write_bundle(const BundleOptions& options, Observer& observer) {
  SetupResult result = read_result(options.result);
  StudyFiles files = registered_files(result, scan_study(options.study));
  if (const auto registration = options.result / kRegistrationFile; std::filesystem::exists(registration)) {
    if (read_spatial_registration(registration).sop_instance_uid != result.spatial_registration_uid)
      throw Error(fmt::format("{}: is not the registration object of the result", registration.string()));
    files.registrations.push_back(registration);
  }
  std::vector<std::filesystem::path> inputs = options.study;
  inputs.push_back(options.result);
  OutputFolder output(options.output, options.overwrite, inputs);
  Pseudonyms pseudonyms;
  const DeidentifiedFiles written = deidentify_study(files, output.path() / "study", pseudonyms, observer);
  result = deidentified(std::move(result), pseudonyms);
  std::filesystem::create_directory(output.path() / "result");
  write_result(result, output.path() / "result");
  write_text(output.path() / "versions.txt", versions());
  write_text(output.path() / "README.txt", read_me(result));
  output.commit();
  return written;
}

}  // namespace isoshift
