#include "io/objects/image_files.h"

#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <memory>
#include <string>

#include "base/error.h"
#include "base/output_folder.h"
#include "base/text_file.h"

namespace isoshift {

namespace {

using Surface = std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)>;

std::string encoded(const Surface& surface) {
  cairo_surface_mark_dirty(surface.get());
  std::string bytes;
  const auto append = [](void* closure, const unsigned char* data, unsigned int count) {
    static_cast<std::string*>(closure)->append(reinterpret_cast<const char*>(data), count);
    return CAIRO_STATUS_SUCCESS;
  };
  if (const auto status = cairo_surface_write_to_png_stream(surface.get(), append, &bytes);
      status != CAIRO_STATUS_SUCCESS)
    throw Error(fmt::format("a picture cannot be made: {}", cairo_status_to_string(status)));
  return bytes;
}

Surface surface_of(cairo_format_t format, int columns, int rows) {
  Surface surface(cairo_image_surface_create(format, columns, rows), &cairo_surface_destroy);
  if (cairo_image_surface_get_data(surface.get()) == nullptr)
    throw Error(fmt::format("no picture of {} x {} pixels can be made", columns, rows));
  return surface;
}

}  // namespace

std::string png_of(const Image<std::uint8_t>& gray) {
  const Surface surface = surface_of(CAIRO_FORMAT_A8, gray.columns, gray.rows);  // encoded as gray
  unsigned char* data = cairo_image_surface_get_data(surface.get());
  const int stride = cairo_image_surface_get_stride(surface.get());
  for (int row = 0; row < gray.rows; ++row)
    std::copy_n(&gray.at(0, row), gray.columns, data + static_cast<std::ptrdiff_t>(row) * stride);
  return encoded(surface);
}

Image<std::uint8_t> read_gray_png(const std::filesystem::path& path) {
  expect_no_pipe(path);
  const Surface surface(cairo_image_surface_create_from_png(path.c_str()), &cairo_surface_destroy);
  if (const auto status = cairo_surface_status(surface.get()); status != CAIRO_STATUS_SUCCESS)
    throw Error(fmt::format("{}: cannot be read as a PNG: {}", path.string(), cairo_status_to_string(status)));
  Image<std::uint8_t> gray(cairo_image_surface_get_width(surface.get()), cairo_image_surface_get_height(surface.get()));
  const unsigned char* data = cairo_image_surface_get_data(surface.get());
  const int stride = cairo_image_surface_get_stride(surface.get());
  for (int row = 0; row < gray.rows; ++row) {
    const auto* pixels = reinterpret_cast<const std::uint32_t*>(data + static_cast<std::ptrdiff_t>(row) * stride);
    for (int column = 0; column < gray.columns; ++column) gray.at(column, row) = pixels[column] & 0xFF;
  }
  return gray;
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
