#include <fmt/format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "base/json_file.h"
#include "geometry/rotation.h"
#include "io/report/formats.h"
#include "io/report/polygons_json.h"
#include "io/report/result_json.h"
#include "setup/shown_shift.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

Json or_null(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json or_null(const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); }

template <class Vector>
Json array_of(const Vector& values) {
  Json array = Json::array();
  for (const auto& value : values) array.push_back(value);
  return array;
}

Json rotation_json(const Eigen::Isometry3d& motion) {
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row) rows.push_back(array_of(Eigen::RowVector3d(motion.linear().row(row))));
  return rows;
}

Json setup_error_json(const SetupResult& report, const ShownShift& shown) {
  Json translation = Json::array();
  for (const auto& component : shown.setup_error_mm) translation.push_back(or_null(component));
  return {{"frame", "IEC 61217 fixed"},
          {"about", "isocenter"},
          {"translation_mm", translation},
          {"known_translation_mm", array_of(Eigen::Vector3d(known_setup_error(report).translation()))},
          {"rotation_matrix", rotation_json(report.setup_error)},
          {"rotation_deg",
           {{"order", "Rz*Rx*Ry"},
            {"rx", shown.setup_error_deg[0]},
            {"ry", shown.setup_error_deg[1]},
            {"rz", shown.setup_error_deg[2]}}}};
}

Json start_json(const SetupResult& report) {
  if (!report.start) return nullptr;
  const Start& start = *report.start;
  return {{"setup_error",
           {{"translation_mm", array_of(Eigen::Vector3d(start.setup_error.translation()))},
            {"rotation_matrix", rotation_json(start.setup_error)}}},
          {"file", start.file},
          {"sha256", start.sha256},
          {"set_by", or_null(start.set_by)}};
}

Json couch_shift_json(const ShownShift& shown) {
  if (shown.withheld) return nullptr;
  return {{"frame", "IEC 61217 table top at imaging"}, {"order", "translate, then rotate about the isocenter"},
          {"lateral_mm", or_null(shown.couch_mm[0])},  {"longitudinal_mm", or_null(shown.couch_mm[1])},
          {"vertical_mm", or_null(shown.couch_mm[2])}, {"yaw_deg", shown.couch_deg[0]},
          {"pitch_deg", shown.couch_deg[1]},           {"roll_deg", shown.couch_deg[2]}};
}

Json couch_target_json(const ShownShift& shown) {
  if (shown.withheld) return nullptr;
  return {
      {"yaw", shown.couch_target_deg[0]}, {"pitch", shown.couch_target_deg[1]}, {"roll", shown.couch_target_deg[2]}};
}

// What a couch that cannot make all six motions can do of the shift.
Json couch_applied_json(const SetupResult& report, const ShownShift& shown) {
  if (shown.withheld || !report.site || report.site->couch_dof == CouchDof::kSix) return nullptr;
  const auto turn = [&](std::size_t n) { return shown.can_rotate[n] ? shown.couch_deg[n] : 0.0; };
  return {{"brings_right", report.target ? report.target->name : "isocenter"},
          {"lateral_mm", or_null(shown.applied_mm[0])},
          {"longitudinal_mm", or_null(shown.applied_mm[1])},
          {"vertical_mm", or_null(shown.applied_mm[2])},
          {"yaw_deg", turn(0)},
          {"pitch_deg", turn(1)},
          {"roll_deg", turn(2)}};
}

Json sigma_json(bool is_known, const std::array<std::optional<double>, 3>& components) {
  if (!is_known) return nullptr;
  Json array = Json::array();
  for (const auto& component : components) array.push_back(or_null(component));
  return array;
}

template <class Matrix>
Json rows_of(const Matrix& matrix) {
  Json rows = Json::array();
  for (const auto& row : matrix.rowwise()) rows.push_back(std::vector<double>(row.begin(), row.end()));
  return rows;
}

Json by_imagers_json(const std::optional<Uncertainty>& by_imagers) {
  return by_imagers ? Json{{"covariance", rows_of(by_imagers->covariance)}} : Json(nullptr);
}

Json stage_json(const StageReport& stage) {
  Json json = {{"name", stage.name},
               {"similarity", stage.similarity},
               {"evaluations", stage.evaluations},
               {"seconds", stage.seconds},
               {"termination", stage.termination},
               {"value", stage.value},
               {"optimizer", stage.optimizer},
               {"spread_mm", or_null(stage.spread_mm)},
               {"spread_deg", stage.spread_rad ? Json(deg_from_rad(*stage.spread_rad)) : Json(nullptr)},
               {"best", stage.best}};
  for (const auto& [name, value] : stage.parameters) {
    const bool is_angle = name.ends_with(kRad);
    json["parameters"][is_angle ? name.substr(0, name.size() - kRad.size()).append(kDeg) : name] =
        is_angle ? deg_from_rad(value) : value;
  }
  return json;
}

Json picture_json(const ViewPicture& picture) {
  Json structures = Json::array();
  for (const ViewPicture::Outline& outline : picture.structures)
    structures.push_back(
        {{"name", outline.name}, {"planned", polygons_json(outline.planned)}, {"found", polygons_json(outline.found)}});
  return {{"isocenter_px", array_of(picture.isocenter_px)},
          {"pixels_per_mm", picture.pixels_per_mm},
          {"directions", picture.directions},
          {"field", polygons_json(picture.field)},
          {"structures", structures},
          {"moved", polygons_json(picture.moved)}};
}

Json site_json(const std::optional<SiteRules>& site) {
  if (!site) return nullptr;
  Json json = {{"name", site->name},
               {"sha256", site->sha256},
               {"anatomy", site->anatomy},
               {"target", or_null(site->target)},
               {"surrogate", or_null(site->surrogate)},
               {"action_level", nullptr},
               {"couch_degrees_of_freedom", static_cast<int>(site->couch_dof)},
               {"couch_scale", nullptr},
               {"length_unit", site->length_unit == LengthUnit::kCm ? "cm" : "mm"},
               {"automatic_release", nullptr}};
  if (site->automatic_release)
    json["automatic_release"] = {{"by", site->automatic_release->by}, {"on", site->automatic_release->on}};
  if (site->level)
    json["action_level"] = {{"translation_mm", or_null(site->level->translation_mm)},
                            {"vector_mm", or_null(site->level->vector_mm)},
                            {"rotation_deg", or_null(site->level->rotation_deg)}};
  if (site->couch_scale)
    json["couch_scale"] = {{"name", to_string(site->couch_scale->scale)},
                           {"validated_by", site->couch_scale->validated_by},
                           {"validated_on", site->couch_scale->validated_on}};
  return json;
}

Json target_json(const SetupResult& report, const ShownShift& shown) {
  if (!report.target) return nullptr;
  const Target& target = *report.target;
  Json extent = Json::array(), displacement = Json::array();
  for (const Eigen::Vector3d& point : target.extent_room_mm) extent.push_back(array_of(point));
  for (const auto& component : shown.target_mm) displacement.push_back(or_null(component));
  const auto of_bodies = [&](double value) { return report.bodies.empty() ? Json(nullptr) : Json(value); };
  return {{"name", target.name},
          {"chosen_by", target.chosen_by},
          {"surrogate", target.surrogate},
          {"center_room_mm", array_of(target.center_room_mm)},
          {"extent_room_mm", extent},
          {"displacement_mm", displacement},
          {"sigma_mm", sigma_json(report.uncertainty.has_value(), shown.target_sigma_mm)},
          {"image_share", of_bodies(report.target_image_share)},
          {"match_within_40_mm", of_bodies(report.target_match.of_most_within_40_mm)},
          {"match_within_20_mm", of_bodies(report.target_match.of_most_within_20_mm)},
          {"match", of_bodies(report.target_match.of_all)},
          {"match_of_parts", of_bodies(report.target_match.of_parts)},
          {"deformation_mm", of_bodies(report.target_deformation_mm)}};
}

Json structures_json(const SetupResult& report) {
  Json list = Json::array();
  for (const StructureMotion& structure : report.structures)
    list.push_back({{"name", structure.name},
                    {"displacement_mm", array_of(structure.displacement_mm)},
                    {"most_mm", structure.most_mm},
                    {"is_determined", structure.is_determined}});
  return list;
}

Json bodies_json(const SetupResult& report) {
  Json list = Json::array();
  for (const BodyMotion& body : report.bodies)
    list.push_back({{"name", body.name},
                    {"vertebra", body.vertebra ? Json(*body.vertebra) : Json(nullptr)},
                    {"center_room_mm", array_of(body.center_room_mm)},
                    {"displacement_mm", array_of(body.displacement_mm)},
                    {"rotation_deg", array_of(Eigen::Vector3d(body.rotation_rad.unaryExpr(&deg_from_rad)))},
                    {"sigma_mm", array_of(body.sigma_mm)},
                    {"carries_target", body.carries_target},
                    {"image_share", body.image_share},
                    {"breathes", body.breathes},
                    {"is_determined", body.is_determined()}});
  return list;
}

Json points_json(const SetupResult& report) {
  Json list = Json::array();
  for (const SetupResult::Point& point : report.points)
    list.push_back({{"name", point.name}, {"room_mm", array_of(point.room_mm)}});
  return list;
}

Json left_over_json(const ShownShift& shown) {
  Json list = Json::array();
  for (const ShownShift::LeftOver& left : shown.left_over) list.push_back({{"at", left.at}, {"mm", array_of(left.mm)}});
  return list;
}

Json parts_json(const SetupResult::View& view) {
  Json list = Json::array();
  for (const ViewPart& part : view.match.consistency.parts)
    list.push_back({{"center_px", array_of(part.center_px)},
                    {"width_px", part.width_px},
                    {"displacement_mm", array_of(part.displacement_mm)},
                    {"correlation", part.correlation},
                    {"best_correlation", part.best_correlation},
                    {"has_signal", part.has_signal},
                    {"disagrees", part.disagrees}});
  return list;
}

Json findings_json(const SetupResult& report) {
  Json list = Json::array();
  for (const Finding& finding : report.findings) {
    Json measures = Json::array();
    for (const Measure& measure : finding.measures)
      measures.push_back({{"value", measure.value}, {"limit", measure.limit}, {"unit", measure.unit}});
    list.push_back({{"check", to_string(finding.check)},
                    {"consequence", to_string(finding.consequence)},
                    {"view", or_null(finding.view)},
                    {"subject", or_null(finding.subject)},
                    {"measures", measures},
                    {"words", or_null(finding.words)}});
  }
  return list;
}

Json alternatives_json(const SetupResult& report) {
  Json list = Json::array();
  for (const Alternative& alternative : report.alternatives)
    list.push_back({{"description", alternative.description},
                    {"similarity", alternative.similarity},
                    {"as_is", alternative.as_is},
                    {"ruled_out", alternative.is_ruled_out}});
  return list;
}

Json unobservable_json(const SetupResult& report) {
  Json directions = Json::array();
  for (const Eigen::Vector3d& direction : report.unobservable_room) directions.push_back(array_of(direction));
  return directions;
}

Json irradiated_field_json(const IrradiatedField& field) {
  return {{"origin", to_string(field.origin)},
          {"corners_px", polygons_json({field.corners_px}).front()},
          {"sigma_mm", field.sigma_mm},
          {"keep_off_mm", field.keep_off_mm},
          {"doubt", or_null(field.doubt)}};
}

Json wanted_json(const std::optional<WantedMotion>& wanted) {
  if (!wanted) return nullptr;
  return {{"translation_mm", array_of(Eigen::Vector3d(wanted->motion.head<3>()))},
          {"rotation_deg", array_of(Eigen::Vector3d(wanted->motion.tail<3>().unaryExpr(&deg_from_rad)))},
          {"covariance", rows_of(wanted->covariance)}};
}

Json view_json(const SetupResult::View& view) {
  const std::optional<LeftOutView>& left_out = view.match.left_out;
  const std::optional<Contradiction>& contradiction = view.match.contradiction;
  return {{"label", view.label},
          {"sop_instance_uid", view.sop_instance_uid},
          {"sop_class_uid", view.sop_class_uid},
          {"sha256", view.sha256},
          {"frame", view.frame},
          {"acquired", view.acquired},
          {"reported_values_origin", view.origin},
          {"beam", view.is_megavoltage ? "MV" : "kV"},
          {"gantry_deg", or_null(view.gantry_deg)},
          {"radiation_machine", view.machine},
          {"pixel_from_room", view.pixel_from_room ? rows_of(*view.pixel_from_room) : Json(nullptr)},
          {"sid_mm", or_null(view.sid_mm)},
          {"receptor_corrected", view.is_receptor_corrected},
          {"source_room_mm", array_of(view.source_room_mm)},
          {"pixel_mm", view.pixel_mm},
          {"columns", view.columns},
          {"rows", view.rows},
          {"similarity_start", view.match.similarity_start},
          {"similarity_final", view.match.similarity_final},
          {"left_out_mm", left_out ? Json(left_out->distance_mm) : Json(nullptr)},
          {"left_out_deg", left_out ? Json(deg_from_rad(left_out->angle_rad)) : Json(nullptr)},
          {"contradiction_mm", contradiction ? Json(contradiction->mm) : Json(nullptr)},
          {"contradiction_sigma_mm", contradiction ? Json(contradiction->sigma_mm) : Json(nullptr)},
          {"wanted", wanted_json(view.match.wanted)},
          {"irradiated_field", irradiated_field_json(view.match.field)},
          {"parts", parts_json(view)},
          {"picture", picture_json(view.picture)}};
}

Json references_json(const SetupResult& report) {
  Json images = Json::array();
  for (const SetupResult::View& view : report.views) images.push_back(view.sop_instance_uid);
  return {{"ct_series", report.ct_series_uid},
          {"ct_frame_of_reference", report.ct_frame_uid},
          {"structure_set", or_null(report.structure_set_uid)},
          {"ct_sha256", report.ct_sha256},
          {"plan", or_null(report.plan_uid)},
          {"plan_class", report.plan_class_uid},
          {"plan_label", report.plan_label},
          {"plan_approval", report.plan_approval},
          {"plan_sha256", report.plan_sha256},
          {"images", images},
          {"spatial_registration", or_null(report.spatial_registration_uid)}};
}

}  // namespace

// NOLINTNEXTLINE(readability-function-size): long because result.json is: one line per key, in the order of the file
std::string json_report(const SetupResult& report) {
  const ShownShift shown = shown_shift(report);
  Json json = {{"schema", 1},
               {"program", {{"name", "isoshift"}, {"version", report.version}, {"commit", report.commit}}},
               {"made_on", report.made_on},
               {"verdict", to_string(report.verdict())},
               {"reasons", report.reasons()},
               {"findings", findings_json(report)},
               {"action", to_string(shown.decision.action)},
               {"action_reasons", shown.decision.reasons},
               {"patient", Json::object()},
               {"patient_position", report.patient_position},
               {"isocenter_patient_mm", array_of(report.isocenter_patient_mm)},
               {"setup_error", setup_error_json(report, shown)},
               {"couch_shift", couch_shift_json(shown)},
               {"couch_target_deg", couch_target_json(shown)},
               {"couch_applied", couch_applied_json(report, shown)},
               {"target", target_json(report, shown)},
               {"bodies", bodies_json(report)},
               {"structures", structures_json(report)},
               {"uncertainty",
                {{"translation_mm", sigma_json(report.uncertainty.has_value(), shown.sigma_mm)},
                 {"rotation_deg", sigma_json(report.uncertainty.has_value(), shown.sigma_deg)},
                 {"covariance", report.uncertainty ? rows_of(report.uncertainty->covariance) : Json(nullptr)},
                 {"by_imagers", by_imagers_json(report.by_imagers)},
                 {"unobservable", unobservable_json(report)}}},
               {"views", Json::array()},
               {"stages", Json::array()},
               {"preset", report.preset},
               {"dof", report.translation_only ? "translation" : "rigid"},
               {"start", start_json(report)},
               {"searched", report.is_searched},
               {"seed", report.seed},
               {"attenuation", report.attenuation},
               {"threshold_hu", report.threshold_hu},
               {"renderer", report.renderer},
               {"device", report.device}};
  for (const auto& [name, member] : kIdentity) json["patient"][name] = report.identity.*member;
  json["table"] = {{"support_deg", deg_from_rad(report.table.support_rad)},
                   {"eccentric_deg", deg_from_rad(report.table.eccentric_rad)},
                   {"pitch_deg", deg_from_rad(report.table.pitch_rad)},
                   {"roll_deg", deg_from_rad(report.table.roll_rad)},
                   {"position_mm", report.table_position_mm ? array_of(*report.table_position_mm) : Json(nullptr)}};
  json["site"] = site_json(report.site);
  json["points"] = points_json(report);
  json["left_over"] = left_over_json(shown);
  json["renderer_settings"] = Json::object();
  for (const auto& [name, value] : report.renderer_settings) json["renderer_settings"][name] = value;
  json["window_hu"] = report.window_hu ? array_of(*report.window_hu) : Json(nullptr);
  for (const SetupResult::View& view : report.views) json["views"].push_back(view_json(view));
  for (const StageReport& stage : report.stages) json["stages"].push_back(stage_json(stage));
  json["evaluations"] = report.evaluations();
  json["alternatives"] = alternatives_json(report);
  json["seconds"] = {{"load", report.seconds_load},
                     {"register", report.seconds},
                     {"rendering", report.seconds_rendering},
                     {"similarity", report.seconds_similarity},
                     {"total", report.seconds_total}};
  json["references"] = references_json(report);
  json["machine"] =
      report.machine ? Json{{"name", report.machine->name}, {"sha256", report.machine->sha256}} : Json(nullptr);
  json["region"] = report.region;
  json["overrides"] = report.overrides;
  json["warnings"] = report.warnings;
  json["left_aside"] = report.left_aside;
  // Text from files may hold bytes that are no UTF-8; they are replaced, never a reason to lose a result.
  return json_text(json);
}

}  // namespace isoshift
