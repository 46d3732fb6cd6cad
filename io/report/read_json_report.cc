#include <fmt/format.h>

#include <array>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_file.h"
#include "geometry/rotation.h"
#include "io/report/formats.h"
#include "io/report/result_json.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

template <int N>
Eigen::Matrix<double, N, 1> vector_from(const Json& json) {
  return Eigen::Matrix<double, N, 1>(json.get<std::array<double, N>>().data());
}

std::optional<double> number_from(const Json& json) {
  return json.is_null() ? std::nullopt : std::optional(json.get<double>());
}

// What is not a number is written as null.
double or_nan(const Json& json) { return number_from(json).value_or(std::numeric_limits<double>::quiet_NaN()); }

std::string text_from(const Json& json) { return json.is_null() ? "" : json.get<std::string>(); }

Eigen::Matrix3d rotation_from(const Json& rows) {
  Eigen::Matrix3d rotation;
  for (std::size_t row = 0; row < 3; ++row) rotation.row(static_cast<Eigen::Index>(row)) = vector_from<3>(rows.at(row));
  return rotation;
}

template <int kRows, int kColumns>
Eigen::Matrix<double, kRows, kColumns> matrix_from(const Json& rows) {
  Eigen::Matrix<double, kRows, kColumns> matrix;
  for (Eigen::Index row = 0; row < kRows; ++row)
    for (Eigen::Index column = 0; column < kColumns; ++column)
      matrix(row, column) = or_nan(rows.at(static_cast<std::size_t>(row)).at(static_cast<std::size_t>(column)));
  return matrix;
}

Start start_from(const Json& json) {
  Start start{.file = json.at("file"), .sha256 = json.at("sha256"), .set_by = text_from(json.at("set_by"))};
  const Json& error = json.at("setup_error");
  start.setup_error.translation() = vector_from<3>(error.at("translation_mm"));
  start.setup_error.linear() = rotation_from(error.at("rotation_matrix"));
  return start;
}

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
  if (json.contains("moved")) picture.moved = polygons_from(json.at("moved"));
  return picture;
}

IrradiatedField irradiated_field_from(const Json& json) {
  IrradiatedField field{.sigma_mm = json.at("sigma_mm"),
                        .keep_off_mm = json.value("keep_off_mm", 0.0),
                        .doubt = text_from(json.at("doubt"))};
  for (const IrradiatedField::Origin origin : kFieldOrigins)
    if (json.at("origin") == to_string(origin)) field.origin = origin;
  for (const Json& corner : json.at("corners_px")) field.corners_px.push_back(vector_from<2>(corner));
  return field;
}

WantedMotion wanted_from(const Json& json) {
  WantedMotion wanted{.covariance = matrix_from<6, 6>(json.at("covariance"))};
  wanted.motion << vector_from<3>(json.at("translation_mm")),
      vector_from<3>(json.at("rotation_deg")).unaryExpr(&rad_from_deg);
  return wanted;
}

ViewMatch match_from(const Json& json) {
  ViewMatch match{.label = json.at("label"),
                  .similarity_start = or_nan(json.at("similarity_start")),
                  .similarity_final = or_nan(json.at("similarity_final"))};
  if (const auto distance_mm = number_from(json.at("left_out_mm")))
    match.left_out = {.distance_mm = *distance_mm, .angle_rad = rad_from_deg(json.at("left_out_deg"))};
  if (!json.at("contradiction_mm").is_null())
    match.contradiction = {.mm = json.at("contradiction_mm"), .sigma_mm = json.at("contradiction_sigma_mm")};
  if (const Json& wanted = json.at("wanted"); !wanted.is_null()) match.wanted = wanted_from(wanted);
  match.field = irradiated_field_from(json.at("irradiated_field"));
  for (const Json& part : json.at("parts"))
    match.consistency.parts.push_back({.center_px = vector_from<2>(part.at("center_px")),
                                       .width_px = part.at("width_px"),
                                       .displacement_mm = vector_from<2>(part.at("displacement_mm")),
                                       .correlation = part.at("correlation"),
                                       .best_correlation = part.at("best_correlation"),
                                       .has_signal = part.at("has_signal"),
                                       .disagrees = part.at("disagrees")});
  return match;
}

SetupResult::View view_from(const Json& json) {
  SetupResult::View view{.label = json.at("label"),
                         .sop_class_uid = json.at("sop_class_uid"),
                         .sop_instance_uid = json.at("sop_instance_uid"),
                         .sha256 = json.at("sha256"),
                         .frame = json.at("frame"),
                         .acquired = json.at("acquired"),
                         .origin = json.at("reported_values_origin"),
                         .gantry_deg = number_from(json.at("gantry_deg")),
                         .machine = json.at("radiation_machine"),
                         .sid_mm = number_from(json.at("sid_mm")),
                         .source_room_mm = vector_from<3>(json.at("source_room_mm")),
                         .pixel_mm = json.at("pixel_mm"),
                         .columns = json.at("columns"),
                         .rows = json.at("rows"),
                         .is_megavoltage = json.at("beam") == "MV",
                         .is_receptor_corrected = json.at("receptor_corrected"),
                         .match = match_from(json),
                         .picture = picture_from(json.at("picture"))};
  if (const Json& matrix = json.at("pixel_from_room"); !matrix.is_null())
    view.pixel_from_room = matrix_from<3, 4>(matrix);
  return view;
}

StageReport stage_from(const Json& json) {
  StageReport stage{.name = json.at("name"),
                    .similarity = json.at("similarity"),
                    .optimizer = json.at("optimizer"),
                    .evaluations = json.at("evaluations"),
                    .seconds = json.at("seconds"),
                    .value = json.at("value"),
                    .termination = json.at("termination"),
                    .spread_mm = number_from(json.at("spread_mm")),
                    .best = json.at("best")};
  if (const auto spread_deg = number_from(json.at("spread_deg"))) stage.spread_rad = rad_from_deg(*spread_deg);
  for (const auto& [name, value] : json.at("parameters").items()) {
    if (name.ends_with(kDeg))
      stage.parameters.emplace_back(name.substr(0, name.size() - kDeg.size()).append(kRad), rad_from_deg(value));
    else
      stage.parameters.emplace_back(name, value);
  }
  return stage;
}

std::optional<Target> target_from(const Json& json) {
  if (json.is_null()) return std::nullopt;
  Target target{.name = json.at("name"),
                .chosen_by = json.at("chosen_by"),
                .surrogate = json.at("surrogate"),
                .center_room_mm = vector_from<3>(json.at("center_room_mm"))};
  for (const Json& point : json.at("extent_room_mm")) target.extent_room_mm.push_back(vector_from<3>(point));
  return target;
}

std::vector<BodyMotion> bodies_from(const Json& json) {
  std::vector<BodyMotion> bodies;
  for (const Json& body : json) {
    const Json& sigma = body.at("sigma_mm");
    const Json& vertebra = body.at("vertebra");
    bodies.push_back({.name = body.at("name"),
                      .vertebra = vertebra.is_null() ? std::nullopt : std::optional(vertebra.get<int>()),
                      .center_room_mm = vector_from<3>(body.at("center_room_mm")),
                      .displacement_mm = vector_from<3>(body.at("displacement_mm")),
                      .rotation_rad = vector_from<3>(body.at("rotation_deg")).unaryExpr(&rad_from_deg),
                      .sigma_mm = {or_nan(sigma.at(0)), or_nan(sigma.at(1)), or_nan(sigma.at(2))},
                      .carries_target = body.at("carries_target"),
                      .image_share = or_nan(body.at("image_share")),
                      .breathes = body.at("breathes")});
  }
  return bodies;
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

std::optional<SiteRules> site_from(const Json& json) {
  if (json.is_null()) return std::nullopt;
  SiteRules site{
      .name = json.at("name"),
      .sha256 = json.at("sha256"),
      .anatomy = json.at("anatomy"),
      .target = text_from(json.at("target")),
      .surrogate = text_from(json.at("surrogate")),
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

std::optional<Uncertainty> uncertainty_from(const Json& json) {
  if (json.at("translation_mm").is_null()) return std::nullopt;
  return Uncertainty{.covariance = matrix_from<6, 6>(json.at("covariance"))};
}

Verdict consequence_from(const std::string& word) {
  for (const Verdict verdict : {Verdict::kReview, Verdict::kRejected})
    if (word == to_string(verdict)) return verdict;
  throw Error(fmt::format("findings: consequence is \"{}\", expected review or rejected", word));
}

std::vector<Finding> findings_from(const Json& json) {
  std::vector<Finding> findings;
  for (const Json& finding : json) {
    findings.push_back({.check = one_of(check_from(finding.at("check").get<std::string>()), "findings: check"),
                        .consequence = consequence_from(finding.at("consequence")),
                        .view = text_from(finding.at("view")),
                        .subject = text_from(finding.at("subject")),
                        .words = text_from(finding.at("words"))});
    for (const Json& measure : finding.at("measures"))
      findings.back().measures.push_back(
          {.value = or_nan(measure.at("value")), .limit = or_nan(measure.at("limit")), .unit = measure.at("unit")});
  }
  return findings;
}

// NOLINTNEXTLINE(readability-function-size): long because result.json is: each key into its field
SetupResult report_from(const Json& json) {
  SetupResult report;
  report.made_on = json.at("made_on");
  report.version = json.at("program").at("version");
  report.commit = json.at("program").at("commit");
  report.findings = findings_from(json.at("findings"));
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
  report.ct_frame_uid = references.at("ct_frame_of_reference");
  report.structure_set_uid = text_from(references.at("structure_set"));
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
  report.target = target_from(json.at("target"));
  report.bodies = bodies_from(json.at("bodies"));
  for (const Json& structure : json.at("structures"))
    report.structures.push_back({.name = structure.at("name"),
                                 .displacement_mm = vector_from<3>(structure.at("displacement_mm")),
                                 .most_mm = structure.at("most_mm"),
                                 .is_determined = structure.at("is_determined")});
  if (!report.bodies.empty() && report.target) {
    report.target_image_share = json.at("target").at("image_share");
    const auto match = [&](const char* name) { return or_nan(json.at("target").at(name)); };
    report.target_match = {.of_most_within_40_mm = match("match_within_40_mm"),
                           .of_most_within_20_mm = match("match_within_20_mm"),
                           .of_all = match("match"),
                           .of_parts = match("match_of_parts")};
    report.target_deformation_mm = json.at("target").at("deformation_mm");
  }
  const Json& error = json.at("setup_error");
  report.setup_error.translation() = vector_from<3>(error.at("known_translation_mm"));
  report.setup_error.linear() = rotation_from(error.at("rotation_matrix"));
  const Json& uncertainty = json.at("uncertainty");
  for (const Json& direction : uncertainty.at("unobservable"))
    report.unobservable_room.push_back(vector_from<3>(direction));
  report.uncertainty = uncertainty_from(uncertainty);
  if (const Json& by_imagers = uncertainty.at("by_imagers"); !by_imagers.is_null())
    report.by_imagers = Uncertainty{.covariance = matrix_from<6, 6>(by_imagers.at("covariance"))};
  report.translation_only = json.at("dof") == "translation";
  if (const Json& start = json.at("start"); !start.is_null()) report.start = start_from(start);
  report.is_searched = json.at("searched");
  for (const Json& view : json.at("views")) report.views.push_back(view_from(view));
  for (const Json& stage : json.at("stages")) report.stages.push_back(stage_from(stage));
  for (const Json& alternative : json.at("alternatives"))
    report.alternatives.push_back({.description = alternative.at("description"),
                                   .similarity = alternative.at("similarity"),
                                   .as_is = alternative.at("as_is"),
                                   .is_ruled_out = alternative.at("ruled_out")});
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
  report.seconds = seconds.at("register");
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

SetupResult report_from_json(const std::string& json, const std::string& where) {
  try {
    const Json parsed = Json::parse(json);
    if (parsed.at("schema") != 1) throw Error(fmt::format("schema is {}, expected 1", parsed.at("schema").dump()));
    SetupResult report = report_from(parsed);
    check_is_consistent(parsed, report);
    return report;
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", where, error.what()));
  } catch (const Json::exception& error) {
    throw Error(fmt::format("{}: is not a result of this program: {}", where, reason_of(error)));
  }
}

}  // namespace isoshift
