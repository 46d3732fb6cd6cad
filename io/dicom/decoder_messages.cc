#include "io/dicom/decoder_messages.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/json_file.h"
#include "base/message.h"

namespace isoshift {

std::string to_line(const FrameToDecode& request) {
  return line_of({{"path", RawText{request.path.string()}}, {"sha256", request.sha256}, {"frame", request.frame}});
}

std::string to_line(const DecodedFrame& answer) {
  if (answer.error) return line_of({{"error", RawText{*answer.error}}});
  return line_of({{"bytes", answer.bytes}});
}

FrameToDecode frame_to_decode_from(const std::string& line, const std::string& name) {
  const nlohmann::json json = json_from(line, name);
  JsonSection message(json, name);
  FrameToDecode request{.path = message.required<RawText>("path", "a path").bytes,
                        .sha256 = message.required<std::string>("sha256", "a hash"),
                        .frame = message.required<int>("frame", "a number")};
  message.end();
  return request;
}

DecodedFrame decoded_frame_from(const std::string& line, const std::string& name) {
  const nlohmann::json json = json_from(line, name);
  JsonSection message(json, name);
  DecodedFrame answer;
  if (auto error = message.find<RawText>("error", "a text"))
    answer.error = std::move(error->bytes);
  else
    answer.bytes = message.required<std::uint64_t>("bytes", "a number of bytes");
  message.end();
  return answer;
}

}  // namespace isoshift
