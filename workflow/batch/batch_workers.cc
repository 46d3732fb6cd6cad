#include "workflow/batch/batch_workers.h"

#include <fmt/format.h>
#include <poll.h>
#include <string.h>

#include <algorithm>
#include <filesystem>
#include <list>
#include <memory>
#include <set>
#include <utility>
#include <variant>

#include "base/error.h"
#include "base/process.h"

namespace isoshift {
namespace {

// A child that registers one case after the other.
class Worker {
 public:
  explicit Worker(int number)
      : process_({"isoshift", "__child", "register"},
                 {.program = this_program(), .errors = ProcessOptions::Errors::kInherited}),
        number_(number) {}

  int socket() { return process_.channel().socket(); }
  bool is_ready() const { return is_ready_; }
  const std::optional<BatchJob>& job() const { return job_; }
  const std::string& last_ct() const { return last_ct_; }

  void give(BatchJob job) {
    last_ct_ = job.ct_key;
    job_ = std::move(job);
    job_->order.worker = number_;
    process_.allow(kLongestRegistration);
    process_.channel().send(to_line(job_->order), process_.deadline());  // one that died is found when it is read from
  }

  // The end of a job. `failure`: why it has no result.
  struct JobEnd {
    BatchJob job;
    std::optional<std::string> failure;
    bool is_from_outside = false;  // the worker was killed from outside, so the job may not be the cause
  };
  // Reads what there is. Throws WriteError for what would befall every other case, too.
  std::optional<JobEnd> hear() {
    process_.kill_if_late();
    const bool has_died = process_.channel().hear(Channel::Time()) == Channel::Heard::kEnd;
    std::optional<JobEnd> end;
    try {
      while (const auto line = process_.channel().take_line())
        take(registration_message_from(*line, "the message of a worker"), end);
    } catch (const WriteError&) {
      throw;
    } catch (const Error& damaged) {
      damage_ = damaged.what();
    }
    if (damage_.empty() && !has_died) return end;
    is_alive_ = false;
    if (job_) end = end_of_job(why_it_died());
    return end;
  }
  bool is_alive() const { return is_alive_; }

  std::string why_it_died() {
    if (!damage_.empty()) return damage_;
    const ProcessEnd end = process_.wait();
    is_from_outside_ = end.is_from_outside();
    if (end.is_late) return fmt::format("it did not end within {} minutes", kLongestRegistration.count());
    if (end.signal != 0)
      return fmt::format("the program was ended by signal {} ({})", end.signal, ::strsignal(end.signal));
    return fmt::format("the program ended with status {}", end.status);
  }

 private:
  void take(const RegistrationMessage& message, std::optional<JobEnd>& end) {
    if (std::holds_alternative<Ready>(message) != !is_ready_ || (is_ready_ && !job_))
      throw Error("the message of a worker: answers no order");
    if (!std::exchange(is_ready_, true)) return;
    const auto* failed = std::get_if<Failed>(&message);
    if (failed != nullptr && failed->is_of_disk) throw WriteError(failed->why);
    end = end_of_job(failed != nullptr ? std::optional(failed->why) : std::nullopt);
  }

  JobEnd end_of_job(std::optional<std::string> failure) {
    process_.allow(std::nullopt);
    return {
        .job = *std::exchange(job_, std::nullopt), .failure = std::move(failure), .is_from_outside = is_from_outside_};
  }

  Process process_;
  int number_;
  bool is_ready_ = false, is_alive_ = true, is_from_outside_ = false;
  std::string damage_;  // what is wrong with its message; empty: nothing
  std::optional<BatchJob> job_;
  std::string last_ct_;
};

// The next job for a worker: of the CT it holds, else of one that no other worker holds, else any.
std::list<BatchJob>::iterator next_for(const Worker& worker, std::list<BatchJob>& jobs,
                                       const std::list<std::unique_ptr<Worker>>& workers) {
  const auto own = std::ranges::find(jobs, worker.last_ct(), &BatchJob::ct_key);
  if (own != jobs.end()) return own;
  const auto is_free = [&](const BatchJob& job) {
    return std::ranges::none_of(workers, [&](const auto& other) { return other->last_ct() == job.ct_key; });
  };
  const auto free = std::ranges::find_if(jobs, is_free);
  return free != jobs.end() ? free : jobs.begin();
}

using Workers = std::list<std::unique_ptr<Worker>>;

// Starts workers, up to that many in all, while there are more jobs than idle workers.
void start_workers(std::size_t most, std::size_t jobs, Workers& workers, int& started) {
  auto idle = static_cast<std::size_t>(std::ranges::count_if(workers, [](const auto& w) { return !w->job(); }));
  for (; workers.size() < most && idle < jobs; ++idle) workers.push_back(std::make_unique<Worker>(started++));
}

// Until a worker has something to say, but not for long.
void wait_for(const Workers& workers) {
  constexpr int kPatienceMs = 200;
  std::vector<pollfd> polled;
  for (const auto& worker : workers) polled.push_back({.fd = worker->socket(), .events = POLLIN, .revents = 0});
  ::poll(polled.data(), polled.size(), kPatienceMs);
}

}  // namespace

void run_in_workers(
    std::vector<BatchJob> all, int count,
    const std::function<void(const std::string& name, const std::optional<std::string>& failure)>& on_end,
    const std::function<bool()>& should_stop) {
  std::list<BatchJob> jobs(std::make_move_iterator(all.begin()), std::make_move_iterator(all.end()));
  Workers workers;
  std::set<std::string> tried_twice;
  int started = 0;
  for (;;) {
    start_workers(static_cast<std::size_t>(count), jobs.size(), workers, started);
    for (const auto& worker : workers) {
      if (worker->job() || jobs.empty()) continue;
      const auto next = next_for(*worker, jobs, workers);
      worker->give(std::move(*next));
      jobs.erase(next);
    }
    if (should_stop() || std::ranges::none_of(workers, [](const auto& worker) { return worker->job().has_value(); }))
      return;
    wait_for(workers);
    for (auto worker = workers.begin(); worker != workers.end();) {
      const auto now = worker++;
      const std::optional<Worker::JobEnd> end = (*now)->hear();
      if (!end && (*now)->is_alive()) continue;
      if (should_stop()) return;  // the signal that says so has reached the workers, too
      if (!(*now)->is_ready()) throw Error(fmt::format("a worker could not begin: {}", (*now)->why_it_died()));
      if (!(*now)->is_alive()) workers.erase(now);
      if (!end) continue;
      // If a worker was killed from outside, its case may not be the cause, and gets a second try.
      if (end->is_from_outside && !std::filesystem::exists(end->job.order.output) &&
          tried_twice.insert(end->job.name).second)
        jobs.push_front(end->job);
      else
        on_end(end->job.name, end->failure);
    }
  }
}

}  // namespace isoshift
