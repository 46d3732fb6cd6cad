#include "workflow/batch/case_inputs.h"

#include <fmt/format.h>

#include <vector>

#include "base/error.h"
#include "base/json_file.h"
#include "base/output_folder.h"
#include "base/sha256.h"
#include "io/study/files_below.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

// The files of the case but for those of a CT that is named by itself, and for the batch's own.
std::vector<fs::path> files_beside_ct(const BatchCase& one, const fs::path& batch) {
  std::vector<fs::path> parts = one.parts.images;
  for (const fs::path& part : {one.parts.study, one.parts.plan, one.parts.structures})
    if (!part.empty()) parts.push_back(part);
  std::vector<fs::path> files = files_below(parts);
  const std::string own = fs::weakly_canonical(batch).string() + "/";
  std::erase_if(files, [&](const fs::path& file) { return fs::weakly_canonical(file).string().starts_with(own); });
  return files;
}

// Another text for another anatomy or number of doubts.
std::string orders_of(const BatchCase& one) { return fmt::format("{} {}\n", one.anatomy, one.parts.doubts.size()); }

}  // namespace

CaseInputs::CaseInputs(fs::path folder, std::vector<fs::path> shared)
    : folder_(std::move(folder)), shared_(std::move(shared)) {
  std::erase_if(shared_, [](const fs::path& file) { return file.empty(); });
}

std::string CaseInputs::quick_of(const BatchCase& one) const {
  std::string all = orders_of(one);
  for (const auto& files : {files_beside_ct(one, folder_.parent_path()), files_below(one.parts.ct), shared_})
    for (const fs::path& file : files)
      all += fmt::format("{} {} {}\n", file.string(), fs::file_size(file),
                         fs::last_write_time(file).time_since_epoch().count());
  return sha256_of(all);
}

std::string CaseInputs::contents_of(const BatchCase& one) {
  std::string& ct = contents_of_ct_[one.ct_key()];
  if (ct.empty()) ct = sha256_of_files(files_below(one.parts.ct));
  std::string all = orders_of(one) + sha256_of_files(files_beside_ct(one, folder_.parent_path())) + ct;
  if (!shared_.empty()) all += sha256_of_files(shared_);
  return sha256_of(all);
}

std::optional<CaseInputs::Note> CaseInputs::note_of(const BatchCase& one) const {
  if (!fs::exists(file_of(one))) return std::nullopt;
  const nlohmann::json json = read_json_file(file_of(one)).json;
  try {
    return Note{.quick = json.at("quick"), .contents = json.at("contents")};
  } catch (const nlohmann::json::exception&) {
    throw Error(fmt::format("{}: is not a note of isoshift batch. Remove it", file_of(one).string()));
  }
}

void CaseInputs::write(const BatchCase& one, const Note& note) const {
  fs::create_directories(folder_);
  replace_text(file_of(one), nlohmann::ordered_json{{"quick", note.quick}, {"contents", note.contents}}.dump() + "\n");
}

void CaseInputs::note_nothing(const BatchCase& one) const { write(one, {}); }

bool CaseInputs::renew(const BatchCase& one, bool has_ended) {
  const std::optional<Note> before = note_of(one);
  Note now;
  try {
    now.quick = quick_of(one);
    if (before && before->quick == now.quick) return false;
    now.contents = contents_of(one);
  } catch (const std::exception&) {
    if (has_ended) return false;
    now = {};  // the registration says which file is missing; once that is there, the case has changed
  }
  write(one, now);
  return has_ended && before && before->contents != now.contents;
}

}  // namespace isoshift
