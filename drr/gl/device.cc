#include "drr/gl/device.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <vector>

#include "base/error.h"

namespace isoshift {
namespace {

// Of a UUID as a person copies it ("GPU-1f0e...-..."): its hex digits, in lower case.
std::string hex_digits(std::string uuid) {
  if (uuid.starts_with("GPU-") || uuid.starts_with("gpu-")) uuid.erase(0, 4);
  std::erase(uuid, '-');
  std::ranges::transform(uuid, uuid.begin(), [](unsigned char digit) { return std::tolower(digit); });
  return uuid;
}

}  // namespace

bool GlChoice::is_uuid() const {
  constexpr std::size_t kLongestNumber = 4;
  return gpu.size() > kLongestNumber || !std::ranges::all_of(gpu, [](unsigned char c) { return std::isdigit(c) != 0; });
}

bool GlChoice::is_number_or_uuid() const {
  constexpr std::size_t kDigits = 32;
  const std::string digits = hex_digits(gpu);
  const bool are_hex = std::ranges::all_of(digits, [](unsigned char c) { return std::isxdigit(c) != 0; });
  return !gpu.empty() && (!is_uuid() || (are_hex && digits.size() == kDigits));
}

bool GlChoice::means_number(int number) const { return gpu.empty() || is_uuid() || std::stoi(gpu) == number; }

bool GlChoice::means_uuid(const std::string& uuid) const { return !is_uuid() || hex_digits(gpu) == hex_digits(uuid); }

std::size_t first_usable(std::span<const std::string> names,
                         const std::function<std::optional<std::string>(std::size_t device)>& why_not) {
  std::vector<std::string> reasons;
  for (std::size_t n = 0; n < names.size(); ++n) {
    const std::optional<std::string> reason = why_not(n);
    if (!reason) return n;
    reasons.push_back(fmt::format("{}: {}", names[n], *reason));
  }
  throw Error(fmt::format("{}", fmt::join(reasons, "; ")));
}

}  // namespace isoshift
