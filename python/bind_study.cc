#include <fmt/format.h>

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "geometry/xray_image.h"
#include "io/dicom/ct_series.h"
#include "io/study/study.h"
#include "python/bindings.h"
#include "workflow/observer.h"
#include "workflow/register/study_options.h"

namespace isoshift::python {
namespace {

// What a person allows, as the program's --allow says it.
std::vector<std::string> allowances(const std::map<std::string, std::string>& allow) {
  std::vector<std::string> texts;
  for (const auto& [key, reason] : allow) texts.push_back(key + "=" + reason);
  return texts;
}

std::shared_ptr<LoadedStudy> load_study_for_python(const StudyOptions& options) {
  auto loaded = std::make_shared<LoadedStudy>();
  Observer nobody;
  loaded->study = load(options, loaded->notes, nobody);
  return loaded;
}

py::array_t<float> voxels_of(const py::object& self) {
  const Volume<float>& hu = self.cast<const CtSeries&>().hu;
  return read_only(py::array_t<float>({static_cast<py::ssize_t>(hu.size.z()), static_cast<py::ssize_t>(hu.size.y()),
                                       static_cast<py::ssize_t>(hu.size.x())},
                                      hu.voxels.data(), self));
}

}  // namespace

void bind_study(py::module_& module) {
  using Paths = std::vector<std::filesystem::path>;
  py::class_<CtSeries, std::shared_ptr<CtSeries>>(module, "CtSeries", "The planning CT.")
      .def_property_readonly("hu", &voxels_of, "Hounsfield units, float32, shape (slices, rows, columns).")
      .def_property_readonly(
          "patient_from_voxel", [](const CtSeries& ct) { return Eigen::Matrix4d(ct.hu.patient_from_voxel.matrix()); },
          "Takes (column, row, slice) to DICOM patient coordinates (LPS), mm; shape (4, 4).")
      .def_readonly("series_instance_uid", &CtSeries::series_instance_uid)
      .def_readonly("frame_of_reference_uid", &CtSeries::frame_of_reference_uid);
  py::class_<XrayImage>(module, "XrayImage", "An X-ray with its camera.")
      .def_readonly("label", &XrayImage::label)
      .def_readonly("view", &XrayImage::view)
      .def_property_readonly(
          "values", [](const py::object& self) { return array_of(self.cast<const XrayImage&>().values, self); },
          "float32, shape (rows, columns): intensities, or line integrals where is_line_integral is true.")
      .def_property_readonly("is_line_integral",
                             [](const XrayImage& xray) { return xray.meaning == XrayImage::Meaning::kLineIntegral; });
  py::class_<LoadedStudy, std::shared_ptr<LoadedStudy>>(
      module, "Study", "CT, plan and X-rays of one setup, read and checked as the program does.")
      .def_property_readonly(
          "ct", [](const LoadedStudy& loaded) { return std::const_pointer_cast<CtSeries>(loaded.study.ct); })
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
            for (const XrayImage& xray : loaded.study.xrays) views.push_back(xray.view);
            return views;
          },
          "The cameras of the X-rays.")
      .def_property_readonly(
          "planned_room_from_patient",
          [](const LoadedStudy& loaded) { return matrix_of(loaded.study.planned_room_from_patient); },
          "The planned pose, shape (4, 4): takes DICOM patient coordinates (LPS) to the room (IEC 61217 fixed), mm.")
      .def_property_readonly("isocenter_patient_mm",
                             [](const LoadedStudy& loaded) { return loaded.study.isocenter_patient_mm; })
      .def_property_readonly("warnings", [](const LoadedStudy& loaded) { return loaded.notes.warnings; })
      .def_property_readonly("overrides", [](const LoadedStudy& loaded) { return loaded.notes.overrides; })
      .def_property_readonly("left_aside", [](const LoadedStudy& loaded) { return loaded.notes.left_aside; });
  module.def(
      "load_study",
      [](const std::filesystem::path& folder, const Paths& ct, const Paths& images, const std::filesystem::path& plan,
         const std::filesystem::path& structures, const std::string& session, const std::string& date,
         std::optional<int> fraction, bool latest, const std::filesystem::path& machine,
         const std::vector<double>& isocenter, const std::string& patient_position, const std::string& intensity,
         const std::map<std::string, double>& gantry_angles_deg, std::optional<double> couch_angle_deg,
         std::optional<double> couch_pitch_deg, std::optional<double> couch_roll_deg, std::optional<double> sad_mm,
         std::optional<double> sid_mm, const std::vector<double>& rt_image_position, bool assume_centered,
         const std::map<std::string, std::string>& allow) {
        StudyOptions options;
        options.parts = {.study = folder,
                         .session = {.name = session, .date = date, .fraction = fraction, .is_latest = latest},
                         .ct = ct,
                         .images = images,
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
        return load_study_for_python(options);
      },
      py::arg("folder") = "", py::kw_only(), py::arg("ct") = Paths(), py::arg("images") = Paths(), py::arg("plan") = "",
      py::arg("structures") = "", py::arg("session") = "", py::arg("date") = "", py::arg("fraction") = py::none(),
      py::arg("latest") = false, py::arg("machine") = "", py::arg("isocenter") = std::vector<double>(),
      py::arg("patient_position") = "", py::arg("intensity") = "",
      py::arg("gantry_angles_deg") = std::map<std::string, double>(), py::arg("couch_angle_deg") = py::none(),
      py::arg("couch_pitch_deg") = py::none(), py::arg("couch_roll_deg") = py::none(), py::arg("sad_mm") = py::none(),
      py::arg("sid_mm") = py::none(), py::arg("rt_image_position") = std::vector<double>(),
      py::arg("assume_centered") = false, py::arg("allow") = std::map<std::string, std::string>(),
      "Read an exported study. What files lack is never guessed: the arguments supply it, as the flags of isoshift "
      "register. allow: what a failed check forbids, by its key, with the reason. Raises Error naming file, attribute "
      "and what was found.");
}

}  // namespace isoshift::python
