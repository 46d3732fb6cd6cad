#include "cli/switches/search_switches.h"

#include "registration/presets.h"

namespace isoshift {
namespace {

template <class Kinds>
std::vector<std::string> names_of(const Kinds& kinds) {
  std::vector<std::string> names;
  names.reserve(kinds.size());
  for (const auto kind : kinds) names.emplace_back(to_string(kind));
  return names;
}

}  // namespace

void add_search_switches(CLI::App& command, SearchRequest& options) {
  command.add_option("--preset", options.preset, "How poses are searched; docs/presets.md describes each preset")
      ->check(CLI::IsMember(std::vector<std::string>(kPresets.begin(), kPresets.end())))
      ->capture_default_str();
  command.add_option("--similarity", options.similarity, "With --preset paper: similarity [src]")
      ->check(CLI::IsMember(names_of(kSimilarityKinds)));
  command.add_option("--optimizer", options.optimizer, "With --preset paper: optimizer [nelder-mead]")
      ->check(CLI::IsMember(names_of(kOptimizerKinds)));
  command
      .add_option("--pixel-fraction", options.pixel_fraction,
                  "With --preset paper: share of the pixels that are compared [0.05]")
      ->check(CLI::Range(0.001, 1.0));
  command.add_option("--dof", options.dof, "Degrees of freedom: six, or the three translations")
      ->check(CLI::IsMember({"rigid", "translation"}))
      ->capture_default_str();
  command.add_flag("--check-vertebrae", options.check_vertebrae,
                   "Also try poses with the patient one vertebra further toward the head and toward the feet");
  command
      .add_option("--seed", options.seed,
                  "Seed of the random choice of compared pixels and of candidates; nothing else is random")
      ->capture_default_str();
}

}  // namespace isoshift
