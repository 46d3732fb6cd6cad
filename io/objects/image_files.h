#pragma once
// Images for people (PNG) and for programs (MetaImage).

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>

#include "geometry/image.h"
#include "geometry/xray_view.h"

namespace isoshift {

using Rgb = std::array<std::uint8_t, 3>;

// A gray picture as the bytes of a PNG file, and back. Reading throws Error naming the file.
std::string png_of(const Image<std::uint8_t>& gray);
Image<std::uint8_t> read_gray_png(const std::filesystem::path& path);

// A MetaImage with float elements, little endian, header and data in one .mha file. `spacing_mm` between columns and
// between rows, on the receptor.
void write_mha(const std::filesystem::path& path, const Image<float>& image, const std::array<double, 2>& spacing_mm);

}  // namespace isoshift
