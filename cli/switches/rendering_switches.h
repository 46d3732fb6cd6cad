#pragma once
// The flags that say how DRRs are rendered: the same for every command that renders.

#include <CLI/CLI.hpp>

#include "workflow/register/rendering_options.h"

namespace isoshift {

void add_rendering_options(CLI::App& command, RenderingOptions& options);
void add_gl_options(CLI::App& command, std::optional<std::string>& gl, std::optional<std::string>& gpu);

}  // namespace isoshift
