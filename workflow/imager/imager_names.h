#pragma once
// The imagers of X-rays: the kV or the MV system of a machine.

#include <string>
#include <utility>
#include <vector>

namespace isoshift {

class ImagerNames {
 public:
  // The number of an imager, from 0; it is added if it is new. `machine`: Radiation Machine Name; empty: unknown.
  std::size_t number_of(bool is_megavoltage, const std::string& machine);

  // By number: "kV", "MV"; of several machines "kV of LINAC1", "kV of a machine without a name".
  std::vector<std::string> names() const;

 private:
  std::vector<std::pair<bool, std::string>> imagers_;
};

}  // namespace isoshift
