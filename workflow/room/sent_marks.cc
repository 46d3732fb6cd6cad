#include "workflow/room/sent_marks.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "base/local_time.h"
#include "base/output_folder.h"

namespace isoshift {

namespace fs = std::filesystem;

fs::path SentMarks::file(const Delivery& delivery) const {
  return folder_ / fmt::format("{}.{}.{}", delivery.session, delivery.peer, delivery.object.file);
}

fs::path SentMarks::prepared_file(const Delivery& delivery) const {
  return folder_ / ("." + file(delivery).filename().string());
}

void SentMarks::prepare(const Delivery& delivery) const {
  const nlohmann::ordered_json mark = {{"on", local_time()}, {"object", delivery.object.sha256}};
  replace_text(prepared_file(delivery), mark.dump() + "\n");
}

bool SentMarks::is_prepared(const Delivery& delivery) const { return fs::exists(prepared_file(delivery)); }

void SentMarks::put(const Delivery& delivery) const {
  fs::rename(prepared_file(delivery), file(delivery));
  flush(folder_);
}

bool SentMarks::has(const Delivery& delivery) const {
  const fs::path mark = file(delivery);
  if (!fs::exists(mark)) return false;
  const nlohmann::json json = read_json_file(mark).json;
  return json.is_object() && json.value("object", nlohmann::json()) == delivery.object.sha256;
}

}  // namespace isoshift
