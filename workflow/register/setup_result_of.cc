#include "workflow/register/setup_result_of.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/local_time.h"
#include "base/version.h"
#include "geometry/mask.h"
#include "geometry/rotation.h"
#include "io/dicom/structure_mask.h"
#include "registration/preprocess/preprocess.h"
#include "workflow/register/view_pictures.h"

namespace isoshift {
namespace {

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
        !structure.contours.empty())
      add(structure);
  return marked;
}

// The centers of what is drawn; the target has its own.
std::vector<SetupResult::Point> centroids_of(const std::vector<MarkedStructure>& structures, const Study& study,
                                             const Target& target) {
  std::vector<SetupResult::Point> points;
  for (const MarkedStructure& structure : structures)
    if (structure.name != target.name)
      points.push_back({.name = "centroid of " + structure.name,
                        .room_mm = study.planned_room_from_patient * centroid_patient_mm(structure.mask)});
  return points;
}

SetupResult::View view_of(const RtImage& image, const XrayView& view, ViewMatch match, ViewPicture picture) {
  return {.label = image.label,
          .sop_class_uid = image.sop_class_uid,
          .sop_instance_uid = image.sop_instance_uid,
          .sha256 = image.sha256,
          .frame = image.frame + 1,
          .acquired = acquired(image),
          .origin = image.reported_values_origin.value_or(""),
          .gantry_deg = image.pixel_from_room ? std::nullopt : image.gantry_angle_deg,
          .machine = radiation_machine(image),
          .pixel_from_room = view.pixel_from_room,
          .sid_mm = image.sid_mm,
          .source_room_mm = view.source_room_mm,
          .pixel_mm = 1.0 / pixels_per_mm(view),
          .columns = view.columns,
          .rows = view.rows,
          .is_megavoltage = view.beam == Beam::kMegavoltage,
          .is_receptor_corrected = image.imager && image.imager->is_corrected,
          .match = std::move(match),
          .picture = std::move(picture)};
}

}  // namespace

std::string radiation_machine(const RtImage& image) {
  const auto name = image.equipment.find("RadiationMachineName");
  return name == image.equipment.end() ? "" : name->second;
}

std::optional<SiteFile> named_site(const std::filesystem::path& file) {
  return file.empty() ? std::nullopt : std::optional(read_site_file(file));
}

double max_span_s_of(const std::optional<SiteFile>& site) {
  return site && site->sessions ? site->sessions->max_span_s : kDefaultUntoldSpanS;
}

std::optional<SiteRules> chosen_site(const std::optional<SiteFile>& file, const std::string& anatomy,
                                     std::optional<SiteRules> before) {
  if (!file && !anatomy.empty())
    throw UsageError("--anatomy chooses an action level of a site file: name the file with --site FILE");
  if (!file) return before;
  const SiteFile& site = *file;
  const std::string& whose = anatomy.empty() && before ? before->anatomy : anatomy;
  return SiteRules{.name = site.name,
                   .sha256 = site.sha256,
                   .anatomy = whose,
                   .target = target_named(site, whose),
                   .surrogate = surrogate_named(site, whose),
                   .level = action_level(site, whose),
                   .couch_dof = site.couch_dof,
                   .couch_scale = site.couch_scale,
                   .length_unit = site.length_unit,
                   .automatic_release = site.automatic_release};
}

SetupResult setup_result_of(const Study& study, std::span<const FixedImage> images, const RegistrationRequest& request,
                            const RegistrationSetup& setup, Target target, RegistrationResult found) {
  Renderer& renderer = setup.renderers().finest();
  const RegistrationOptions& registration = setup.options();
  const std::vector<MarkedStructure> structures = marked_structures(study, request.region);
  std::vector<ViewPicture> pictures = view_pictures(study, restricted_to(registration.rectangles, images), renderer,
                                                    structures, found.actual_room_from_patient, found.bodies);
  std::vector<ViewMatch> matches = std::move(found.views);
  SetupResult result;
  static_cast<Registration&>(result) = std::move(found);
  result.made_on = local_time();
  result.version = kVersion;
  result.commit = kCommit;
  result.points = centroids_of(structures, study, target);
  result.target = std::move(target);
  result.identity = study.ct->identity;
  result.patient_position = to_string(study.patient_position);
  result.isocenter_patient_mm = study.isocenter_patient_mm;
  result.table = study.table;
  result.table_position_mm = table_position(study);
  result.setup_error = setup_error_from_poses(study.planned_room_from_patient, result.actual_room_from_patient);
  result.translation_only = registration.dof == Dof::kTranslation;
  result.is_searched = registration.is_searched;
  for (std::size_t n = 0; n < study.rt_images.size(); ++n)
    result.views.push_back(
        view_of(study.rt_images[n], study.xrays[n].view, std::move(matches[n]), std::move(pictures[n])));
  result.preset = registration.preset;
  result.region = request.region.in_words();
  result.seed = registration.seed;
  result.attenuation = request.rendering.attenuation_name();
  const AttenuationModel model = request.rendering.model();
  result.threshold_hu = model.threshold_hu;
  if (model.kind == AttenuationModel::Kind::kWindowed) result.window_hu = {model.window_low_hu, model.window_high_hu};
  result.renderer_settings = request.rendering.settings();
  if (!result.compared_with_cpu.empty())
    result.renderer_settings.emplace_back("compared_with_cpu", result.compared_with_cpu);
  if (study.machine) result.machine = {study.machine->name, study.machine->sha256};
  result.ct_series_uid = study.ct->series_instance_uid;
  result.ct_sha256 = study.ct->sha256;
  result.ct_frame_uid = study.ct->frame_of_reference_uid;
  result.structure_set_uid = study.structures ? study.structures->sop_instance_uid : "";
  if (study.plan) {
    result.plan_label = study.plan->label;
    result.plan_approval = study.plan->approval_status;
    result.plan_uid = study.plan->sop_instance_uid;
    result.plan_class_uid = study.plan->sop_class_uid;
    result.plan_sha256 = study.plan->sha256;
  }
  return result;
}

}  // namespace isoshift
