#pragma once
// The parts of the Python module, and how arrays of numpy and our types become each other. Matrices are 4 x 4, in mm.

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <Eigen/Geometry>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/image.h"
#include "io/study/study.h"

namespace isoshift::python {

namespace py = pybind11;

// A study, and what was noted when it was read.
struct LoadedStudy {
  Study study;
  Notes notes;
  double seconds = 0.0;     // that took
  double max_span_s = 0.0;  // between its views, by which it was checked
};

// Texts may hold the names of files, whose bytes need not be UTF-8: what is not is written as \\xNN.
py::str text_of(std::string_view text);
py::list texts_of(const std::vector<std::string>& texts);

void bind_geometry(py::module_& module);
void bind_study(py::module_& module);
void bind_drr(py::module_& module);
void bind_registration(py::module_& module);

// Real numbers in an array of rows, converted where they are others. Texts and complex numbers are a TypeError.
template <class T>
struct RealArray {
  py::array_t<T, py::array::c_style | py::array::forcecast> array;
};
using Poses = RealArray<double>;

// A pose, shape (4, 4), or a batch of them, shape (P, 4, 4). Throws ValueError for another shape, or where a matrix is
// not a rigid motion within 1e-4.
std::vector<Eigen::Isometry3d> poses_from(const Poses& poses);
Eigen::Isometry3d pose_from(const Poses& pose);
inline Eigen::Matrix4d matrix_of(const Eigen::Isometry3d& pose) { return pose.matrix(); }

// Throws ValueError for a size that no image has, and for a block that is not within one.
void check_size(int columns, int rows);
void check_block(int factor, int columns, int rows);

// What is read from files stays as it was read.
template <class T>
py::array_t<T> read_only(py::array_t<T> array) {
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

// The image as an array of shape (rows, columns), without a copy: `owner` keeps it.
template <class T>
py::array_t<T> array_of(const Image<T>& image, const py::handle& owner) {
  return read_only(py::array_t<T>({static_cast<py::ssize_t>(image.rows), static_cast<py::ssize_t>(image.columns)},
                                  image.pixels.data(), owner));
}

}  // namespace isoshift::python

template <class T>
struct pybind11::detail::type_caster<isoshift::python::RealArray<T>> {
  PYBIND11_TYPE_CASTER(isoshift::python::RealArray<T>, handle_type_name<array_t<T>>::name);

  bool load(handle from, bool) {
    constexpr std::string_view kReal = "fiub";  // numpy's kinds: floating point, integers, truth values
    const array any = array::ensure(from);
    if (!any || kReal.find(any.dtype().kind()) == std::string_view::npos) return false;
    value.array = decltype(value.array)::ensure(any);
    return static_cast<bool>(value.array);
  }
};
