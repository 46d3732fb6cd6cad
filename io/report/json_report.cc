#include <nlohmann/json.hpp>

#include "geometry/rotation.h"
#include "io/report/setup_report.h"
#include "io/version.h"

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

Json setup_error_json(const SetupReport& report, const ShownShift& shown) {
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row) rows.push_back(array_of(Eigen::RowVector3d(report.setup_error.linear().row(row))));
  Json translation = Json::array();
  for (const auto& component : shown.setup_error_mm) translation.push_back(or_null(component));
  return {{"frame", "IEC 61217 fixed"},
          {"about", "isocenter"},
          {"translation_mm", translation},
          {"rotation_matrix", rows},
          {"rotation_deg",
           {{"order", "Rz*Rx*Ry"},
            {"rx", shown.setup_error_deg[0]},
            {"ry", shown.setup_error_deg[1]},
            {"rz", shown.setup_error_deg[2]}}}};
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

Json sigma_json(const std::optional<SetupReport::Sigma>& sigma,
                const std::array<std::optional<double>, 3>& components) {
  if (!sigma) return nullptr;
  Json array = Json::array();
  for (const auto& component : components) array.push_back(or_null(component));
  return array;
}

Json stage_json(const SetupReport::Stage& stage) {
  Json json = {{"name", stage.name},
               {"similarity", stage.similarity},
               {"evaluations", stage.evaluations},
               {"seconds", stage.seconds},
               {"termination", stage.termination},
               {"value", stage.value},
               {"optimizer", stage.optimizer},
               {"spread_mm", or_null(stage.spread_mm)},
               {"spread_deg", or_null(stage.spread_deg)}};
  for (const auto& [name, value] : stage.parameters) json["parameters"][name] = value;
  return json;
}

Json parts_json(const SetupReport::View& view) {
  Json list = Json::array();
  for (const SetupReport::Part& part : view.parts)
    list.push_back({{"center_px", array_of(part.center_px)},
                    {"width_px", part.width_px},
                    {"displacement_mm", array_of(part.displacement_mm)},
                    {"correlation", part.correlation},
                    {"best_correlation", part.best_correlation},
                    {"has_signal", part.has_signal},
                    {"disagrees", part.disagrees}});
  return list;
}

Json alternatives_json(const SetupReport& report) {
  Json list = Json::array();
  for (const SetupReport::Alternative& alternative : report.alternatives)
    list.push_back({{"description", alternative.description},
                    {"similarity", alternative.similarity},
                    {"as_is", alternative.as_is}});
  return list;
}

Json unobservable_json(const SetupReport& report) {
  Json directions = Json::array();
  for (const Eigen::Vector3d& direction : report.unobservable_room) directions.push_back(array_of(direction));
  return directions;
}

}  // namespace

std::string json_report(const SetupReport& report) {
  const ShownShift shown = shown_shift(report);
  Json json = {{"schema", 1},
               {"program", {{"name", "isoshift"}, {"version", kVersion}, {"commit", kCommit}}},
               {"verdict", to_string(report.verdict)},
               {"reasons", report.reasons},
               {"action", "unset"},
               {"patient_position", report.patient_position},
               {"isocenter_patient_mm", array_of(report.isocenter_patient_mm)},
               {"setup_error", setup_error_json(report, shown)},
               {"couch_shift", couch_shift_json(shown)},
               {"couch_target_deg", couch_target_json(shown)},
               {"uncertainty",
                {{"translation_mm", sigma_json(report.sigma, shown.sigma_mm)},
                 {"rotation_deg", sigma_json(report.sigma, shown.sigma_deg)},
                 {"unobservable", unobservable_json(report)}}},
               {"views", Json::array()},
               {"stages", Json::array()},
               {"preset", report.preset},
               {"dof", report.translation_only ? "translation" : "rigid"},
               {"seed", report.seed},
               {"attenuation", report.attenuation},
               {"threshold_hu", report.threshold_hu},
               {"renderer", report.renderer},
               {"device", report.device}};
  json["renderer_settings"] = Json::object();
  for (const auto& [name, value] : report.renderer_settings) json["renderer_settings"][name] = value;
  json["window_hu"] = report.window_hu ? array_of(*report.window_hu) : Json(nullptr);
  int evaluations = 0;
  Json images = Json::array();
  for (const SetupReport::View& view : report.views) {
    json["views"].push_back({{"label", view.label},
                             {"sop_instance_uid", view.sop_instance_uid},
                             {"frame", view.frame},
                             {"gantry_deg", or_null(view.gantry_deg)},
                             {"similarity_start", view.similarity_start},
                             {"similarity_final", view.similarity_final},
                             {"left_out_mm", or_null(view.left_out_mm)},
                             {"left_out_deg", or_null(view.left_out_deg)},
                             {"parts", parts_json(view)}});
    images.push_back(view.sop_instance_uid);
  }
  for (const SetupReport::Stage& stage : report.stages) {
    json["stages"].push_back(stage_json(stage));
    evaluations += stage.evaluations;
  }
  json["evaluations"] = evaluations;
  json["alternatives"] = alternatives_json(report);
  json["seconds"] = {{"load", report.seconds_load},
                     {"register", report.seconds_register},
                     {"rendering", report.seconds_rendering},
                     {"similarity", report.seconds_similarity},
                     {"total", report.seconds_total}};
  json["references"] = {{"ct_series", report.ct_series_uid},
                        {"plan", or_null(report.plan_uid)},
                        {"images", images},
                        {"spatial_registration", or_null(report.spatial_registration_uid)}};
  json["machine"] =
      report.machine ? Json{{"name", report.machine->name}, {"sha256", report.machine->sha256}} : Json(nullptr);
  json["region"] = report.region;
  json["overrides"] = report.overrides;
  json["warnings"] = report.warnings;
  json["left_aside"] = report.left_aside;
  // Text from files may hold bytes that are no UTF-8; they are replaced, never a reason to lose a result.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace isoshift
