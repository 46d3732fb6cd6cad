// import isoshift: the libraries for Python (docs/python.md).

#include <pybind11/pybind11.h>
#include <unistd.h>

#include <exception>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "base/version.h"
#include "io/dicom/decoder_process.h"
#include "python/bindings.h"

namespace isoshift::python {

py::str text_of(std::string_view text) {
  PyObject* decoded = PyUnicode_DecodeUTF8(text.data(), static_cast<Py_ssize_t>(text.size()), "backslashreplace");
  if (decoded == nullptr) throw py::error_already_set();
  return py::reinterpret_steal<py::str>(decoded);
}

py::list texts_of(const std::vector<std::string>& texts) {
  py::list list;
  for (const std::string& text : texts) list.append(text_of(text));
  return list;
}

namespace {

// The classes of the module live as long as the interpreter.
PyObject *error_class = nullptr, *usage_error_class = nullptr;

void translate(std::exception_ptr thrown) {  // NOLINT(performance-unnecessary-value-param): pybind11 calls it so
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const UsageError& error) {
    PyErr_SetObject(usage_error_class, text_of(error.what()).ptr());
  } catch (const Error& error) {
    PyErr_SetObject(error_class, text_of(error.what()).ptr());
  }
}

void bind_errors(py::module_& module) {
  error_class = py::exception<Error>(module, "Error", PyExc_RuntimeError).inc_ref().ptr();
  usage_error_class = py::exception<UsageError>(module, "UsageError", error_class).inc_ref().ptr();
  py::register_exception_translator(&translate);
}

}  // namespace
}  // namespace isoshift::python

PYBIND11_MODULE(_isoshift, module) {
  namespace py = pybind11;
  isoshift::python::bind_errors(module);
  module.attr("__version__") = isoshift::kVersion;
  module.def(
      "use_decoder",
      [](const std::string& program) {
        const bool is_program = !std::filesystem::is_directory(program) && ::access(program.c_str(), X_OK) == 0;
        if (!program.empty() && !is_program) throw isoshift::Error(program + ": is no program");
        isoshift::use_decoder(program.empty() ? std::filesystem::path() : isoshift::decoder_of(program));
      },
      py::arg("program"),
      "Name the program isoshift, whose part isoshift-decode decodes compressed pixels in processes of their own.");
  isoshift::python::bind_geometry(module);
  isoshift::python::bind_study(module);
  isoshift::python::bind_drr(module);
  isoshift::python::bind_registration(module);
}
