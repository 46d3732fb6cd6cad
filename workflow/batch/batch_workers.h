#pragma once
// Processes that register cases side by side. One that dies takes its case with it, and nothing else.

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace isoshift {

struct BatchJob {
  std::string name;
  std::string ct_key;  // jobs with equal ones go to one worker, one after the other
};

// Hands the jobs to `workers` processes that run this program with `arguments`: a worker reads names of cases
// from its standard input, one per line, and writes a line when it is ready, and each name when its case has ended.
// `on_end` is told every name, and why the worker died where it did. Returns early when `should_stop` says so; what
// runs then is given up. Throws Error where workers cannot even begin.
void run_in_workers(std::vector<BatchJob> jobs, int workers, const std::vector<std::string>& arguments,
                    const std::function<void(const std::string& name, const std::optional<std::string>& death)>& on_end,
                    const std::function<bool()>& should_stop);

// The loop of a worker. What `run` throws ends the whole batch: there is no use in going on.
void serve_cases(const std::function<void(const std::string& name)>& run);

}  // namespace isoshift
