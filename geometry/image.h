#pragma once
// An owning 2D image, row-major: pixel (column, row) lies at index row * columns + column.

#include <cstddef>
#include <vector>

namespace isoshift {

template <class T>
struct Image {
  int columns = 0;
  int rows = 0;
  std::vector<T> pixels;

  Image() = default;
  Image(int column_count, int row_count, T fill = T{})
      : columns(column_count), rows(row_count), pixels(static_cast<std::size_t>(column_count) * row_count, fill) {}

  std::size_t index(int column, int row) const { return static_cast<std::size_t>(row) * columns + column; }
  T& at(int column, int row) { return pixels[index(column, row)]; }
  const T& at(int column, int row) const { return pixels[index(column, row)]; }
};

}  // namespace isoshift
