// import isoshift: the libraries for Python (docs/python.md).

#include <pybind11/pybind11.h>

#include "base/error.h"
#include "base/version.h"
#include "io/dicom/decoder_process.h"
#include "python/bindings.h"

PYBIND11_MODULE(_isoshift, module) {
  namespace py = pybind11;
  const auto error = py::register_exception<isoshift::Error>(module, "Error", PyExc_RuntimeError);
  py::register_exception<isoshift::UsageError>(module, "UsageError", error.ptr());
  module.attr("__version__") = isoshift::kVersion;
  module.def("use_decoder", &isoshift::use_decoder, py::arg("program"),
             "Name the program isoshift, which decodes compressed pixels in a process of their own.");
  isoshift::python::bind_geometry(module);
  isoshift::python::bind_study(module);
  isoshift::python::bind_drr(module);
  isoshift::python::bind_registration(module);
}
