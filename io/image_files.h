#pragma once
// Images for people (PNG) and for programs (MetaImage).

#include <array>
#include <cstdint>
#include <filesystem>

#include "geometry/image.h"
#include "geometry/xray_view.h"

namespace isoshift {

using Rgb = std::array<std::uint8_t, 3>;

// Throws Error naming the file if it cannot be written.
void write_png(const std::filesystem::path& path, const Image<Rgb>& image);

// A MetaImage with float elements, little endian, header and data in one .mha file. `spacing_mm` between columns and
// between rows, on the receptor.
void write_mha(const std::filesystem::path& path, const Image<float>& image, const std::array<double, 2>& spacing_mm);

}  // namespace isoshift
