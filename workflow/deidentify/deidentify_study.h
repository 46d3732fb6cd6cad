#pragma once
// The objects of a study, written once more without what tells who the patient is.

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "io/objects/pseudonyms.h"
#include "io/study/study_files.h"
#include "workflow/observer.h"

namespace isoshift {

struct DeidentifiedFiles {
  std::map<std::string, std::size_t> count;            // of the files written, by the folder they are in: "CT"
  std::vector<std::filesystem::path> burnt_in;         // files which say that their pixels bear text
  std::map<std::string, std::size_t> may_be_burnt_in;  // count of those that do not say, by folder
};

// Writes the CTs, X-rays, plans, structure sets and registration objects of `files` below `folder` under numbers
// ("CT/00001.dcm"). Adds to `pseudonyms` what stands for what, with the names of the files. Throws Error as DicomFile
// does.
DeidentifiedFiles deidentify_study(const StudyFiles& files, const std::filesystem::path& folder, Pseudonyms& pseudonyms,
                                   Observer& observer);

// What a person must know before these files are given away: that pixels are as they were, and which may bear text.
std::vector<std::string> pixel_warnings(const DeidentifiedFiles& written);

}  // namespace isoshift
