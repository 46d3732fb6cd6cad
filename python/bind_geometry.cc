#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/rotation.h"
#include "geometry/xray_view.h"
#include "io/dicom/file_structure.h"
#include "python/bindings.h"

namespace isoshift::python {

std::vector<Eigen::Isometry3d> poses_from(const Poses& given) {
  const auto& array = given.array;
  const bool is_one = array.ndim() == 2;
  if ((!is_one && array.ndim() != 3) || array.shape(array.ndim() - 1) != 4 || array.shape(array.ndim() - 2) != 4)
    throw py::value_error("a pose has the shape (4, 4), several poses (P, 4, 4)");
  const auto count = static_cast<std::size_t>(is_one ? 1 : array.shape(0));
  std::vector<Eigen::Isometry3d> poses;
  for (std::size_t n = 0; n < count; ++n) {
    Eigen::Affine3d affine;
    affine.matrix() = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(array.data() + 16 * n);
    if (!affine.matrix().allFinite()) throw py::value_error(fmt::format("pose {} is not finite", n));
    const bool is_affine = affine.matrix().row(3) == Eigen::RowVector4d(0, 0, 0, 1);
    const auto rigid = is_affine ? as_rigid(affine) : std::nullopt;
    if (!rigid) throw py::value_error(fmt::format("pose {} is not a rigid motion", n));
    poses.push_back(*rigid);
  }
  return poses;
}

Eigen::Isometry3d pose_from(const Poses& pose) {
  if (pose.array.ndim() != 2 || pose.array.shape(0) != 4 || pose.array.shape(1) != 4)
    throw py::value_error("one pose is expected, of the shape (4, 4)");
  return poses_from(pose).front();
}

void check_size(int columns, int rows) {
  if (columns < 1 || rows < 1 || columns > kMaxEdge || rows > kMaxEdge)
    throw py::value_error(fmt::format("columns and rows are 1 to {}", kMaxEdge));
}

void check_block(int factor, int columns, int rows) {
  if (factor < 1 || factor > columns || factor > rows)
    throw py::value_error(fmt::format("factor is 1 to {}, the image's shorter edge", std::min(columns, rows)));
}

namespace {

XrayView view_of_carm(double gantry_deg, double sad_mm, double sid_mm, int columns, int rows, double pixel_mm,
                      bool is_megavoltage) {
  check_size(columns, rows);
  constexpr double kLongestMm = 1e5, kLeastPixelMm = 1e-3, kLargestPixelMm = 1e2;
  const auto expect = [](bool is_possible, const char* name, double value, const std::string& expected) {
    if (!is_possible) throw py::value_error(fmt::format("{} is {}, expected {}", name, value, expected));
  };
  expect(std::isfinite(gantry_deg), "gantry_deg", gantry_deg, "a finite number");
  expect(sad_mm >= 1.0 && sad_mm <= kLongestMm, "sad_mm", sad_mm, fmt::format("1 to {:g}", kLongestMm));
  expect(sid_mm > sad_mm && sid_mm <= kLongestMm, "sid_mm", sid_mm,
         fmt::format("more than sad_mm, at most {:g}", kLongestMm));
  expect(pixel_mm >= kLeastPixelMm && pixel_mm <= kLargestPixelMm, "pixel_mm", pixel_mm,
         fmt::format("{:g} to {:g}", kLeastPixelMm, kLargestPixelMm));
  const CarmGeometry geometry{.sad_mm = sad_mm,
                              .gantry_angle_rad = rad_from_deg(gantry_deg),
                              .receptor_translation_mm = Eigen::Vector3d(0.0, 0.0, sad_mm - sid_mm),
                              .column_spacing_mm = pixel_mm,
                              .row_spacing_mm = pixel_mm,
                              .position_mm = Eigen::Vector2d(-0.5 * (columns - 1), 0.5 * (rows - 1)) * pixel_mm,
                              .columns = columns,
                              .rows = rows};
  return make_xray_view(geometry, is_megavoltage ? Beam::kMegavoltage : Beam::kKilovoltage);
}

}  // namespace

void bind_geometry(py::module_& module) {
  py::class_<XrayView>(
      module, "XrayView",
      "The camera of an X-ray in the room (IEC 61217 fixed, mm, origin at the isocenter). Pixel centers "
      "lie at integer (column, row).")
      .def_readonly("columns", &XrayView::columns, "The width of the image, pixels.")
      .def_readonly("rows", &XrayView::rows, "The height of the image, pixels.")
      .def_property_readonly(
          "pixel_from_room", [](const XrayView& view) { return view.pixel_from_room; },
          "The projection, shape (3, 4): homogeneous (column, row, 1) of a room point.")
      .def_property_readonly(
          "source_room_mm", [](const XrayView& view) { return view.source_room_mm; }, "The focal spot, shape (3,).")
      .def_property_readonly(
          "is_megavoltage", [](const XrayView& view) { return view.beam == Beam::kMegavoltage; },
          "Whether the treatment beam made the image.")
      .def(
          "project", [](const XrayView& view, const Eigen::Vector3d& room_mm) { return view.project(room_mm); },
          py::arg("room_mm"), "(column, row) of a room point, or None at or behind the source.")
      .def(
          "downscaled",
          [](const XrayView& view, int factor) {
            check_block(factor, view.columns, view.rows);
            return view.downscaled(factor);
          },
          py::arg("factor"), "The same receptor, read out in blocks of factor x factor pixels.");
  module.def("carm_view", &view_of_carm, py::arg("gantry_deg"), py::kw_only(), py::arg("sad_mm") = 1000.0,
             py::arg("sid_mm") = 1500.0, py::arg("columns") = 512, py::arg("rows") = 512, py::arg("pixel_mm") = 0.8,
             py::arg("is_megavoltage") = false,
             "The view of a linac's imager whose receptor is centered on the central ray; pixel_mm on the receptor.");
  module.def(
      "view_from_matrix",
      [](const Eigen::Matrix<double, 3, 4>& pixel_from_room, double sid_mm, int columns, int rows,
         bool is_megavoltage) {
        check_size(columns, rows);
        return xray_view_from_matrix(pixel_from_room, sid_mm, columns, rows,
                                     is_megavoltage ? Beam::kMegavoltage : Beam::kKilovoltage);
      },
      py::arg("pixel_from_room"), py::kw_only(), py::arg("sid_mm"), py::arg("columns"), py::arg("rows"),
      py::arg("is_megavoltage") = false,
      "The view of any imager by its projection, shape (3, 4), up to scale, and the distance of its receptor's plane "
      "from the source.");
}

}  // namespace isoshift::python
