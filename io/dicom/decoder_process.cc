#include "io/dicom/decoder_process.h"

#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "base/process.h"
#include "base/sha256.h"
#include "io/dicom/decode.h"
#include "io/dicom/decoder_confinement.h"
#include "io/dicom/decoder_messages.h"
#include "io/dicom/file_bytes.h"

namespace isoshift {
namespace {

// Per frame. What computes without end meets the limit of its confinement; this is for a child that waits for a file,
// or for its turn on a busy computer.
constexpr std::chrono::seconds kMaxWallTime(30);
constexpr std::size_t kMaxErrorBytes = 4096;
constexpr std::size_t kMaxAnswerBytes = 6 * kMaxErrorBytes + 64;  // an error whose every byte is escaped

std::filesystem::path& decoder_program() {
  static std::filesystem::path program;
  return program;
}

class DecoderProcess {
 public:
  DecoderProcess()
      : process_({"isoshift-decode"},
                 {.program = program(), .errors = ProcessOptions::Errors::kDropped, .end_signal = SIGKILL}) {}

  std::vector<std::uint8_t> frame(const DicomFile& file, int frame, std::size_t bytes) {
    const std::string path = file.path().string();
    process_.allow(kMaxWallTime);
    is_usable_ = false;  // until all went well
    const DecodedFrame answer = answer_to(
        {.path = std::filesystem::absolute(file.path()), .sha256 = std::string(file.sha256()), .frame = frame}, path);
    if (answer.error) {
      is_usable_ = true;
      throw Error(*answer.error);
    }
    if (answer.bytes != bytes)
      throw Error(
          fmt::format("{}: frame {} was decoded to {} bytes, expected {}", path, frame + 1, answer.bytes, bytes));
    std::vector<std::uint8_t> pixels(bytes);
    if (!process_.channel().read(pixels, process_.deadline()))
      throw Error(fmt::format("{}: {}", path, what_went_wrong()));
    is_usable_ = true;
    return pixels;
  }

  bool is_usable() const { return is_usable_; }

 private:
  static const std::filesystem::path& program() {
    if (decoder_program().empty())
      throw Error(
          "compressed pixel data cannot be decoded: the program isoshift, whose part decodes it, was not found.\n"
          "       Install it, or name it: ISOSHIFT_PROGRAM in the environment of Python, use_decoder() in C++.");
    return decoder_program();
  }

  DecodedFrame answer_to(const FrameToDecode& request, const std::string& path) {
    std::optional<std::string> line;
    try {
      if (process_.channel().send(to_line(request), process_.deadline()))
        line = process_.channel().line(process_.deadline(), kMaxAnswerBytes);
    } catch (const Error& endless) {
      throw Error(fmt::format("{}: the decoder {}", path, endless.what()));
    }
    if (!line) throw Error(fmt::format("{}: {}", path, what_went_wrong()));
    return decoded_frame_from(*line, fmt::format("{}: the answer of the decoder", path));
  }

  std::string what_went_wrong() {
    constexpr const char* kDamaged = "the pixel data are damaged, or made to do harm";
    const ProcessEnd end = process_.wait();
    if (end.is_late)
      return fmt::format("its pixel data were not decoded within {} s: the computer is too busy, or {}",
                         kMaxWallTime.count(), kDamaged);
    return fmt::format("the decoder ended with {} {}: {}", end.signal != 0 ? "signal" : "status",
                       end.signal != 0 ? end.signal : end.status, kDamaged);
  }

  Process process_;
  bool is_usable_ = true;
};

// Children that wait for work. As many as threads ever decoded at a time.
class IdleDecoders {
 public:
  std::unique_ptr<DecoderProcess> take() {
    const std::lock_guard lock(mutex_);
    forget_those_of_the_parent();
    if (idle_.empty()) return nullptr;
    auto process = std::move(idle_.back());
    idle_.pop_back();
    return process;
  }
  void put(std::unique_ptr<DecoderProcess> process) {
    const std::lock_guard lock(mutex_);
    forget_those_of_the_parent();
    idle_.push_back(std::move(process));
  }
  void end_all() {
    const std::lock_guard lock(mutex_);
    forget_those_of_the_parent();
    idle_.clear();
  }

 private:
  // A process that was forked may neither use nor end the children of its parent.
  void forget_those_of_the_parent() {
    if (owner_ == ::getpid()) return;
    for (std::unique_ptr<DecoderProcess>& process : idle_) (void)process.release();
    idle_.clear();
    owner_ = ::getpid();
  }

  std::mutex mutex_;
  std::vector<std::unique_ptr<DecoderProcess>> idle_;
  pid_t owner_ = ::getpid();
};

// Never destroyed: the children end when the other end of their socket is gone.
IdleDecoders& idle_decoders() {
  static auto& decoders = *new IdleDecoders;
  return decoders;
}

// The bytes of the file that was asked for last: frames of a file come one after another.
class LastFile {
 public:
  std::string_view at(const std::filesystem::path& path, std::string_view sha256) {
    if (sha256_ != sha256) {
      sha256_.clear();
      FileBytes file(path);
      bytes_ = file.whole(file.size());
      if (sha256_of(bytes_) != sha256) throw Error(fmt::format("{}: was changed while it was read", path.string()));
      sha256_ = sha256;
    }
    return bytes_;
  }

 private:
  std::string sha256_, bytes_;
};

bool send_answer(Channel& parent, const DecodedFrame& answer, std::span<const std::uint8_t> pixels = {}) {
  return parent.send(to_line(answer)) && parent.send({reinterpret_cast<const char*>(pixels.data()), pixels.size()});
}

// A child of this process ends with it.
void end_with(pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);  // it ended before
}

// All that a child of the child does.
bool answer_frame(Channel& parent, const FrameToDecode& request, std::string_view file) {
  DecodedFrame answer;
  std::vector<std::uint8_t> pixels;
  try {
    confine_decoder();
    FileBytes bytes(file, request.path);
    pixels = decompressed_frame(DicomFile(bytes, DicomFile::Extent::kWhole), request.frame);
    answer.bytes = pixels.size();
  } catch (const Error& refused) {
    answer.error = std::string(refused.what()).substr(0, kMaxErrorBytes);
  } catch (const std::exception& failed) {
    answer.error = fmt::format("{}: its pixel data cannot be decoded: {}", request.path.string(), failed.what());
  }
  return send_answer(parent, answer, pixels);
}

// Ends this process as its child ended, unless that one answered.
void end_like(pid_t child) {
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFSIGNALED(status)) {
    const rlimit none{.rlim_cur = 0, .rlim_max = 0};
    ::setrlimit(RLIMIT_CORE, &none);
    ::signal(WTERMSIG(status), SIG_DFL);
    ::raise(WTERMSIG(status));
  }
  if (status != 0) ::_exit(WIFEXITED(status) ? WEXITSTATUS(status) : 1);
}

}  // namespace

void use_decoder(std::filesystem::path program) {
  idle_decoders().end_all();
  decoder_program() = std::move(program);
}

std::filesystem::path decoder_of(const std::filesystem::path& isoshift) {
  return std::filesystem::weakly_canonical(isoshift).parent_path().parent_path() / "libexec/isoshift-decode";
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
  Channel parent(parent_socket());
  prepare_decoding();
  LastFile last;
  while (const std::optional<std::string> line = parent.line()) {
    try {
      const FrameToDecode request = frame_to_decode_from(*line, "the request of the parent");
      const std::string_view file = last.at(request.path, request.sha256);
      const pid_t self = ::getpid(), child = ::fork();
      if (child == 0) {
        end_with(self);
        ::_exit(answer_frame(parent, request, file) ? 0 : 1);
      }
      if (child < 0) throw Error(fmt::format("{}: no process can be made that decodes it", request.path.string()));
      end_like(child);
    } catch (const Error& refused) {
      if (!send_answer(parent, {.error = std::string(refused.what()).substr(0, kMaxErrorBytes)})) return 1;
    }
  }
  return 0;
}

}  // namespace isoshift
