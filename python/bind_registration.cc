#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "base/error.h"
#include "base/stopwatch.h"
#include "drr/renderer.h"
#include "geometry/patient_setup.h"
#include "io/report/formats.h"
#include "io/report/report_page.h"
#include "python/bindings.h"
#include "registration/objective.h"
#include "registration/preprocess/preprocess.h"
#include "registration/similarity/histogram.h"
#include "registration/similarity/similarity.h"
#include "workflow/observer.h"
#include "workflow/register/register_study.h"
#include "workflow/register/setup_result_of.h"

namespace isoshift::python {
namespace {

SimilarityKind kind_from(const std::string& name) {
  const auto kind = similarity_kind_from(name);
  if (!kind) {
    std::string known;
    for (const SimilarityKind other : kSimilarityKinds) known += fmt::format(" {}", to_string(other));
    throw UsageError(fmt::format("there is no similarity {}; expected one of:{}", name, known));
  }
  return *kind;
}

std::unique_ptr<Objective> objective_of(Renderer& renderer, const std::vector<FixedImage>& images, const Poses& about,
                                        const std::string& similarity, double pixel_fraction, std::size_t min_pixels,
                                        std::uint64_t seed) {
  const ObjectiveOptions options{
      .similarity = kind_from(similarity), .pixel_fraction = pixel_fraction, .min_pixels = min_pixels, .seed = seed};
  const Eigen::Isometry3d pose = pose_from(about);
  const py::gil_scoped_release released;
  auto objective = std::make_unique<Objective>(renderer, images, pose, options);
  const RenderResult drrs = objective->render(std::span(&pose, 1));
  for (std::size_t view = 0; view < images.size(); ++view)
    require_not_empty(drrs.line_integrals(0, view), name_of_view(images[view].label, view));
  return objective;
}

// What work does on several poses, without Python's lock.
template <class Work>
auto unlocked(const Poses& room_from_patient, Work work) {
  const std::vector<Eigen::Isometry3d> poses = poses_from(room_from_patient);
  const py::gil_scoped_release released;
  return work(poses);
}

py::array_t<double> array_of(const std::vector<double>& values) {
  return py::array_t<double>(static_cast<py::ssize_t>(values.size()), values.data());
}

double similarity_of(const std::string& kind, const RealArray<float>& xray_given, const RealArray<float>& drr_given) {
  const auto &xray = xray_given.array, &drr = drr_given.array;
  const SimilarityKind known = kind_from(kind);
  if (known == SimilarityKind::kGradientCorrelation)
    throw UsageError("gradient-correlation compares neighbors: Objective computes it");
  const bool is_alike = xray.ndim() == drr.ndim() && std::equal(xray.shape(), xray.shape() + xray.ndim(), drr.shape());
  if (!is_alike) throw py::value_error("xray and drr have the same shape");
  const std::vector<float> fixed(xray.data(), xray.data() + xray.size());
  const std::span<const float> moving(drr.data(), static_cast<std::size_t>(drr.size()));
  if (moving.empty()) throw py::value_error("the lists hold no pixel");
  const auto is_number = [](float value) { return std::isfinite(value); };
  if (!std::ranges::all_of(fixed, is_number) || !std::ranges::all_of(moving, is_number))
    throw py::value_error("a pixel is not a finite number");
  return Comparison(known, fixed, {}, range_of(moving)).of(moving);
}

SetupResult register_for_python(const LoadedStudy& loaded, RegisterOptions options, std::optional<Start> start) {
  const Stopwatch watch;
  options.registration.settle();
  SharedWork none;
  Observer nobody;
  const py::gil_scoped_release released;
  const std::optional<SiteFile> site_file = named_site(options.site);
  if (site_file && max_span_s_of(site_file) != loaded.max_span_s)
    throw UsageError(
        fmt::format("the site file allows {} s between X-rays (max_span_s), and the study was checked for {} s: name "
                    "the site file in load_study(), too",
                    max_span_s_of(site_file), loaded.max_span_s));
  const std::optional<SiteRules> site = chosen_site(site_file, options.anatomy);
  SetupResult result = register_loaded(loaded.study, options, site, std::move(start), none, nobody);
  result.seconds_load = loaded.seconds;
  result.seconds_total = loaded.seconds + watch.seconds();
  result.warnings = loaded.notes.warnings;
  if (const auto failure = options.registration.rendering.failed_gpu())
    result.warnings.push_back(fmt::format("{}; rendered on the CPU instead", *failure));
  result.overrides = loaded.notes.overrides;
  result.left_aside = loaded.notes.left_aside;
  return result;
}

// An object with the numbers of one patient and the name of another must not be written.
void check_is_of(const SetupResult& result, const Study& study) {
  constexpr double kSamePose = 1e-6;
  const auto is_in_study = [&](const SetupResult::View& view) {
    return std::ranges::count(study.rt_images, view.sop_instance_uid, &RtImage::sop_instance_uid) > 0;
  };
  if (result.ct_series_uid != study.ct->series_instance_uid || !std::ranges::all_of(result.views, is_in_study))
    throw Error("the result is of another study: its CT and X-rays are not those of this study");
  const auto position = patient_position_from(result.patient_position);
  const bool is_same_plan = position && planned_room_from_patient(*position, result.table, result.isocenter_patient_mm)
                                            .isApprox(study.planned_room_from_patient, kSamePose);
  if (!is_same_plan)
    throw Error(
        "the result is about another planned pose: its isocenter, patient position or table angles are not those of "
        "this study");
}

py::object json_of(const SetupResult& result) { return py::module_::import("json").attr("loads")(json_report(result)); }

void bind_result(py::module_& module) {
  py::class_<SetupResult>(module, "SetupResult",
                          "What a registration found. as_dict() has everything, with the names of result.json "
                          "(docs/result.schema.json).")
      .def_property_readonly(
          "verdict", [](const SetupResult& result) { return std::string(to_string(result.verdict())); },
          "accepted, review or rejected.")
      .def_property_readonly(
          "reasons", [](const SetupResult& result) { return texts_of(result.reasons()); },
          "Why the verdict is not accepted.")
      .def_property_readonly(
          "setup_error", [](const SetupResult& result) { return matrix_of(result.setup_error); },
          "Where the patient lies against the plan, shape (4, 4): anatomy planned at p is found at R p + t; room (IEC "
          "61217 fixed), mm, about the isocenter.")
      .def_property_readonly(
          "actual_room_from_patient",
          [](const SetupResult& result) { return matrix_of(result.actual_room_from_patient); },
          "The pose found, shape (4, 4).")
      .def_property_readonly(
          "covariance",
          [](const SetupResult& result) -> std::optional<Eigen::Matrix<double, 6, 6>> {
            if (!result.uncertainty) return std::nullopt;
            return result.uncertainty->covariance;
          },
          "Of the motion between the setup error found and the true one, shape (6, 6): translation (mm), rotation "
          "vector (rad). None if the images do not determine the pose.")
      .def_property_readonly(
          "warnings", [](const SetupResult& result) { return texts_of(result.warnings); }, "What a person should know.")
      .def("as_dict", &json_of,
           "result.json as a dict. references.spatial_registration is None: write_spatial_registration() returns it.")
      .def("__str__", [](const SetupResult& result) { return text_of(text_report(report_page(result))); });
}

void bind_register(py::module_& module) {
  module.def(
      "register",
      [](const LoadedStudy& study, const std::string& preset, const std::string& dof, const std::string& target,
         const std::string& renderer, const std::optional<std::string>& gl, const std::filesystem::path& site,
         const std::string& anatomy, std::uint64_t seed, const std::optional<Poses>& start_setup_error, bool search) {
        RegisterOptions options;
        options.registration.search.preset = preset;
        options.registration.search.dof = dof;
        options.registration.search.seed = seed;
        options.registration.search.is_searched = search;
        options.registration.rendering.renderer = renderer;
        options.registration.rendering.gl = gl;
        options.target = target;
        options.site = site;
        options.anatomy = anatomy;
        std::optional<Start> start;
        if (start_setup_error) start = Start{.setup_error = pose_from(*start_setup_error), .set_by = "Python"};
        return register_for_python(study, std::move(options), std::move(start));
      },
      py::arg("study"), py::kw_only(), py::arg("preset") = "setup", py::arg("dof") = "rigid", py::arg("target") = "",
      py::arg("renderer") = "auto", py::arg("gl") = py::none(), py::arg("site") = "", py::arg("anatomy") = "",
      py::arg("seed") = 1, py::arg("start_setup_error") = py::none(), py::arg("search") = true,
      "Find the setup error of a study, as isoshift register does. preset: setup, fast or paper. dof: rigid or "
      "translation. target: a structure, or isocenter. renderer, gl: as of Renderer. site: a site file; anatomy: one "
      "of its anatomies. start_setup_error: where the search begins, shape (4, 4), as SetupResult.setup_error (the "
      "identity: as planned). search: false judges the start and searches none.");
  module.def(
      "write_spatial_registration",
      [](const LoadedStudy& loaded, const SetupResult& result, const std::filesystem::path& path, bool for_review,
         bool accept_unobservable) {
        check_is_of(result, loaded.study);
        RegisterOptions options;
        options.write_reg_for_review = for_review;
        options.accept_unobservable = accept_unobservable;
        Notes notes;
        std::string uid = write_registration(options, loaded.study, result, path, notes);
        if (uid.empty())
          throw Error(
              fmt::format("a result that is {}, or has directions that were not measured, is written only on "
                          "request: for_review, accept_unobservable; one that is rejected never is",
                          to_string(result.verdict())));
        return py::make_tuple(uid, notes.warnings);
      },
      py::arg("study"), py::arg("result"), py::arg("path"), py::kw_only(), py::arg("for_review") = false,
      py::arg("accept_unobservable") = false,
      "Write the DICOM Spatial Registration object of a result, as the program does. Returns its SOP Instance UID and "
      "warnings. Raises Error for a result that may not be written.");
}

void bind_fixed_image(py::module_& module) {
  py::class_<FixedImage>(module, "FixedImage", "An X-ray as it is compared with DRRs.")
      .def_readonly("view", &FixedImage::view, "Its camera.")
      .def_property_readonly(
          "label", [](const FixedImage& image) { return text_of(image.label); }, "That of the X-ray.")
      .def_property_readonly(
          "line_integral",
          [](const py::object& self) { return python::array_of(self.cast<const FixedImage&>().line_integral, self); },
          "float32, shape (rows, columns).")
      .def_property_readonly(
          "field", [](const py::object& self) { return python::array_of(self.cast<const FixedImage&>().field, self); },
          "uint8, shape (rows, columns): 1 where pixels are compared.")
      .def(
          "reduced",
          [](const FixedImage& image, int factor) {
            check_block(factor, image.view.columns, image.view.rows);
            return reduced(image, factor);
          },
          py::arg("factor"), "Blocks of factor x factor pixels, averaged.");
  module.def(
      "prepare", [](const XrayImage& xray) { return prepare(xray); }, py::arg("xray"),
      py::call_guard<py::gil_scoped_release>(),
      "The line integrals of an X-ray, made of its intensities, and the irradiated field that is found in it.");
}

void bind_objective(py::module_& module) {
  module.def("similarity", &similarity_of, py::arg("kind"), py::arg("xray"), py::arg("drr"),
             "How alike the pixels of two arrays of one shape are, more is better: ncc or src (at most 1), mi (natural "
             "logarithms) or nmi (1 to 2). Histograms have the range of drr.");
  py::class_<Objective>(module, "Objective",
                        "How well DRRs at some poses match X-rays. Poses of shape (4, 4) or (P, 4, 4).")
      .def(py::init(&objective_of), py::arg("renderer"), py::arg("images"), py::arg("about"), py::kw_only(),
           py::arg("similarity") = "src", py::arg("pixel_fraction") = 1.0, py::arg("min_pixels") = 1000,
           py::arg("seed") = 1, py::keep_alive<1, 2>(),
           "images: what prepare() made. similarity: src, ncc, mi, nmi or gradient-correlation; more is better. "
           "about: a pose within some centimeters of those to come: gradients are compared where its DRRs have "
           "strong ones, and histograms (src, mi, nmi) have the range of its DRRs. pixel_fraction: the share of the "
           "field's pixels that is compared, and min_pixels the least number of them in every view; seed draws them.")
      .def(
          "values",
          [](Objective& self, const Poses& poses) {
            return array_of(unlocked(poses, [&](const auto& all) { return self.values(all); }));
          },
          py::arg("room_from_patient"), "The mean similarity of the views, shape (P,).")
      .def(
          "per_view",
          [](Objective& self, const Poses& poses) {
            return unlocked(poses, [&](const auto& all) { return self.per_view(all); });
          },
          py::arg("room_from_patient"), "The similarity of each view, P lists of V.")
      .def(
          "models",
          [](Objective& self, const Poses& poses) {
            py::list models;
            for (const QuadraticModel& model : unlocked(poses, [&](const auto& all) { return self.models(all); }))
              models.append(py::make_tuple(model.value, model.gradient, model.curvature));
            return models;
          },
          py::arg("room_from_patient"),
          "Per pose the value, its gradient, shape (6,), and its curvature, shape (6, 6): by the patient's translation "
          "(mm) and rotation (rad) in the room, about the isocenter. mi and nmi have no curvature, shape (0, 0). The "
          "gradient of src is that of the ranks as they stand.");
}

}  // namespace

void bind_registration(py::module_& module) {
  bind_fixed_image(module);
  bind_objective(module);
  bind_result(module);
  bind_register(module);
}

}  // namespace isoshift::python
