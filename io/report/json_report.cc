#include <fmt/format.h>

#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "geometry/rotation.h"
#include "io/report/formats.h"
#include "io/report/polygons_json.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<std::pair<const char*, std::string Identity::*>, 12> kIdentity = {{
    {"character_set", &Identity::character_set},
    {"id", &Identity::patient_id},
    {"id_issuer", &Identity::patient_id_issuer},
    {"name", &Identity::patient_name},
    {"birth_date", &Identity::patient_birth_date},
    {"sex", &Identity::patient_sex},
    {"study_instance_uid", &Identity::study_instance_uid},
    {"study_date", &Identity::study_date},
    {"study_time", &Identity::study_time},
    {"study_id", &Identity::study_id},
    {"accession_number", &Identity::accession_number},
    {"referring_physician", &Identity::referring_physician},
}};

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
          {"known_translation_mm", array_of(Eigen::Vector3d(known_setup_error(report).translation()))},
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
               {"spread_deg", or_null(stage.spread_deg)},
               {"best", stage.best}};
  for (const auto& [name, value] : stage.parameters) json["parameters"][name] = value;
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
          {"structures", structures}};
}

Json site_json(const std::optional<SetupReport::Site>& site) {
  if (!site) return nullptr;
  Json json = {{"name", site->name},
               {"sha256", site->sha256},
               {"anatomy", site->anatomy},
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

Json points_json(const SetupReport& report) {
  Json list = Json::array();
  for (const SetupReport::Point& point : report.points)
    list.push_back({{"name", point.name}, {"room_mm", array_of(point.room_mm)}});
  return list;
}

Json left_over_json(const ShownShift& shown) {
  Json list = Json::array();
  for (const ShownShift::LeftOver& left : shown.left_over) list.push_back({{"at", left.at}, {"mm", array_of(left.mm)}});
  return list;
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
               {"program", {{"name", "isoshift"}, {"version", report.version}, {"commit", report.commit}}},
               {"made_on", report.made_on},
               {"verdict", to_string(report.verdict)},
               {"reasons", report.reasons},
               {"action", to_string(shown.action)},
               {"action_reasons", shown.action_reasons},
               {"patient", Json::object()},
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
  int evaluations = 0;
  Json images = Json::array();
  for (const SetupReport::View& view : report.views) {
    json["views"].push_back({{"label", view.label},
                             {"sop_instance_uid", view.sop_instance_uid},
                             {"sop_class_uid", view.sop_class_uid},
                             {"sha256", view.sha256},
                             {"frame", view.frame},
                             {"acquired", view.acquired},
                             {"reported_values_origin", view.origin},
                             {"beam", view.is_megavoltage ? "MV" : "kV"},
                             {"gantry_deg", or_null(view.gantry_deg)},
                             {"source_room_mm", array_of(view.source_room_mm)},
                             {"pixel_mm", view.pixel_mm},
                             {"columns", view.columns},
                             {"rows", view.rows},
                             {"similarity_start", view.similarity_start},
                             {"similarity_final", view.similarity_final},
                             {"left_out_mm", or_null(view.left_out_mm)},
                             {"left_out_deg", or_null(view.left_out_deg)},
                             {"parts", parts_json(view)},
                             {"picture", picture_json(view.picture)}});
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
                        {"ct_sha256", report.ct_sha256},
                        {"plan", or_null(report.plan_uid)},
                        {"plan_class", report.plan_class_uid},
                        {"plan_label", report.plan_label},
                        {"plan_approval", report.plan_approval},
                        {"plan_sha256", report.plan_sha256},
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

namespace {

template <int N>
Eigen::Matrix<double, N, 1> vector_from(const Json& json) {
  return Eigen::Matrix<double, N, 1>(json.get<std::array<double, N>>().data());
}

std::optional<double> number_from(const Json& json) {
  return json.is_null() ? std::nullopt : std::optional(json.get<double>());
}

// What is no number is written as null.
double or_nan(const Json& json) { return number_from(json).value_or(std::numeric_limits<double>::quiet_NaN()); }

std::string text_from(const Json& json) { return json.is_null() ? "" : json.get<std::string>(); }

std::vector<Polygon> polygons_from(const Json& json) {
  std::vector<Polygon> polygons;
  for (const Json& points : json) {
    Polygon& polygon = polygons.emplace_back();
    for (const Json& point : points) polygon.push_back(vector_from<2>(point));
  }
  return polygons;
}

ViewPicture picture_from(const Json& json) {
  ViewPicture picture{.field = polygons_from(json.at("field")),
                      .isocenter_px = vector_from<2>(json.at("isocenter_px")),
                      .pixels_per_mm = json.at("pixels_per_mm"),
                      .directions = json.at("directions")};
  for (const Json& outline : json.at("structures"))
    picture.structures.push_back({.name = outline.at("name"),
                                  .planned = polygons_from(outline.at("planned")),
                                  .found = polygons_from(outline.at("found"))});
  return picture;
}

SetupReport::View view_from(const Json& json) {
  SetupReport::View view{.label = json.at("label"),
                         .sop_class_uid = json.at("sop_class_uid"),
                         .sop_instance_uid = json.at("sop_instance_uid"),
                         .sha256 = json.at("sha256"),
                         .frame = json.at("frame"),
                         .acquired = json.at("acquired"),
                         .origin = json.at("reported_values_origin"),
                         .gantry_deg = number_from(json.at("gantry_deg")),
                         .source_room_mm = vector_from<3>(json.at("source_room_mm")),
                         .pixel_mm = json.at("pixel_mm"),
                         .columns = json.at("columns"),
                         .rows = json.at("rows"),
                         .is_megavoltage = json.at("beam") == "MV",
                         .similarity_start = or_nan(json.at("similarity_start")),
                         .similarity_final = or_nan(json.at("similarity_final")),
                         .left_out_mm = number_from(json.at("left_out_mm")),
                         .left_out_deg = number_from(json.at("left_out_deg")),
                         .picture = picture_from(json.at("picture"))};
  for (const Json& part : json.at("parts"))
    view.parts.push_back({.center_px = vector_from<2>(part.at("center_px")),
                          .width_px = part.at("width_px"),
                          .displacement_mm = vector_from<2>(part.at("displacement_mm")),
                          .correlation = part.at("correlation"),
                          .best_correlation = part.at("best_correlation"),
                          .has_signal = part.at("has_signal"),
                          .disagrees = part.at("disagrees")});
  return view;
}

SetupReport::Stage stage_from(const Json& json) {
  SetupReport::Stage stage{.name = json.at("name"),
                           .similarity = json.at("similarity"),
                           .optimizer = json.at("optimizer"),
                           .evaluations = json.at("evaluations"),
                           .seconds = json.at("seconds"),
                           .value = json.at("value"),
                           .termination = json.at("termination"),
                           .spread_mm = number_from(json.at("spread_mm")),
                           .spread_deg = number_from(json.at("spread_deg")),
                           .best = json.at("best")};
  for (const auto& [name, value] : json.at("parameters").items()) stage.parameters.emplace_back(name, value);
  return stage;
}

// A word that has a meaning here.
template <class T>
T one_of(const std::optional<T>& meaning, const char* place) {
  if (!meaning) throw Error(fmt::format("{} is none of those there are", place));
  return *meaning;
}

std::optional<CouchDof> couch_dof_from(int number) {
  for (const CouchDof dof : {CouchDof::kThree, CouchDof::kFour, CouchDof::kSix})
    if (static_cast<int>(dof) == number) return dof;
  return std::nullopt;
}

std::optional<SetupReport::Site> site_from(const Json& json) {
  if (json.is_null()) return std::nullopt;
  SetupReport::Site site{
      .name = json.at("name"),
      .sha256 = json.at("sha256"),
      .anatomy = json.at("anatomy"),
      .couch_dof = one_of(couch_dof_from(json.at("couch_degrees_of_freedom")), "site: couch_degrees_of_freedom"),
      .length_unit = json.at("length_unit") == "cm" ? LengthUnit::kCm : LengthUnit::kMm};
  if (const Json& level = json.at("action_level"); !level.is_null())
    site.level = {.translation_mm = number_from(level.at("translation_mm")),
                  .vector_mm = number_from(level.at("vector_mm")),
                  .rotation_deg = number_from(level.at("rotation_deg"))};
  if (const Json& scale = json.at("couch_scale"); !scale.is_null())
    site.couch_scale = {.scale = one_of(couch_scale_from(scale.at("name").get<std::string>()), "site: couch_scale"),
                        .validated_by = scale.at("validated_by"),
                        .validated_on = scale.at("validated_on")};
  if (const Json& release = json.at("automatic_release"); !release.is_null())
    site.automatic_release = {.by = release.at("by"), .on = release.at("on")};
  return site;
}

// Components that were not determined come back as 0; the directions that say so come back, too.
Eigen::Vector3d known_from(const Json& json) {
  Eigen::Vector3d vector = Eigen::Vector3d::Zero();
  for (std::size_t axis = 0; axis < 3; ++axis)
    vector[static_cast<Eigen::Index>(axis)] = number_from(json.at(axis)).value_or(0.0);
  return vector;
}

Verdict verdict_from(const std::string& word) {
  for (const Verdict verdict : {Verdict::kAccepted, Verdict::kReview})
    if (word == to_string(verdict)) return verdict;
  return Verdict::kRejected;  // and what no version of isoshift says
}

SetupReport report_from(const Json& json) {
  SetupReport report;
  report.made_on = json.at("made_on");
  report.version = json.at("program").at("version");
  report.commit = json.at("program").at("commit");
  report.verdict = verdict_from(json.at("verdict"));
  report.reasons = json.at("reasons");
  report.site = site_from(json.at("site"));
  for (const auto& [name, member] : kIdentity) report.identity.*member = json.at("patient").at(name);
  const Json& references = json.at("references");
  report.plan_label = references.at("plan_label");
  report.plan_approval = references.at("plan_approval");
  report.plan_sha256 = references.at("plan_sha256");
  report.plan_uid = text_from(references.at("plan"));
  report.plan_class_uid = references.at("plan_class");
  report.ct_series_uid = references.at("ct_series");
  report.ct_sha256 = references.at("ct_sha256");
  report.spatial_registration_uid = text_from(references.at("spatial_registration"));
  report.patient_position = json.at("patient_position");
  report.isocenter_patient_mm = vector_from<3>(json.at("isocenter_patient_mm"));
  const Json& table = json.at("table");
  report.table = {.support_rad = rad_from_deg(table.at("support_deg")),
                  .eccentric_rad = rad_from_deg(table.at("eccentric_deg")),
                  .pitch_rad = rad_from_deg(table.at("pitch_deg")),
                  .roll_rad = rad_from_deg(table.at("roll_deg"))};
  if (!table.at("position_mm").is_null()) report.table_position_mm = vector_from<3>(table.at("position_mm"));
  for (const Json& point : json.at("points"))
    report.points.push_back({.name = point.at("name"), .room_mm = vector_from<3>(point.at("room_mm"))});
  const Json& error = json.at("setup_error");
  report.setup_error.translation() = vector_from<3>(error.at("known_translation_mm"));
  for (std::size_t row = 0; row < 3; ++row)
    report.setup_error.linear().row(static_cast<Eigen::Index>(row)) =
        vector_from<3>(error.at("rotation_matrix").at(row));
  const Json& uncertainty = json.at("uncertainty");
  for (const Json& direction : uncertainty.at("unobservable"))
    report.unobservable_room.push_back(vector_from<3>(direction));
  if (!uncertainty.at("translation_mm").is_null())
    report.sigma = {.translation_mm = known_from(uncertainty.at("translation_mm")),
                    .rotation_deg = known_from(uncertainty.at("rotation_deg"))};
  report.translation_only = json.at("dof") == "translation";
  for (const Json& view : json.at("views")) report.views.push_back(view_from(view));
  for (const Json& stage : json.at("stages")) report.stages.push_back(stage_from(stage));
  for (const Json& alternative : json.at("alternatives"))
    report.alternatives.push_back({.description = alternative.at("description"),
                                   .similarity = alternative.at("similarity"),
                                   .as_is = alternative.at("as_is")});
  report.preset = json.at("preset");
  report.region = json.at("region");
  report.seed = json.at("seed");
  report.attenuation = json.at("attenuation");
  report.threshold_hu = json.at("threshold_hu");
  if (!json.at("window_hu").is_null()) report.window_hu = json.at("window_hu").get<std::array<double, 2>>();
  report.renderer = json.at("renderer");
  report.device = json.at("device");
  for (const auto& [name, value] : json.at("renderer_settings").items())
    report.renderer_settings.emplace_back(name, value);
  const Json& seconds = json.at("seconds");
  report.seconds_load = seconds.at("load");
  report.seconds_register = seconds.at("register");
  report.seconds_rendering = seconds.at("rendering");
  report.seconds_similarity = seconds.at("similarity");
  report.seconds_total = seconds.at("total");
  if (const Json& machine = json.at("machine"); !machine.is_null())
    report.machine = {.name = machine.at("name"), .sha256 = machine.at("sha256")};
  report.overrides = json.at("overrides");
  report.warnings = json.at("warnings");
  report.left_aside = json.at("left_aside");
  return report;
}

}  // namespace

SetupReport report_from_json(const std::string& json, const std::string& where) {
  try {
    const Json parsed = Json::parse(json);
    if (parsed.at("schema") != 1) throw Error(fmt::format("schema is {}, expected 1", parsed.at("schema").dump()));
    return report_from(parsed);
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", where, error.what()));
  } catch (const Json::exception& error) {
    throw Error(fmt::format("{}: is no result of this program: {}", where, error.what()));
  }
}

}  // namespace isoshift
