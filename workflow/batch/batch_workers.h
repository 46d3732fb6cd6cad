#pragma once
// Processes that register cases side by side. If a process dies, only its current case fails.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "workflow/register/registration_messages.h"

namespace isoshift {

struct BatchJob {
  std::string name;
  std::string ct_key;  // jobs with equal keys go to one worker, one after the other
  RegistrationOrder order;
};

// Hands the jobs to `workers` child processes. `on_end` is called with every name, and with the reason if the case
// failed or its worker died. When `should_stop` returns true, the function gives up the running cases and returns.
// Throws Error if the workers cannot start, and WriteError if a worker cannot write its result: the other cases would
// fail in the same way.
void run_in_workers(
    std::vector<BatchJob> jobs, int workers,
    const std::function<void(const std::string& name, const std::optional<std::string>& failure)>& on_end,
    const std::function<bool()>& should_stop);

}  // namespace isoshift
