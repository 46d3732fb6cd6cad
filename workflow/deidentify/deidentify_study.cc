#include "workflow/deidentify/deidentify_study.h"

#include <fmt/format.h>

#include <utility>

#include "io/dicom/dicom_dataset.h"
#include "io/objects/deidentification.h"

namespace isoshift {
namespace {

using Files = std::vector<std::filesystem::path>;

std::vector<std::pair<const char*, Files>> by_folder(const StudyFiles& files) {
  std::vector<std::pair<const char*, Files>> folders = {{"CT", {}},     {"RTIMAGE", {}},  {"XRAY", {}},
                                                        {"RTPLAN", {}}, {"RTSTRUCT", {}}, {"REG", files.registrations}};
  for (const StudyFiles::Ct& ct : files.cts)
    folders[0].second.insert(folders[0].second.end(), ct.files.begin(), ct.files.end());
  for (const auto& images : {files.images, files.drrs})
    for (const StudyFiles::Image& image : images) folders[1].second.push_back(image.file);
  for (const StudyFiles::Image& image : files.other_xrays) folders[2].second.push_back(image.file);
  for (const StudyFiles::Plan& plan : files.plans) folders[3].second.push_back(plan.file);
  for (const StudyFiles::Structures& structures : files.structures) folders[4].second.push_back(structures.file);
  return folders;
}

}  // namespace

DeidentifiedFiles deidentify_study(const StudyFiles& files, const std::filesystem::path& folder, Pseudonyms& pseudonyms,
                                   Observer& observer) {
  DeidentifiedFiles written;
  const auto folders = by_folder(files);
  std::size_t done = 0, total = 0;
  for (const auto& [name, sources] : folders) total += sources.size();
  for (const auto& [name, sources] : folders) {
    if (sources.empty()) continue;
    std::filesystem::create_directories(folder / name);
    for (const std::filesystem::path& source : sources) {
      const DicomFile file = DicomFile::read(source, DicomFile::Extent::kWhole);
      const DicomItem dataset = file.dataset();
      const std::filesystem::path target = fmt::format("{}/{:05}.dcm", name, ++written.count[name]);
      if (dataset.has_value(DCM_PixelData)) {
        const BurntIn says = burnt_in(dataset);
        if (says == BurntIn::kYes) written.burnt_in.push_back(target);
        if (says == BurntIn::kUnknown) ++written.may_be_burnt_in[name];
      }
      deidentified(file, pseudonyms).write(folder / target);
      pseudonyms.stands_for(source.string(), target.string());
      pseudonyms.stands_for(source.filename().string(), target.filename().string());
      pseudonyms.stands_for(source.stem().string(), target.stem().string());
      observer.progress("De-identifying", ++done, total);
    }
  }
  return written;
}

std::vector<std::string> pixel_warnings(const DeidentifiedFiles& written) {
  std::vector<std::string> warnings;
  warnings.reserve(written.burnt_in.size());
  for (const std::filesystem::path& file : written.burnt_in)
    warnings.push_back(
        fmt::format("{}: text is burnt into its pixels ({} is YES)", file.string(), described(DCM_BurnedInAnnotation)));
  for (const auto& [folder, count] : written.may_be_burnt_in)
    warnings.push_back(fmt::format("{}: {} images do not say whether text is burnt into their pixels ({})", folder,
                                   count, described(DCM_BurnedInAnnotation)));
  if (written.count.contains("CT"))
    warnings.emplace_back("CT: pixels stay as they are; from the CT of a head, the face can be drawn");
  return warnings;
}

}  // namespace isoshift
