#pragma once
// Every reader of isoshift on one file of unknown content. Refusing it with Error is right; anything else is not.

#include <filesystem>
#include <functional>
#include <map>
#include <string>

namespace isoshift {

// By name: ct, enhanced_ct, rt_image, rt_plan, rt_structures, spatial_registration, decoder. Each reads all that it
// would in use, pixels included, and throws what reading throws.
extern const std::map<std::string, std::function<void(const std::filesystem::path&)>> kReaders;

}  // namespace isoshift
