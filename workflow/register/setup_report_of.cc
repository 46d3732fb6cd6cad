#include "workflow/register/setup_report_of.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/local_time.h"
#include "base/sha256.h"
#include "base/version.h"
#include "geometry/mask.h"
#include "geometry/rotation.h"
#include "io/dicom/structure_mask.h"
#include "registration/preprocess/preprocess.h"
#include "workflow/register/view_pictures.h"

namespace isoshift {
namespace {

std::vector<SetupReport::Part> parts_in_report(const ViewConsistency& consistency) {
  std::vector<SetupReport::Part> parts;
  for (const Tile& tile : consistency.tiles)
    parts.push_back({.center_px = tile.center_px,
                     .width_px = tile.width_px,
                     .displacement_mm = tile.displacement_mm,
                     .correlation = tile.correlation,
                     .best_correlation = tile.best_correlation,
                     .has_signal = tile.has_signal,
                     .disagrees = tile.disagrees});
  return parts;
}

SetupReport::Stage stage_in_report(const Stage& stage, const StageReport& done) {
  SetupReport::Stage shown{.name = done.name,
                           .similarity = done.similarity,
                           .optimizer = std::string(to_string(stage.optimizer)),
                           .parameters = {{"pixel_mm", stage.pixel_mm},
                                          {"voxel_mm", stage.voxel_mm},
                                          {"pixel_fraction", stage.pixel_fraction},
                                          {"min_pixels", stage.min_pixels},
                                          {"candidates", stage.candidates},
                                          {"starts", stage.starts},
                                          {"keep", stage.keep},
                                          {"reach_mm", stage.reach_mm},
                                          {"reach_deg", deg_from_rad(stage.reach_rad)},
                                          {"initial_step_mm", stage.initial_step_mm},
                                          {"initial_step_deg", deg_from_rad(stage.initial_step_rad)},
                                          {"relative_tolerance", stage.relative_tolerance},
                                          {"max_evaluations", stage.max_evaluations}},
                           .evaluations = done.evaluations,
                           .seconds = done.seconds,
                           .value = done.value,
                           .termination = done.termination,
                           .spread_mm = done.spread_mm,
                           .best = done.best};
  if (done.spread_rad) shown.spread_deg = deg_from_rad(*done.spread_rad);
  return shown;
}

std::optional<Eigen::Vector3d> table_position(const Study& study) {
  for (const RtImage& image : study.rt_images)
    if (const TableReadOuts& table = image.table; table.has_position())
      return Eigen::Vector3d(*table.lateral_mm, *table.longitudinal_mm, *table.vertical_mm);
  return std::nullopt;
}

// What is drawn in the pictures: the structures that were registered, else the targets of the plan.
std::vector<MarkedStructure> marked_structures(const Study& study, const RegionOptions& region) {
  std::vector<MarkedStructure> marked;
  if (!study.structures) return marked;
  const auto add = [&](const Structure& structure) {
    marked.push_back({structure.name, mask_of(structure, study.ct->hu.size, study.ct->hu.patient_from_voxel)});
  };
  for (const std::string& name : region.structures) add(structure_named(*study.structures, name));
  if (!marked.empty()) return marked;
  for (const Structure& structure : study.structures->structures)
    if ((structure.interpreted_type == "PTV" || structure.interpreted_type == "CTV" ||
         structure.interpreted_type == "GTV") &&
        !structure.contours.empty() &&
        structure.frame_of_reference_uid.value_or(study.ct->frame_of_reference_uid) == study.ct->frame_of_reference_uid)
      add(structure);
  return marked;
}

SetupReport::Point centroid_of(const MarkedStructure& structure, const Study& study) {
  return {.name = "centroid of " + structure.name,
          .room_mm = study.planned_room_from_patient * centroid_patient_mm(structure.mask)};
}

}  // namespace

std::optional<SiteFile> named_site(const std::filesystem::path& file) {
  return file.empty() ? std::nullopt : std::optional(read_site_file(file));
}

std::optional<SetupReport::Site> chosen_site(const std::optional<SiteFile>& file, const std::string& anatomy,
                                             std::optional<SetupReport::Site> before) {
  if (!file && !anatomy.empty()) throw UsageError("--anatomy chooses an action level of a site file: --site FILE");
  if (!file) return before;
  const SiteFile& site = *file;
  const std::string& whose = anatomy.empty() && before ? before->anatomy : anatomy;
  return SetupReport::Site{.name = site.name,
                           .sha256 = site.sha256,
                           .anatomy = whose,
                           .level = action_level(site, whose),
                           .couch_dof = site.couch_dof,
                           .couch_scale = site.couch_scale,
                           .length_unit = site.length_unit,
                           .automatic_release = site.automatic_release};
}

SetupReport setup_report_of(const Study& study, const RegistrationRequest& request, const RegistrationSetup& setup,
                            const RegistrationResult& result) {
  Renderer& renderer = setup.renderers().finest();
  const RegistrationOptions& registration = setup.options();
  const std::vector<MarkedStructure> structures = marked_structures(study, request.region);
  std::vector<ViewPicture> pictures = view_pictures(study, renderer, structures, result.actual_room_from_patient);
  SetupReport report;
  report.made_on = local_time();
  report.version = kVersion;
  report.commit = kCommit;
  for (const MarkedStructure& structure : structures) report.points.push_back(centroid_of(structure, study));
  report.verdict = result.verdict;
  report.reasons = result.reasons;
  report.identity = study.ct->identity;
  report.patient_position = to_string(study.patient_position);
  report.isocenter_patient_mm = study.isocenter_patient_mm;
  report.table = study.table;
  report.table_position_mm = table_position(study);
  report.setup_error = setup_error_from_poses(study.planned_room_from_patient, result.actual_room_from_patient);
  report.unobservable_room = result.unobservable_room;
  report.translation_only = registration.dof == Dof::kTranslation;
  for (std::size_t n = 0; n < study.rt_images.size(); ++n) {
    const XrayView& view = study.xrays[n].view;
    const std::optional<LeftOutView>& left_out = result.views[n].left_out;
    report.views.push_back(
        {.label = study.rt_images[n].label,
         .sop_class_uid = study.rt_images[n].sop_class_uid,
         .sop_instance_uid = study.rt_images[n].sop_instance_uid,
         .sha256 = sha256_of_file(study.rt_images[n].path),
         .frame = study.rt_images[n].frame + 1,
         .acquired = acquired(study.rt_images[n]),
         .origin = study.rt_images[n].reported_values_origin.value_or(""),
         .gantry_deg = study.rt_images[n].pixel_from_room ? std::nullopt : study.rt_images[n].gantry_angle_deg,
         .source_room_mm = view.source_room_mm,
         .pixel_mm = 1.0 / pixels_per_mm(view),
         .columns = view.columns,
         .rows = view.rows,
         .is_megavoltage = view.beam == Beam::kMegavoltage,
         .similarity_start = result.views[n].similarity_start,
         .similarity_final = result.views[n].similarity_final,
         .left_out_mm = left_out ? std::optional(left_out->distance_mm) : std::nullopt,
         .left_out_deg = left_out ? std::optional(deg_from_rad(left_out->angle_rad)) : std::nullopt,
         .parts = parts_in_report(result.views[n].consistency),
         .picture = std::move(pictures[n])});
  }
  for (std::size_t n = 0; n < result.stages.size(); ++n)
    report.stages.push_back(stage_in_report(registration.stages[n], result.stages[n]));
  if (result.uncertainty)
    report.sigma = {.translation_mm = result.uncertainty->translation_mm,
                    .rotation_deg = result.uncertainty->rotation_rad.unaryExpr(&deg_from_rad)};
  for (const Alternative& alternative : result.alternatives)
    report.alternatives.push_back(
        {.description = alternative.description, .similarity = alternative.similarity, .as_is = alternative.as_is});
  report.preset = registration.preset;
  report.region = request.region.in_words();
  report.seed = registration.seed;
  report.attenuation = request.rendering.attenuation_name();
  const AttenuationModel model = request.rendering.model();
  report.threshold_hu = model.threshold_hu;
  if (model.kind == AttenuationModel::Kind::kWindowed) report.window_hu = {model.window_low_hu, model.window_high_hu};
  report.renderer = to_string(renderer.kind());
  report.device = renderer.device();
  report.renderer_settings = request.rendering.settings();
  report.seconds_register = result.seconds;
  report.seconds_rendering = result.seconds_rendering;
  report.seconds_similarity = result.seconds_similarity;
  if (study.machine) report.machine = {study.machine->name, study.machine->sha256};
  report.ct_series_uid = study.ct->series_instance_uid;
  report.ct_sha256 = study.ct->sha256;
  if (study.plan) {
    report.plan_label = study.plan->label;
    report.plan_approval = study.plan->approval_status;
    report.plan_uid = study.plan->sop_instance_uid;
    report.plan_class_uid = study.plan->sop_class_uid;
    report.plan_sha256 = sha256_of_file(study.plan->path);
  }
  return report;
}

}  // namespace isoshift
