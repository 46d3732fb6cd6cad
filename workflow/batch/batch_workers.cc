#include "workflow/batch/batch_workers.h"

#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <iostream>
#include <list>
#include <memory>
#include <set>
#include <utility>

#include "base/child_process.h"
#include "base/error.h"

namespace isoshift {
namespace {

using Clock = std::chrono::steady_clock;

constexpr char kStop = '!';  // begins a line that says why no case can be registered any more

// A child on the other end of a socket that is its standard input and output.
class Worker {
 public:
  explicit Worker(const std::vector<std::string>& arguments) {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
      throw Error(fmt::format("no worker can be started: {}", std::strerror(errno)));
    socket_ = ends[0];
    std::vector<std::string> words = {"isoshift"};
    words.insert(words.end(), arguments.begin(), arguments.end());
    try {
      process_ = start_child(this_program(), std::move(words), {.in = ends[1], .out = ends[1], .err = -1});
    } catch (const Error&) {
      ::close(ends[0]);
      ::close(ends[1]);
      throw;
    }
    ::close(ends[1]);
  }
  ~Worker() {
    ::close(socket_);
    if (process_ == 0) return;
    ::kill(process_, SIGTERM);
    ::waitpid(process_, nullptr, 0);
  }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  int socket() const { return socket_; }
  const std::optional<BatchJob>& job() const { return job_; }
  const std::string& last_ct() const { return last_ct_; }

  void give(BatchJob job) {
    const std::string line = job.name + "\n";
    last_ct_ = job.ct_key;
    job_ = std::move(job);
    deadline_ = Clock::now() + kLongestRegistration;
    ::send(socket_, line.data(), line.size(), MSG_NOSIGNAL);  // one that died is found when it is read from
  }

  // Reads what is there. False: it died. Throws Error for what would befall every other case, too.
  bool hear() {
    char buffer[512];
    const ssize_t count = ::recv(socket_, buffer, sizeof buffer, 0);
    if (count <= 0) return false;
    heard_.append(buffer, static_cast<std::size_t>(count));
    for (std::size_t end = 0; (end = heard_.find('\n')) != std::string::npos; heard_.erase(0, end + 1)) {
      if (heard_.front() == kStop) throw Error(heard_.substr(1, end - 1));
      if (is_ready_ && job_ && heard_.compare(0, end, job_->name) == 0) job_.reset();
      is_ready_ = true;  // its first line says so
    }
    return true;
  }
  bool is_ready() const { return is_ready_; }

  void kill_if_late() {
    if (!job_ || is_late_ || Clock::now() < deadline_) return;
    is_late_ = true;
    ::kill(process_, SIGKILL);
  }

  // Of one that has died.
  struct Death {
    std::string why;
    bool from_outside = false;  // a signal that programs do not give themselves
  };
  Death death() {
    int status = 0;
    ::waitpid(std::exchange(process_, 0), &status, 0);
    if (is_late_) return {fmt::format("it did not end within {} minutes", kLongestRegistration.count()), false};
    if (WIFSIGNALED(status))
      return {fmt::format("the program was ended by signal {} ({})", WTERMSIG(status), ::strsignal(WTERMSIG(status))),
              WTERMSIG(status) == SIGKILL || WTERMSIG(status) == SIGTERM};
    return {fmt::format("the program ended with status {}", WEXITSTATUS(status)), WEXITSTATUS(status) == 128 + SIGTERM};
  }

 private:
  int socket_ = -1;
  pid_t process_ = 0;
  bool is_ready_ = false;
  std::string heard_;
  std::optional<BatchJob> job_;
  Clock::time_point deadline_;  // of its job
  bool is_late_ = false;
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

}  // namespace

void run_in_workers(std::vector<BatchJob> all, int count, const std::vector<std::string>& arguments,
                    const std::function<void(const std::string& name, const std::optional<std::string>& death)>& on_end,
                    const std::function<bool()>& should_stop) {
  std::list<BatchJob> jobs(std::make_move_iterator(all.begin()), std::make_move_iterator(all.end()));
  std::list<std::unique_ptr<Worker>> workers;
  std::set<std::string> tried_twice;
  for (;;) {
    auto idle = static_cast<std::size_t>(std::ranges::count_if(workers, [](const auto& w) { return !w->job(); }));
    for (; workers.size() < static_cast<std::size_t>(count) && idle < jobs.size(); ++idle)
      workers.push_back(std::make_unique<Worker>(arguments));
    for (const auto& worker : workers) {
      if (worker->job() || jobs.empty()) continue;
      const auto next = next_for(*worker, jobs, workers);
      worker->give(std::move(*next));
      jobs.erase(next);
    }
    if (should_stop() || std::ranges::none_of(workers, [](const auto& worker) { return worker->job().has_value(); }))
      return;
    std::vector<pollfd> polled;
    for (const auto& worker : workers) polled.push_back({.fd = worker->socket(), .events = POLLIN, .revents = 0});
    constexpr int kPatienceMs = 200;
    ::poll(polled.data(), polled.size(), kPatienceMs);
    auto event = polled.begin();
    for (auto worker = workers.begin(); worker != workers.end(); ++event) {
      const auto now = worker++;
      (*now)->kill_if_late();
      if (event->revents == 0) continue;
      const std::optional<BatchJob> job = (*now)->job();
      const bool is_alive = (*now)->hear();
      if (is_alive && (*now)->job().has_value() == job.has_value()) continue;
      if (should_stop()) return;  // the signal that says so has reached the workers, too
      if (!(*now)->is_ready()) throw Error(fmt::format("a worker could not begin: {}", (*now)->death().why));
      const std::optional<Worker::Death> death = is_alive ? std::nullopt : std::optional((*now)->death());
      if (!is_alive) workers.erase(now);
      // One that was killed from outside may have been in nobody's way: its case has another try.
      if (job && death && death->from_outside && tried_twice.insert(job->name).second)
        jobs.push_front(*job);
      else if (job)
        on_end(job->name, death ? std::optional(death->why) : std::nullopt);
    }
  }
}

void serve_cases(const std::function<void(const std::string& name)>& run) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // nobody would be told of what it does any more
  std::cout << "ready" << std::endl;
  for (std::string name; std::getline(std::cin, name);) {
    try {
      run(name);
      std::cout << name << std::endl;
    } catch (const std::exception& error) {
      std::string why = error.what();
      std::ranges::replace(why, '\n', ' ');
      std::cout << kStop << why << std::endl;
    }
  }
}

}  // namespace isoshift
