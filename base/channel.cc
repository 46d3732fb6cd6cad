#include "base/channel.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "base/error.h"

namespace isoshift {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// Returns false if nothing happened by then.
bool is_ready(int socket, short events, Channel::Time until) {
  for (;;) {
    constexpr std::chrono::milliseconds kLongestPoll(1h);
    const auto now = Clock::now();
    const auto left =
        until - now > kLongestPoll ? kLongestPoll : std::chrono::ceil<std::chrono::milliseconds>(until - now);
    pollfd polled{.fd = socket, .events = events, .revents = 0};
    const int ready = ::poll(&polled, 1, static_cast<int>(std::max(left, 0ms).count()));
    if (ready > 0) return true;
    if (ready == 0 && Clock::now() >= until) return false;
    if (ready < 0 && errno != EINTR) return true;  // reading or writing tells why
  }
}

}  // namespace

Channel::~Channel() { ::close(socket_); }

bool Channel::send(std::string_view bytes, Time until) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent >= 0)
      bytes.remove_prefix(static_cast<std::size_t>(sent));
    else if (errno != EINTR && !((errno == EAGAIN || errno == EWOULDBLOCK) && is_ready(socket_, POLLOUT, until)))
      return false;
  }
  return true;
}

void Channel::end_sending() { ::shutdown(socket_, SHUT_WR); }

Channel::Heard Channel::hear(Time until) {
  if (!is_ready(socket_, POLLIN, until)) return Heard::kNothing;
  std::array<char, 1 << 16> buffer;
  ssize_t count = -1;
  do {
    count = ::read(socket_, buffer.data(), buffer.size());
  } while (count < 0 && errno == EINTR);
  if (count <= 0) return Heard::kEnd;
  heard_.append(buffer.data(), static_cast<std::size_t>(count));
  return Heard::kSomething;
}

std::optional<std::string> Channel::take_line() {
  const std::size_t end = heard_.find('\n');
  if (end == std::string::npos) return std::nullopt;
  std::string line = heard_.substr(0, end);
  heard_.erase(0, end + 1);
  return line;
}

std::optional<std::string> Channel::line(Time until, std::size_t longest) {
  for (;;) {
    if (auto line = take_line()) return line;
    if (heard_.size() > longest) throw Error(fmt::format("sent a line of more than {} bytes", longest));
    if (hear(until) != Heard::kSomething) return std::nullopt;
  }
}

bool Channel::read(std::span<std::uint8_t> bytes, Time until) {
  const std::size_t kept = std::min(heard_.size(), bytes.size());
  std::copy_n(heard_.begin(), kept, bytes.begin());
  heard_.erase(0, kept);
  bytes = bytes.subspan(kept);
  while (!bytes.empty()) {
    if (!is_ready(socket_, POLLIN, until)) return false;
    const ssize_t count = ::read(socket_, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

}  // namespace isoshift
