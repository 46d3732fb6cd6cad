#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "base/error.h"
#include "base/stopwatch.h"
#include "geometry/xray_image.h"
#include "io/dicom/ct_series.h"
#include "io/study/study.h"
#include "python/bindings.h"
#include "workflow/observer.h"
#include "workflow/register/setup_result_of.h"
#include "workflow/register/study_options.h"

namespace isoshift::python {
namespace {

using Paths = std::vector<std::filesystem::path>;
using PathOrPaths = std::variant<Paths, std::filesystem::path>;

Paths paths_from(const PathOrPaths& given) {
  if (const auto* path = std::get_if<std::filesystem::path>(&given)) return {*path};
  return std::get<Paths>(given);
}

// What a person allows, as the program's --allow says it.
std::vector<std::string> allowances(const std::map<std::string, std::string>& allow) {
  std::vector<std::string> texts;
  texts.reserve(allow.size());
  for (const auto& [key, reason] : allow) {
    if (key.find('=') != key.npos) throw UsageError(fmt::format("allow: no check has the key \"{}\"", key));
    texts.push_back(fmt::format("{}={}", key, reason));
  }
  return texts;
}

std::shared_ptr<LoadedStudy> load_study_for_python(StudyOptions options, const std::filesystem::path& site) {
  options.max_span_s = max_span_s_of(named_site(site));
  auto loaded = std::make_shared<LoadedStudy>();
  Observer nobody;
  const Stopwatch watch;
  loaded->study = load(options, loaded->notes, nobody);
  loaded->seconds = watch.seconds();
  loaded->max_span_s = options.max_span_s;
  return loaded;
}

XrayImage xray_of(const XrayView& view, const RealArray<float>& given, const std::string& label,
                  bool is_line_integral) {
  const auto& values = given.array;
  if (values.ndim() != 2 || values.shape(0) != view.rows || values.shape(1) != view.columns)
    throw py::value_error(fmt::format("values: expected the shape of the view, ({}, {})", view.rows, view.columns));
  XrayImage xray{.label = label,
                 .view = view,
                 .values = Image<float>(view.columns, view.rows),
                 .meaning = is_line_integral ? XrayImage::Meaning::kLineIntegral : XrayImage::Meaning::kIntensity};
  std::copy_n(values.data(), xray.values.pixels.size(), xray.values.pixels.begin());
  const auto is_value = [&](float value) { return std::isfinite(value) && (is_line_integral || value >= 0.0F); };
  if (!std::ranges::all_of(xray.values.pixels, is_value))
    throw py::value_error("values: expected finite numbers, of intensities none below 0");
  return xray;
}

py::array_t<float> voxels_of(const py::object& self) {
  const Volume<float>& hu = self.cast<const CtSeries&>().hu;
  return read_only(py::array_t<float>({static_cast<py::ssize_t>(hu.size.z()), static_cast<py::ssize_t>(hu.size.y()),
                                       static_cast<py::ssize_t>(hu.size.x())},
                                      hu.voxels.data(), self));
}

void bind_images(py::module_& module) {
  py::class_<CtSeries, std::shared_ptr<CtSeries>>(module, "CtSeries", "The planning CT.")
      .def_property_readonly("hu", &voxels_of, "Hounsfield units, float32, shape (slices, rows, columns).")
      .def_property_readonly(
          "patient_from_voxel", [](const CtSeries& ct) { return Eigen::Matrix4d(ct.hu.patient_from_voxel.matrix()); },
          "Takes (column, row, slice) to DICOM patient coordinates (LPS), mm; shape (4, 4).")
      .def_readonly("series_instance_uid", &CtSeries::series_instance_uid, "SeriesInstanceUID.")
      .def_readonly("frame_of_reference_uid", &CtSeries::frame_of_reference_uid, "FrameOfReferenceUID.");
  py::class_<XrayImage>(module, "XrayImage", "An X-ray with its camera: of a study, or made of one's own pixels.")
      .def(py::init(&xray_of), py::arg("view"), py::arg("values"), py::kw_only(), py::arg("label") = "",
           py::arg("is_line_integral") = false,
           "values: shape (rows, columns) of the view; intensities, in which 0 is no radiation, or line integrals of "
           "any scale and offset.")
      .def_property_readonly(
          "label", [](const XrayImage& xray) { return text_of(xray.label); }, "RTImageLabel, or the name of the file.")
      .def_readonly("view", &XrayImage::view, "Its camera.")
      .def_property_readonly(
          "values", [](const py::object& self) { return array_of(self.cast<const XrayImage&>().values, self); },
          "float32, shape (rows, columns): intensities, or line integrals where is_line_integral is true.")
      .def_property_readonly(
          "is_line_integral", [](const XrayImage& xray) { return xray.meaning == XrayImage::Meaning::kLineIntegral; },
          "Whether values grow with the attenuation along the ray, and not with the intensity.");
}

void bind_loaded_study(py::module_& module) {
  py::class_<LoadedStudy, std::shared_ptr<LoadedStudy>>(
      module, "Study", "CT, plan and X-rays of one setup, read and checked as the program does.")
      .def_property_readonly(
          "ct", [](const LoadedStudy& loaded) { return std::const_pointer_cast<CtSeries>(loaded.study.ct); },
          "The planning CT.")
      .def_property_readonly(
          "xrays",
          [](const py::object& self) {
            py::list xrays;
            for (const XrayImage& xray : self.cast<const LoadedStudy&>().study.xrays)
              xrays.append(py::cast(xray, py::return_value_policy::reference_internal, self));
            return xrays;
          },
          "In the order of their acquisition.")
      .def_property_readonly(
          "views",
          [](const LoadedStudy& loaded) {
            std::vector<XrayView> views;
            views.reserve(loaded.study.xrays.size());
            for (const XrayImage& xray : loaded.study.xrays) views.push_back(xray.view);
            return views;
          },
          "The cameras of the X-rays.")
      .def_property_readonly(
          "planned_room_from_patient",
          [](const LoadedStudy& loaded) { return matrix_of(loaded.study.planned_room_from_patient); },
          "The planned pose, shape (4, 4): takes DICOM patient coordinates (LPS) to the room (IEC 61217 fixed), mm.")
      .def_property_readonly(
          "isocenter_patient_mm", [](const LoadedStudy& loaded) { return loaded.study.isocenter_patient_mm; },
          "The plan's isocenter in DICOM patient coordinates (LPS), mm; shape (3,).")
      .def_property_readonly(
          "warnings", [](const LoadedStudy& loaded) { return texts_of(loaded.notes.warnings); },
          "What a person should know.")
      .def_property_readonly(
          "overrides", [](const LoadedStudy& loaded) { return texts_of(loaded.notes.overrides); },
          "What arguments or a machine profile said in place of the files.")
      .def_property_readonly(
          "left_aside", [](const LoadedStudy& loaded) { return texts_of(loaded.notes.left_aside); },
          "Files that were not used, and why.");
}

}  // namespace

void bind_study(py::module_& module) {
  bind_images(module);
  bind_loaded_study(module);
  module.def(
      "load_study",
      [](const std::filesystem::path& folder, const PathOrPaths& ct, const PathOrPaths& images,
         const std::filesystem::path& plan, const std::filesystem::path& structures, const std::string& session,
         const std::string& date, std::optional<int> fraction, bool latest, const std::filesystem::path& machine,
         const std::vector<double>& isocenter, const std::string& patient_position, const std::string& intensity,
         const std::map<std::string, double>& gantry_angles_deg, std::optional<double> couch_angle_deg,
         std::optional<double> couch_pitch_deg, std::optional<double> couch_roll_deg, std::optional<double> sad_mm,
         std::optional<double> sid_mm, const std::vector<double>& rt_image_position, bool assume_centered,
         const std::map<std::string, std::string>& allow, const std::filesystem::path& site) {
        StudyOptions options;
        options.parts = {.study = folder,
                         .session = {.name = session, .date = date, .fraction = fraction, .is_latest = latest},
                         .ct = paths_from(ct),
                         .images = paths_from(images),
                         .plan = plan,
                         .structures = structures};
        options.machine = machine;
        options.isocenter = isocenter;
        options.patient_position = patient_position;
        options.intensity = intensity;
        for (const auto& [label, angle_deg] : gantry_angles_deg)
          options.gantry_angles.push_back(fmt::format("{}={}", label, angle_deg));
        options.couch_angle_deg = couch_angle_deg;
        options.couch_pitch_deg = couch_pitch_deg;
        options.couch_roll_deg = couch_roll_deg;
        options.sad_mm = sad_mm;
        options.sid_mm = sid_mm;
        options.rt_image_position = rt_image_position;
        options.assume_centered = assume_centered;
        options.allow = allowances(allow);
        const py::gil_scoped_release released;
        return load_study_for_python(std::move(options), site);
      },
      py::arg("folder") = "", py::kw_only(), py::arg("ct") = Paths(), py::arg("images") = Paths(), py::arg("plan") = "",
      py::arg("structures") = "", py::arg("session") = "", py::arg("date") = "", py::arg("fraction") = py::none(),
      py::arg("latest") = false, py::arg("machine") = "", py::arg("isocenter") = std::vector<double>(),
      py::arg("patient_position") = "", py::arg("intensity") = "",
      py::arg("gantry_angles_deg") = std::map<std::string, double>(), py::arg("couch_angle_deg") = py::none(),
      py::arg("couch_pitch_deg") = py::none(), py::arg("couch_roll_deg") = py::none(), py::arg("sad_mm") = py::none(),
      py::arg("sid_mm") = py::none(), py::arg("rt_image_position") = std::vector<double>(),
      py::arg("assume_centered") = false, py::arg("allow") = std::map<std::string, std::string>(), py::arg("site") = "",
      "Read an exported study. What files lack is never guessed: the arguments supply it, as the flags of isoshift "
      "register. ct, images: a path or a list of paths. allow: what a failed check forbids, by its key, with the "
      "reason. site: a site file, whose max_span_s says how far X-rays may be apart in time; register() takes the same "
      "one. Raises Error naming file, attribute and what was found.");
}

}  // namespace isoshift::python
