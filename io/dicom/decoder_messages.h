#pragma once
// What is said to the child that decodes compressed pixels, and what it answers.

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

// Either the error, or the number of bytes; these follow after the line.
struct DecodedFrame {
  std::optional<std::string> error;
  std::uint64_t bytes = 0;

  bool operator==(const DecodedFrame&) const = default;
};

std::string to_line(const FrameToDecode& request);
std::string to_line(const DecodedFrame& answer);

// `name` is how an Error calls a message that is damaged or unknown, with its sender: "the message of a worker".
FrameToDecode frame_to_decode_from(const std::string& line, const std::string& name);
DecodedFrame decoded_frame_from(const std::string& line, const std::string& name);

}  // namespace isoshift
