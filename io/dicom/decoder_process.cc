#include "io/dicom/decoder_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "base/error.h"
#include "io/dicom/decode.h"

namespace isoshift {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kMaxWallTime(10);  // per frame: the largest takes about one
constexpr rlim_t kMaxCpuS = 10;
constexpr rlim_t kMaxMemoryBytes = rlim_t{4} << 30;
constexpr std::uint64_t kMaxErrorBytes = 4096;

struct Request {
  std::uint64_t path_bytes = 0;   // the path follows
  std::array<char, 64> sha256{};  // of the file's content, hexadecimal
  std::int32_t frame = 0;
};

struct Answer {
  std::uint8_t is_error = 0;
  std::uint64_t bytes = 0;  // pixels, or the text of the error, follow
};

std::filesystem::path& decoder_program() {
  static std::filesystem::path program;
  return program;
}

// Both ends of a child's standard input and output, a socket: writing to a child that died is no signal.
class Connection {
 public:
  explicit Connection(int fd) : fd_(fd) {}
  ~Connection() { ::close(fd_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  // False where the other side is gone.
  bool send(const void* data, std::size_t size) const {
    const auto* at = static_cast<const char*>(data);
    while (size > 0) {
      const ssize_t sent = ::send(fd_, at, size, MSG_NOSIGNAL);
      if (sent < 0 && errno == EINTR) continue;
      if (sent <= 0) return false;
      at += sent;
      size -= static_cast<std::size_t>(sent);
    }
    return true;
  }

  // False where the other side is gone, or has not sent all by then.
  bool receive(void* data, std::size_t size, std::optional<Clock::time_point> until = std::nullopt) const {
    auto* at = static_cast<char*>(data);
    while (size > 0) {
      if (until) {
        const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(*until - Clock::now()).count();
        pollfd waiting{.fd = fd_, .events = POLLIN, .revents = 0};
        if (left <= 0) return false;
        const int ready = ::poll(&waiting, 1, static_cast<int>(left));
        if (ready < 0 && errno == EINTR) continue;
        if (ready <= 0) return false;
      }
      const ssize_t received = ::recv(fd_, at, size, 0);
      if (received < 0 && errno == EINTR) continue;
      if (received <= 0) return false;
      at += received;
      size -= static_cast<std::size_t>(received);
    }
    return true;
  }

 private:
  int fd_;
};

class DecoderProcess {
 public:
  DecoderProcess() {
    const std::filesystem::path& program = decoder_program();
    if (program.empty()) throw Error("compressed pixel data cannot be decoded: no decoder program was set");
    std::array<int, 2> ends{};
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
      throw Error(fmt::format("the decoder cannot be started: {}", std::strerror(errno)));
    connection_ = std::make_unique<Connection>(ends[0]);
    const Connection of_child(ends[1]);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, ends[1], STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&files, ends[1], STDOUT_FILENO);
    posix_spawn_file_actions_addopen(&files, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    std::string name = program.string(), command = "__decode";
    const std::array<char*, 3> arguments = {name.data(), command.data(), nullptr};
    const int failed = ::posix_spawn(&pid_, name.c_str(), &files, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&files);
    if (failed != 0) throw Error(fmt::format("{}: cannot be started as a decoder: {}", name, std::strerror(failed)));
  }
  ~DecoderProcess() { end(); }
  DecoderProcess(const DecoderProcess&) = delete;
  DecoderProcess& operator=(const DecoderProcess&) = delete;

  std::vector<std::uint8_t> frame(const DicomFile& file, int frame, std::size_t bytes) {
    const std::filesystem::path& path = file.path();
    const auto until = Clock::now() + kMaxWallTime;
    const std::string name = std::filesystem::absolute(path).string();
    Request request{.path_bytes = name.size(), .frame = frame};
    std::ranges::copy(file.sha256(), request.sha256.begin());
    Answer answer;
    is_usable_ = false;  // until all went well
    if (!connection_->send(&request, sizeof request) || !connection_->send(name.data(), name.size()) ||
        !connection_->receive(&answer, sizeof answer, until))
      throw Error(fmt::format("{}: {}", path.string(), what_went_wrong(until)));
    if (answer.is_error != 0) {
      std::string message(std::min(answer.bytes, kMaxErrorBytes), ' ');
      if (!connection_->receive(message.data(), message.size(), until))
        throw Error(fmt::format("{}: {}", path.string(), what_went_wrong(until)));
      is_usable_ = true;
      throw Error(message);
    }
    if (answer.bytes != bytes)
      throw Error(fmt::format("{}: frame {} was decoded to {} bytes, expected {}", path.string(), frame + 1,
                              answer.bytes, bytes));
    std::vector<std::uint8_t> pixels(bytes);
    if (!connection_->receive(pixels.data(), pixels.size(), until))
      throw Error(fmt::format("{}: {}", path.string(), what_went_wrong(until)));
    is_usable_ = true;
    return pixels;
  }

  bool is_usable() const { return is_usable_; }

 private:
  // The status of a child that ended before counts, not the signal sent here.
  int end() {
    int status = 0;
    if (pid_ <= 0) return status;
    ::kill(pid_, SIGKILL);
    while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    pid_ = -1;
    return status;
  }

  std::string what_went_wrong(Clock::time_point until) {
    constexpr const char* kDamaged = "the pixel data are damaged, or made to do harm";
    if (Clock::now() >= until)
      return fmt::format("its pixel data were not decoded within {} s: {}", kMaxWallTime.count(), kDamaged);
    const int status = end();
    return fmt::format("the decoder ended with {} {}: {}", WIFSIGNALED(status) ? "signal" : "status",
                       WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status), kDamaged);
  }

  pid_t pid_ = -1;
  std::unique_ptr<Connection> connection_;
  bool is_usable_ = true;
};

// Children that wait for work. As many as threads ever decoded at a time.
class IdleDecoders {
 public:
  std::unique_ptr<DecoderProcess> take() {
    const std::lock_guard lock(mutex_);
    if (idle_.empty()) return nullptr;
    auto process = std::move(idle_.back());
    idle_.pop_back();
    return process;
  }
  void put(std::unique_ptr<DecoderProcess> process) {
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(process));
  }
  void end_all() {
    const std::lock_guard lock(mutex_);
    idle_.clear();
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<DecoderProcess>> idle_;
};

IdleDecoders& idle_decoders() {
  static IdleDecoders decoders;
  return decoders;
}

// The file that the child read last: frames of one file come one after another.
class LastFile {
 public:
  const DicomFile& at(const std::filesystem::path& path, std::string_view sha256) {
    if (file_ && file_->sha256() == sha256) return *file_;
    file_.reset();
    file_ = DicomFile::read(path, DicomFile::Extent::kWhole);
    if (file_->sha256() != sha256) throw Error(fmt::format("{}: was changed while it was read", path.string()));
    return *file_;
  }

 private:
  std::optional<DicomFile> file_;
};

// Of the child, before it looks at a file. (The address sanitizer needs all addresses there are.)
void limit_resources() {
  const auto limit = [](auto resource, rlim_t soft, rlim_t hard) {
    const rlimit value{.rlim_cur = soft, .rlim_max = hard};
    ::setrlimit(resource, &value);
  };
#ifndef __SANITIZE_ADDRESS__
  limit(RLIMIT_AS, kMaxMemoryBytes, kMaxMemoryBytes);
#endif
  limit(RLIMIT_FSIZE, 0, 0);
  limit(RLIMIT_CORE, 0, 0);
  rusage used{};
  ::getrusage(RUSAGE_SELF, &used);
  const auto used_s = static_cast<rlim_t>(used.ru_utime.tv_sec + used.ru_stime.tv_sec);
  limit(RLIMIT_CPU, used_s + 1 + kMaxCpuS, RLIM_INFINITY);
}

}  // namespace

void use_decoder(std::filesystem::path program) {
  idle_decoders().end_all();
  decoder_program() = std::move(program);
}

std::vector<std::uint8_t> frame_from_decoder(const DicomFile& file, int frame, std::size_t bytes) {
  std::unique_ptr<DecoderProcess> process = idle_decoders().take();
  if (!process) process = std::make_unique<DecoderProcess>();
  struct PutBack {
    std::unique_ptr<DecoderProcess>& process;
    ~PutBack() {
      if (process->is_usable()) idle_decoders().put(std::move(process));
    }
  } const put_back{process};
  return process->frame(file, frame, bytes);
}

int run_decoder() {
  const Connection connection(STDIN_FILENO);
  LastFile file;
  Request request;
  while (connection.receive(&request, sizeof request)) {
    std::string path(request.path_bytes, '\0');
    if (!connection.receive(path.data(), path.size())) return 1;
    limit_resources();
    std::vector<std::uint8_t> pixels;
    std::string error;
    try {
      pixels = decompressed_frame(file.at(path, {request.sha256.data(), request.sha256.size()}), request.frame);
    } catch (const Error& refused) {
      error = std::string(refused.what()).substr(0, kMaxErrorBytes);
    } catch (const std::exception& failed) {
      error = fmt::format("{}: its pixel data cannot be decoded: {}", path, failed.what());
    }
    const Answer answer{.is_error = !error.empty(), .bytes = error.empty() ? pixels.size() : error.size()};
    if (!connection.send(&answer, sizeof answer)) return 1;
    const bool sent =
        error.empty() ? connection.send(pixels.data(), pixels.size()) : connection.send(error.data(), error.size());
    if (!sent) return 1;
  }
  return 0;
}

}  // namespace isoshift
