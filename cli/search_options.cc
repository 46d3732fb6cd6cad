#include "cli/search_options.h"

namespace isoshift {

RegistrationOptions SearchOptions::registration() const {
  RegistrationOptions options;
  options.dof = dof == "rigid" ? Dof::kRigid : Dof::kTranslation;
  options.seed = seed;
  return options;
}

void add_search_options(CLI::App& command, SearchOptions& options) {
  command.add_option("--dof", options.dof, "Degrees of freedom: six, or the three translations")
      ->check(CLI::IsMember({"rigid", "translation"}))
      ->capture_default_str();
  command.add_option("--seed", options.seed, "Draws the pixels compared; the only randomness")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
}

}  // namespace isoshift
