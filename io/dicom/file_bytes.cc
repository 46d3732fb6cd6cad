#include "io/dicom/file_bytes.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "base/text_file.h"

namespace isoshift {
namespace {

constexpr std::size_t kBuffer = std::size_t{64} << 10;  // holds the header of most files

[[noreturn]] void fail(const std::filesystem::path& path, int reason) {
  throw Error(fmt::format("{}: cannot be read as a DICOM file: {}", path.string(), std::strerror(reason)));
}

}  // namespace

FileBytes::FileBytes(std::filesystem::path path) : path_(std::move(path)) {
  expect_no_pipe(path_);
  descriptor_ = ::open(path_.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor_ < 0) fail(path_, errno);
  struct stat status{};
  const int failed = ::fstat(descriptor_, &status) != 0 ? errno : S_ISDIR(status.st_mode) ? EISDIR : 0;
  if (failed != 0) {
    ::close(descriptor_);
    fail(path_, failed);
  }
  size_ = static_cast<std::uint64_t>(status.st_size);
}

FileBytes::FileBytes(std::string_view bytes, std::filesystem::path path)
    : path_(std::move(path)), size_(bytes.size()), in_memory_(bytes) {}

FileBytes::~FileBytes() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::string_view FileBytes::piece(std::uint64_t at, std::size_t count) {
  if (at >= size_) return {};
  count = static_cast<std::size_t>(std::min<std::uint64_t>({count, kLongestPiece, size_ - at}));
  if (descriptor_ < 0) return in_memory_.substr(static_cast<std::size_t>(at), count);
  if (at < buffer_at_ || at + count > buffer_at_ + buffer_.size()) {
    buffer_.resize(std::max(count, kBuffer));
    buffer_at_ = at;
    std::size_t have = 0;
    while (have < count) {
      const auto read =
          ::pread(descriptor_, buffer_.data() + have, buffer_.size() - have, static_cast<off_t>(at + have));
      if (read < 0) fail(path_, errno);
      if (read == 0) break;  // it has become shorter
      have += static_cast<std::size_t>(read);
    }
    buffer_.resize(have);
  }
  return std::string_view(buffer_).substr(static_cast<std::size_t>(at - buffer_at_), count);
}

std::string FileBytes::whole(std::uint64_t max) {
  if (size_ > max) throw Error(fmt::format("{}: has {} bytes, expected at most {}", path_.string(), size_, max));
  std::string bytes;
  bytes.reserve(static_cast<std::size_t>(size_));
  for (std::string_view next = piece(0, kLongestPiece); !next.empty(); next = piece(bytes.size(), kLongestPiece))
    bytes.append(next);
  return bytes;
}

}  // namespace isoshift
