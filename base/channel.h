#pragma once
// Lines and bytes to and from the process at the other end of a socket.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace isoshift {

class Channel {
 public:
  using Time = std::chrono::steady_clock::time_point;

  explicit Channel(int socket) : socket_(socket) {}  // closes the socket in the end
  ~Channel();
  Channel(const Channel&) = delete;
  Channel& operator=(const Channel&) = delete;

  int socket() const { return socket_; }

  // Sends all of it. Returns false if the other end is gone, or did not take it all by then.
  bool send(std::string_view bytes, Time until = Time::max());
  // Tells the other end that nothing more will be sent.
  void end_sending();

  // Waits until something arrives, and keeps it.
  enum class Heard { kSomething, kNothing, kEnd };
  Heard hear(Time until);
  // The first line that was heard, without its end, once it is complete.
  std::optional<std::string> take_line();
  // All that was heard and not taken.
  const std::string& heard() const { return heard_; }

  // Waits for a line. Nothing if the other end is gone, or did not send it by then. Throws Error for a line that is
  // longer than `longest`.
  std::optional<std::string> line(Time until = Time::max(),
                                  std::size_t longest = std::numeric_limits<std::size_t>::max());
  // Waits for so many bytes. Returns false if the other end is gone, or did not send them by then.
  bool read(std::span<std::uint8_t> bytes, Time until);

 private:
  int socket_;
  std::string heard_;
};

}  // namespace isoshift
