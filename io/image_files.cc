#include "io/image_files.h"

#include <cairo.h>
#include <fmt/format.h>

#include <bit>
#include <memory>
#include <string>

#include "geometry/error.h"
#include "io/output_folder.h"

namespace isoshift {

void write_png(const std::filesystem::path& path, const Image<Rgb>& image) {
  const std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)> surface(
      cairo_image_surface_create(CAIRO_FORMAT_RGB24, image.columns, image.rows), &cairo_surface_destroy);
  unsigned char* data = cairo_image_surface_get_data(surface.get());
  if (data == nullptr)
    throw Error(fmt::format("{}: no picture of {} x {} pixels can be made", path.string(), image.columns, image.rows));
  const int stride = cairo_image_surface_get_stride(surface.get());
  for (int row = 0; row < image.rows; ++row) {
    auto* pixels = reinterpret_cast<std::uint32_t*>(data + static_cast<std::ptrdiff_t>(row) * stride);
    for (int column = 0; column < image.columns; ++column) {
      const Rgb& color = image.at(column, row);
      pixels[column] = (std::uint32_t{color[0]} << 16) | (std::uint32_t{color[1]} << 8) | color[2];
    }
  }
  cairo_surface_mark_dirty(surface.get());

  // Encoded in memory: write_text() then reports a full disk like every other output does.
  std::string encoded;
  const auto append = [](void* closure, const unsigned char* bytes, unsigned int count) {
    static_cast<std::string*>(closure)->append(reinterpret_cast<const char*>(bytes), count);
    return CAIRO_STATUS_SUCCESS;
  };
  if (const auto status = cairo_surface_write_to_png_stream(surface.get(), append, &encoded);
      status != CAIRO_STATUS_SUCCESS)
    throw Error(fmt::format("{}: cannot be written: {}", path.string(), cairo_status_to_string(status)));
  write_text(path, encoded);
}

void write_mha(const std::filesystem::path& path, const Image<float>& image, const std::array<double, 2>& spacing_mm) {
  static_assert(std::endian::native == std::endian::little, "MetaImages are written in the machine's own byte order");
  std::string file = fmt::format(
      "ObjectType = Image\nNDims = 2\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = False\n"
      "ElementSpacing = {} {}\nDimSize = {} {}\nElementType = MET_FLOAT\nElementDataFile = LOCAL\n",
      spacing_mm[0], spacing_mm[1], image.columns, image.rows);
  file.append(reinterpret_cast<const char*>(image.pixels.data()), image.pixels.size() * sizeof(float));
  write_text(path, file);
}

}  // namespace isoshift
