#include "workflow/register/registration_process.h"

#include <fmt/format.h>

#include <sstream>
#include <variant>

#include "base/error.h"

namespace isoshift {

RegistrationProcess::RegistrationProcess(const RegistrationOrder& order, std::chrono::milliseconds limit)
    : limit_(limit),
      process_({"isoshift", "__child", "register"},
               {.program = this_program(), .limit = limit, .errors = ProcessOptions::Errors::kKept}) {
  // A child that died is found by end().
  process_.channel().send(to_line(order), process_.deadline());
  process_.channel().end_sending();
}

void RegistrationProcess::hear(const std::string& line) {
  if (!failure_.empty()) return;
  try {
    const RegistrationMessage message = registration_message_from(line, "the message of the registration");
    if (const auto* progressed = std::get_if<Progressed>(&message)) progress_ = *progressed;
    if (const auto* result = std::get_if<Ended>(&message)) ended_ = *result;
    if (const auto* failed = std::get_if<Failed>(&message)) failure_ = "error: " + failed->why;
  } catch (const Error& damaged) {
    failure_ = damaged.what();
  }
}

std::optional<RegistrationProcess::End> RegistrationProcess::end() {
  const std::optional<ProcessEnd> ended = process_.end(std::chrono::milliseconds(0));
  if (!ended) {
    while (const auto line = process_.channel().take_line()) hear(*line);
    return std::nullopt;
  }
  std::istringstream lines(ended->output);
  for (std::string line; std::getline(lines, line);) hear(line);
  if (ended_ && failure_.empty()) return End{.failure = "", .files = ended_->files};
  return End{.failure = failure_of(*ended), .is_late = ended->is_late};
}

std::string RegistrationProcess::failure_of(const ProcessEnd& end) const {
  if (end.is_late)
    return fmt::format("the registration did not end within {:.3g} minutes",
                       std::chrono::duration<double, std::ratio<60>>(limit_).count());
  if (!failure_.empty()) return failure_;
  return fmt::format("the registration ended with status {} and left no result{}{}", end.status,
                     end.errors.empty() ? "" : ": ", end.errors.substr(end.errors.rfind('\n') + 1));
}

}  // namespace isoshift
