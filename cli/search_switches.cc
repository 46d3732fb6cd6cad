#include "cli/search_switches.h"

#include "registration/presets.h"

namespace isoshift {

RegistrationOptions SearchSwitches::registration() const {
  RegistrationOptions options = isoshift::preset(preset);
  options.dof = dof == "rigid" ? Dof::kRigid : Dof::kTranslation;
  options.seed = seed;
  return options;
}

void add_search_switches(CLI::App& command, SearchSwitches& options) {
  command.add_option("--preset", options.preset, "How to search: docs/presets.md says what is in each")
      ->check(CLI::IsMember(std::vector<std::string>(kPresets.begin(), kPresets.end())))
      ->capture_default_str();
  command.add_option("--dof", options.dof, "Degrees of freedom: six, or the three translations")
      ->check(CLI::IsMember({"rigid", "translation"}))
      ->capture_default_str();
  command.add_option("--seed", options.seed, "Draws the pixels compared; the only randomness")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
}

}  // namespace isoshift
