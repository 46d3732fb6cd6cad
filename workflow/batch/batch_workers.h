#pragma once
// Processes that register cases side by side. If a process dies, only its current case fails.

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace isoshift {

struct BatchJob {
  std::string name;
  std::string ct_key;  // jobs with equal keys go to one worker, one after the other
};

// Hands the jobs to `workers` processes that run this program with `arguments`. A worker writes a line when it is
// ready. It reads names of cases from its standard input, one per line, and writes each name when its case has ended.
// `on_end` is called with every name, and with the cause of death if the worker died. When `should_stop` returns true,
// the function gives up the running cases and returns. Throws Error if the workers cannot start.
void run_in_workers(std::vector<BatchJob> jobs, int workers, const std::vector<std::string>& arguments,
                    const std::function<void(const std::string& name, const std::optional<std::string>& death)>& on_end,
                    const std::function<bool()>& should_stop);

// The loop of a worker. An exception from `run` ends the whole batch, since the other cases would fail in the same way.
void serve_cases(const std::function<void(const std::string& name)>& run);

}  // namespace isoshift
