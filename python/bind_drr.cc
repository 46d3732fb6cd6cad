#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include "drr/renderer.h"
#include "io/dicom/ct_series.h"
#include "io/objects/image_files.h"
#include "io/report/view_picture.h"
#include "python/bindings.h"
#include "workflow/register/rendering_options.h"

namespace isoshift::python {
namespace {

using Views = std::vector<XrayView>;
using Pixels = std::vector<std::vector<std::uint32_t>>;

std::shared_ptr<Renderer> renderer_of(const CtSeries& ct, const std::string& kind, bool megavoltage,
                                      const std::string& attenuation, double threshold_hu,
                                      const std::optional<std::string>& gl) {
  RenderingOptions options;
  options.renderer = kind;
  options.attenuation = attenuation;
  options.threshold_hu = threshold_hu;
  options.gl = gl;
  options.check();
  const std::vector<Beam> beams =
      megavoltage ? std::vector{Beam::kKilovoltage, Beam::kMegavoltage} : std::vector{Beam::kKilovoltage};
  const py::gil_scoped_release released;
  return make_renderer(options.kind(), ct.hu, options.model(), beams, options.options());
}

// One array per view, of shape (poses, rows, columns, ...) or, of listed pixels, (poses, pixels, ...), without a copy.
template <class Part>
py::list arrays_of(std::shared_ptr<RenderResult> result, const Views& views, std::size_t poses, const PixelSet& pixels,
                   int values_per_pixel, Part part) {
  const py::capsule owner(new std::shared_ptr<RenderResult>(std::move(result)),
                          [](void* kept) { delete static_cast<std::shared_ptr<RenderResult>*>(kept); });
  py::list arrays;
  for (std::size_t view = 0; view < views.size(); ++view) {
    const auto count = static_cast<py::ssize_t>(pixels.count(views, view));
    const float* first = part(0, view);
    const py::ssize_t pose_bytes =
        poses > 1 ? (part(1, view) - first) * static_cast<py::ssize_t>(sizeof(float)) : py::ssize_t{0};
    const auto pixel_bytes = static_cast<py::ssize_t>(sizeof(float)) * values_per_pixel;
    std::vector<py::ssize_t> shape = {static_cast<py::ssize_t>(poses)}, strides = {pose_bytes};
    if (pixels.of_view.empty()) {
      shape.insert(shape.end(), {views[view].rows, views[view].columns});
      strides.insert(strides.end(), {views[view].columns * pixel_bytes, pixel_bytes});
    } else {
      shape.push_back(count);
      strides.push_back(pixel_bytes);
    }
    if (values_per_pixel > 1) {
      shape.push_back(values_per_pixel);
      strides.push_back(sizeof(float));
    }
    arrays.append(py::array_t<float>(shape, strides, first, owner));
  }
  return arrays;
}

struct Rendered {
  std::shared_ptr<RenderResult> result;
  std::size_t poses;
};

py::list line_integrals_of(const Rendered& rendered, const Views& views, const PixelSet& pixels) {
  const RenderResult& result = *rendered.result;
  return arrays_of(rendered.result, views, rendered.poses, pixels, 1,
                   [&](std::size_t pose, std::size_t view) { return result.line_integrals(pose, view).data(); });
}

py::list render(Renderer& renderer, const Views& views, const Poses& room_from_patient, const Pixels& pixels) {
  const std::vector<Eigen::Isometry3d> poses = poses_from(room_from_patient);
  const PixelSet set{pixels};
  Rendered rendered{.result = {}, .poses = poses.size()};
  {
    const py::gil_scoped_release released;
    rendered.result = std::make_shared<RenderResult>(renderer.render(views, poses, set));
  }
  return line_integrals_of(rendered, views, set);
}

py::tuple render_with_derivatives(Renderer& renderer, const Views& views, const Poses& room_from_patient,
                                  const Pixels& pixels) {
  const std::vector<Eigen::Isometry3d> poses = poses_from(room_from_patient);
  const PixelSet set{pixels};
  Rendered rendered{.result = {}, .poses = poses.size()};
  {
    const py::gil_scoped_release released;
    rendered.result = std::make_shared<RenderResult>(renderer.render_with_derivatives(views, poses, set));
  }
  const RenderResult& result = *rendered.result;
  return py::make_tuple(
      line_integrals_of(rendered, views, set),
      arrays_of(rendered.result, views, poses.size(), set, 6,
                [&](std::size_t pose, std::size_t view) { return result.derivatives(pose, view).data()->data(); }));
}

}  // namespace

void bind_drr(py::module_& module) {
  module.def(
      "png",
      [](const RealArray<float>& given) {
        const auto& line_integrals = given.array;
        if (line_integrals.ndim() != 2) throw py::value_error("an image has the shape (rows, columns)");
        const auto is_number = [](float value) { return std::isfinite(value); };
        if (line_integrals.size() == 0 ||
            !std::all_of(line_integrals.data(), line_integrals.data() + line_integrals.size(), is_number))
          throw py::value_error("an image has pixels, and all are finite numbers");
        Image<float> image(static_cast<int>(line_integrals.shape(1)), static_cast<int>(line_integrals.shape(0)));
        std::copy_n(line_integrals.data(), image.pixels.size(), image.pixels.begin());
        return py::bytes(png_of(radiograph(image)));
      },
      py::arg("image"), "Line integrals, shape (rows, columns), as a radiograph: a PNG file in which dense is bright.");
  py::class_<Renderer, std::shared_ptr<Renderer>>(
      module, "Renderer",
      "Digitally reconstructed radiographs of one CT: line integrals of attenuation (dimensionless) from the focal "
      "spot to the centers of pixels, in batches of poses and views.")
      .def(py::init(&renderer_of), py::arg("ct"), py::kw_only(), py::arg("renderer") = "cpu",
           py::arg("megavoltage") = false, py::arg("attenuation") = "physical", py::arg("threshold_hu") = -540.0,
           py::arg("gl") = py::none(),
           "renderer: cpu, raycast (OpenGL), auto (which of both this computer has), the oracles siddon and "
           "trilinear, or the founding paper's. megavoltage: views of both beam qualities can be rendered. gl: "
           "hardware or software, for renderers that use OpenGL; None: hardware.")
      .def_property_readonly("device", &Renderer::device, "What renders: the CPU and its instructions, or a GPU.")
      .def_property_readonly(
          "kind", [](const Renderer& self) { return std::string(to_string(self.kind())); },
          "The argument renderer; of auto, what was chosen.")
      .def_property_readonly("has_derivatives", &Renderer::has_derivatives,
                             "Whether render_with_derivatives() and Objective.models() can be called.")
      .def("render", &render, py::arg("views"), py::arg("room_from_patient"), py::arg("pixels") = Pixels(),
           "Poses of shape (4, 4) or (P, 4, 4) make one float32 array per view, of shape (P, rows, columns). pixels: "
           "per view the indices row * columns + column of the pixels that are rendered; the arrays are then of "
           "shape (P, pixels).")
      .def("render_with_derivatives", &render_with_derivatives, py::arg("views"), py::arg("room_from_patient"),
           py::arg("pixels") = Pixels(),
           "The same, and per view an array with a last axis of six: how each line integral changes per mm of "
           "translation of the patient along the room's x, y and z, and per rad of rotation about x, y and z through "
           "the isocenter.");
}

}  // namespace isoshift::python
