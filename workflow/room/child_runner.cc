#include "workflow/room/child_runner.h"

namespace isoshift {

void ChildRunner::begin(const RegistrationOrder& order) {
  child_ = std::make_unique<RegistrationProcess>(order, limit_);
}

std::optional<Runner::End> ChildRunner::end() {
  const std::optional<RegistrationProcess::End> ended = child_->end();
  if (!ended) return std::nullopt;
  child_.reset();
  if (ended->failure.empty()) return End{.files = ended->files};
  return End{.failure = Failure{.why = ended->failure, .may_be_over_soon = !ended->is_late}};
}

}  // namespace isoshift
