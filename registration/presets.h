#pragma once
// Ways to register, as data.

#include <array>
#include <string_view>

#include "registration/register_views.h"

namespace isoshift {

// setup: the default, for a patient's setup. fast: the best within 0.2 s, with fewer checks and so for review. paper:
// the founding paper's, one stage of a local optimizer on sparse pixels.
inline constexpr std::array kPresets = {"setup", "fast", "paper"};

// Throws UsageError for a name that is none of them.
RegistrationOptions preset(std::string_view name);

}  // namespace isoshift
