#pragma once
// Messages to the child that decodes compressed pixels, and its answers.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace isoshift {

struct FrameToDecode {
  std::filesystem::path path;
  std::string sha256;  // of the file's content, hexadecimal
  int frame = 0;

  bool operator==(const FrameToDecode&) const = default;
};

// Either an error, or the number of bytes that follow after the line.
struct DecodedFrame {
  std::optional<std::string> error;
  std::uint64_t bytes = 0;

  bool operator==(const DecodedFrame&) const = default;
};

std::string to_line(const FrameToDecode& request);
std::string to_line(const DecodedFrame& answer);

// Throws Error for a message that is damaged or unknown. `name` is what the Error calls it: "the message of a worker".
FrameToDecode frame_to_decode_from(const std::string& line, const std::string& name);
DecodedFrame decoded_frame_from(const std::string& line, const std::string& name);

}  // namespace isoshift
