#include "io/study/ct_store.h"

#include <iterator>

namespace isoshift {

std::shared_ptr<const CtSeries> CtStore::get(const std::vector<std::filesystem::path>& files, const Allowances& allowed,
                                             Notes& notes, const Progress& progress) {
  Versions versions;
  for (const std::filesystem::path& file : files) {
    std::error_code unreadable;  // whoever reads it says so
    versions.emplace_back(file, std::filesystem::last_write_time(file, unreadable));
  }
  if (!last_ || versions != versions_ || allowed != allowed_) {
    last_.reset();  // never two in memory
    said_ = {};
    last_ = std::make_shared<const CtSeries>(read_ct_series(files, allowed, said_, progress));
    versions_ = std::move(versions);
    allowed_ = allowed;
  }
  const auto add = [](std::vector<std::string>& to, const std::vector<std::string>& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  add(notes.warnings, said_.warnings);
  add(notes.overrides, said_.overrides);
  add(notes.left_aside, said_.left_aside);
  return last_;
}

}  // namespace isoshift
