#include "workflow/imager/imager_names.h"

#include <fmt/format.h>

#include <algorithm>

namespace isoshift {

std::size_t ImagerNames::number_of(bool is_megavoltage, const std::string& machine) {
  const std::pair imager(is_megavoltage, machine);
  const auto known = std::ranges::find(imagers_, imager);
  const auto number = static_cast<std::size_t>(known - imagers_.begin());
  if (known == imagers_.end()) imagers_.push_back(imager);
  return number;
}

std::vector<std::string> ImagerNames::names() const {
  const bool has_several_machines =
      std::ranges::any_of(imagers_, [&](const auto& imager) { return imager.second != imagers_.front().second; });
  std::vector<std::string> names;
  names.reserve(imagers_.size());
  for (const auto& [is_megavoltage, machine] : imagers_) {
    const char* beam = is_megavoltage ? "MV" : "kV";
    names.push_back(has_several_machines
                        ? fmt::format("{} of {}", beam, machine.empty() ? "a machine without a name" : machine)
                        : beam);
  }
  return names;
}

}  // namespace isoshift
