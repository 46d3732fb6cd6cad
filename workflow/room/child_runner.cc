#include "workflow/room/child_runner.h"

#include <fmt/format.h>

#include <sstream>
#include <variant>

#include "base/error.h"
#include "io/report/result_folder.h"
#include "workflow/register/registration_messages.h"

namespace isoshift {

void ChildRunner::begin(const StudyParts& parts, const std::filesystem::path& folder) {
  child_ = std::make_unique<Process>(
      std::vector<std::string>{"isoshift", "__child", "register"},
      ProcessOptions{.program = this_program(), .limit = limit_, .errors = ProcessOptions::Errors::kKept});
  // A child that died is found by end().
  child_->channel().send(
      to_line(RegistrationOrder{
          .parts = parts, .flags = watch_.registration, .site = watch_.site.path, .anatomy = "", .output = folder}),
      child_->deadline());
  child_->channel().end_sending();
  folder_ = folder;
}

std::optional<Runner::End> ChildRunner::end() {
  const std::optional<ProcessEnd> ended = child_->end(std::chrono::milliseconds(0));
  if (!ended) return std::nullopt;
  child_.reset();
  if (std::filesystem::exists(folder_ / kResultFile)) return End{};
  return End{.failure = failure_of(*ended)};
}

Runner::Failure ChildRunner::failure_of(const ProcessEnd& end) const {
  if (end.is_late)
    return {.why = fmt::format("the registration did not end within {:.3g} minutes",
                               std::chrono::duration<double, std::ratio<60>>(limit_).count()),
            .may_be_over_soon = false};
  try {
    std::istringstream lines(end.output);
    for (std::string line; std::getline(lines, line);)
      if (const auto message = registration_message_from(line, "the message of the registration");
          const auto* failed = std::get_if<Failed>(&message))
        return {.why = "error: " + failed->why};
  } catch (const Error& damaged) {
    return {.why = damaged.what()};
  }
  return {.why = fmt::format("the registration ended with status {} and left no result{}{}", end.status,
                             end.errors.empty() ? "" : ": ", end.errors.substr(end.errors.rfind('\n') + 1))};
}

}  // namespace isoshift
