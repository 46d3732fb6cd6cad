#include "workflow/room/child_runner.h"

#include <fmt/format.h>

#include "io/report/result_folder.h"

namespace isoshift {

void ChildRunner::begin(const StudyParts& parts, const std::filesystem::path& folder) {
  std::vector<std::string> words = {this_program().string(), "register", "--ct"};
  for (const auto& file : parts.ct) words.push_back(file.string());
  words.emplace_back("--image");
  for (const auto& file : parts.images) words.push_back(file.string());
  if (!parts.plan.empty()) words.insert(words.end(), {"--plan", parts.plan.string()});
  if (!parts.structures.empty()) words.insert(words.end(), {"--structures", parts.structures.string()});
  words.insert(words.end(), {"--site", watch_.site.path.string(), "--output", folder.string()});
  words.insert(words.end(), watch_.registration.begin(), watch_.registration.end());
  child_ = std::make_unique<Child>(std::move(words), limit_);
  folder_ = folder;
}

std::optional<Runner::End> ChildRunner::end() {
  const std::optional<ChildEnd> ended = child_->end(std::chrono::milliseconds(0));
  if (!ended) return std::nullopt;
  child_.reset();
  if (std::filesystem::exists(folder_ / kResultFile)) return End{};
  return End{.failure = failure_of(*ended)};
}

Runner::Failure ChildRunner::failure_of(const ChildEnd& end) const {
  if (end.is_late)
    return {.why = fmt::format("the registration did not end within {:.3g} minutes",
                               std::chrono::duration<double, std::ratio<60>>(limit_).count()),
            .may_be_over_soon = false};
  if (const std::size_t error = end.output.rfind("error: "); error != std::string::npos)
    return {.why = end.output.substr(error)};
  return {.why = fmt::format("the registration ended with status {} and left no result{}{}", end.status,
                             end.output.empty() ? "" : ": ", end.output.substr(end.output.rfind('\n') + 1))};
}

}  // namespace isoshift
