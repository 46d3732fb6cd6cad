#pragma once
// Which OpenGL to render on.

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>

namespace isoshift {

// A GPU, or Mesa's llvmpipe on the CPU, which is used only if a person asks for it.
enum class GlDevice { kHardware, kSoftware };

struct GlChoice {
  GlDevice kind = GlDevice::kHardware;
  // Which of several GPUs: its number or UUID as `isoshift inspect --devices` lists them. Empty: the first that works.
  std::string gpu;

  GlChoice() = default;
  GlChoice(GlDevice device, std::string which = {}) : kind(device), gpu(std::move(which)) {}

  bool operator==(const GlChoice&) const = default;

  // Whether a device with that number and UUID (hex digits, empty if the driver tells none) is meant.
  bool means_number(int number) const;
  bool means_uuid(const std::string& uuid) const;
  bool is_uuid() const;  // and not a number
  // Whether it can mean a device at all.
  bool is_number_or_uuid() const;
};

// Takes devices, by their names for people, one after the other until `why_not` has nothing against one, and returns
// its number. Throws Error with what speaks against each of them.
std::size_t first_usable(std::span<const std::string> names,
                         const std::function<std::optional<std::string>(std::size_t device)>& why_not);

}  // namespace isoshift
