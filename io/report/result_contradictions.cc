// Whether a result.json says one thing: much of what it holds follows from the rest. Who changes the file by hand
// changes one of the two.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "base/error.h"
#include "geometry/patient_setup.h"
#include "geometry/rotation.h"
#include "geometry/xray_view.h"
#include "io/report/formats.h"
#include "io/report/result_json.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

// From what fields follow, for messages. The first whose beginning fits counts.
struct Derived {
  std::string_view field, from;
};
constexpr std::array kDerived = {
    Derived{"/setup_error", "setup_error/known_translation_mm and setup_error/rotation_matrix"},
    Derived{"/couch_applied", "setup_error, table, site and target/center_room_mm"},
    Derived{"/couch_", "setup_error and table"},
    Derived{"/left_over", "setup_error and points"},
    Derived{"/verdict", "findings"},
    Derived{"/action", "site/action_level and setup_error"},
    Derived{"/target/displacement_mm", "setup_error and target/center_room_mm"},
    Derived{"/target/sigma_mm", "uncertainty/covariance and target/center_room_mm"},
    Derived{"/target", "bodies"},
    Derived{"/uncertainty", "uncertainty/covariance and uncertainty/unobservable"},
    Derived{"/bodies", "bodies/sigma_mm and bodies/image_share"},
    Derived{"/references/images", "views/sop_instance_uid"},
    Derived{"/evaluations", "stages/evaluations"}};

std::string_view source_of(const std::string& field) {
  const auto* found = std::ranges::find_if(kDerived, [&](const Derived& one) { return field.starts_with(one.field); });
  return found == kDerived.end() ? "the rest of the file" : found->from;
}

std::string field_name(const std::string& pointer) { return pointer.substr(std::min<std::size_t>(1, pointer.size())); }

[[noreturn]] void refuse(const std::string& what) { throw Error(what + ": the file was changed after it was made"); }

// The first field that says something else than `expected`, but for the last digits, where both say something.
std::optional<Json::json_pointer> difference(const Json& file, const Json& expected, const Json::json_pointer& at) {
  constexpr double kLastDigits = 1e-6;
  if (file.is_number() && expected.is_number()) {
    const double there = file.get<double>(), here = expected.get<double>();
    return std::abs(there - here) <= kLastDigits * std::max(1.0, std::abs(here)) ? std::nullopt : std::optional(at);
  }
  if (file.is_array() && expected.is_array()) {
    if (file.size() != expected.size()) return at;
    for (std::size_t n = 0; n < file.size(); ++n)
      if (const auto found = difference(file[n], expected[n], at / n)) return found;
    return std::nullopt;
  }
  if (!file.is_object() || !expected.is_object()) return file == expected ? std::nullopt : std::optional(at);
  for (const auto& [key, value] : file.items())
    if (expected.contains(key))
      if (const auto found = difference(value, expected.at(key), at / key)) return found;
  return std::nullopt;
}

// What the result would be written as, without words, which change from version to version.
Json expected_json(const SetupResult& result) {
  Json expected = Json::parse(json_report(result));
  for (const char* words : {"reasons", "action_reasons"}) expected.erase(words);
  return expected;
}

void check_derived(const Json& file, const SetupResult& result) {
  const Json expected = expected_json(result);
  const auto field = difference(file, expected, Json::json_pointer());
  if (!field) return;
  const std::string pointer = field->to_string();
  refuse(fmt::format("{} is {}, but {} make it {}", field_name(pointer), file.at(*field).dump(), source_of(pointer),
                     expected.at(*field).dump()));
}

void check_verdict(const Json& file, const SetupResult& result) {
  if (file.at("reasons").size() != result.findings.size())
    refuse(fmt::format("reasons holds {} sentences, but findings holds {}", file.at("reasons").size(),
                       result.findings.size()));
  for (const std::string& reason : result.reasons())
    if (reason.empty()) refuse("findings holds one that says nothing");
  if (!result.is_searched && !(result.stages.empty() && result.alternatives.empty()))
    refuse("searched is false, but stages or alternatives tell of a search");
  if (result.verdict() == Verdict::kRejected && !result.spatial_registration_uid.empty())
    refuse("verdict is rejected, but references/spatial_registration names an object that was written");
}

void check_covariance(const std::optional<Uncertainty>& uncertainty, const char* field) {
  constexpr double kLeast = -1e-9, kLastDigits = 1e-9;
  if (!uncertainty || uncertainty->covariance.hasNaN()) return;
  const auto& covariance = uncertainty->covariance;
  if ((covariance - covariance.transpose()).cwiseAbs().maxCoeff() > kLastDigits * (1.0 + covariance.norm()))
    refuse(fmt::format("{} is not symmetric", field));
  if (covariance.diagonal().minCoeff() < kLeast) refuse(fmt::format("{} has a negative variance", field));
}

// The source of a pinhole: the point that its matrix does not map. A line scan has none.
std::optional<Eigen::Vector3d> source_of_matrix(const Eigen::Matrix<double, 3, 4>& pixel_from_room) {
  const Eigen::FullPivLU<Eigen::Matrix3d> rows(pixel_from_room.leftCols<3>());
  if (!rows.isInvertible()) return std::nullopt;
  return rows.solve(Eigen::Vector3d(-pixel_from_room.col(3)));
}

// What is not a number was not determined.
void check_correlation(double value, const std::string& field) {
  constexpr double kMost = 1.0 + 1e-6;
  if (std::abs(value) > kMost) refuse(fmt::format("{} is {:g}, but is a correlation: between -1 and 1", field, value));
}

void check_correlations(const SetupResult& result) {
  for (std::size_t n = 0; n < result.views.size(); ++n) {
    const ViewMatch& match = result.views[n].match;
    check_correlation(match.similarity_start, fmt::format("views/{}/similarity_start", n));
    check_correlation(match.similarity_final, fmt::format("views/{}/similarity_final", n));
  }
  for (std::size_t n = 0; n < result.alternatives.size(); ++n) {
    check_correlation(result.alternatives[n].similarity, fmt::format("alternatives/{}/similarity", n));
    check_correlation(result.alternatives[n].as_is, fmt::format("alternatives/{}/as_is", n));
  }
}

void check_views_differ(const std::vector<SetupResult::View>& views) {
  std::set<std::pair<std::string, int>> seen;
  for (std::size_t n = 0; n < views.size(); ++n)
    if (!seen.emplace(views[n].sop_instance_uid, views[n].frame).second)
      refuse(fmt::format("views/{}/sop_instance_uid is that of an earlier view, and so is its frame", n));
}

// The size of a pixel at the isocenter, and how far the receptor lies from the source along its normal.
void check_pixels_and_sid(const SetupResult::View& view, const std::string& where) {
  constexpr double kSameShare = 0.01;
  // Nearer to the isocenter, the rays end behind the receptor (XrayView).
  constexpr double kReceptorBehindMm = 250.0;
  const XrayView camera{.pixel_from_room = *view.pixel_from_room, .source_room_mm = view.source_room_mm};
  const Eigen::Vector3d across = camera.central_direction_room().unitOrthogonal();
  const auto isocenter = camera.project(Eigen::Vector3d::Zero()), beside = camera.project(across);
  if (!isocenter || !beside) refuse(fmt::format("{}/pixel_from_room puts the isocenter behind the source", where));
  const double pixel_mm = 1.0 / (*beside - *isocenter).norm();
  if (std::abs(view.pixel_mm - pixel_mm) > kSameShare * pixel_mm)
    refuse(fmt::format("{}/pixel_mm is {:g}, but {}/pixel_from_room makes it {:.4f}", where, view.pixel_mm, where,
                       pixel_mm));
  // Along the normal of the receptor, or along the beam where the receptor is tilted.
  const double sad_mm = view.source_room_mm.norm(),
               along_normal_mm = 1.0 / camera.pixel_from_room.row(2).head<3>().norm(),
               along_beam_mm = sad_mm / camera.pixel_from_room(2, 3);
  const auto is_sid = [&](double mm) { return std::abs(*view.sid_mm - mm) <= kSameShare * mm; };
  if (view.sid_mm && *view.sid_mm > sad_mm + kReceptorBehindMm && !is_sid(along_normal_mm) && !is_sid(along_beam_mm))
    refuse(fmt::format("{}/sid_mm is {:g}, but {}/pixel_from_room makes it {:.1f}", where, *view.sid_mm, where,
                       along_normal_mm));
}

void check_view(const SetupResult::View& view, const std::string& where) {
  constexpr double kSameMm = 0.1, kSameDeg = 1.0, kTurnDeg = 360.0;
  const Eigen::Vector3d& source = view.source_room_mm;
  if (view.pixel_from_room && !view.pixel_from_room->hasNaN())
    if (const auto by_matrix = source_of_matrix(*view.pixel_from_room)) {
      if ((*by_matrix - source).norm() > kSameMm)
        refuse(fmt::format(
            "{}/source_room_mm is ({:.3f}, {:.3f}, {:.3f}), but {}/pixel_from_room makes it ({:.3f}, "
            "{:.3f}, {:.3f})",
            where, source.x(), source.y(), source.z(), where, by_matrix->x(), by_matrix->y(), by_matrix->z()));
      check_pixels_and_sid(view, where);
    }
  if (!view.gantry_deg || source.isZero()) return;
  const double by_source_deg = deg_from_rad(std::atan2(source.x(), source.z()));
  if (std::abs(std::remainder(*view.gantry_deg - by_source_deg, kTurnDeg)) > kSameDeg)
    refuse(fmt::format("{}/gantry_deg is {:g}, but {}/source_room_mm makes it {:.1f}", where, *view.gantry_deg, where,
                       by_source_deg));
}

}  // namespace

void check_is_consistent(const Json& file, const SetupResult& result) {
  if (!as_rigid(Eigen::Affine3d(result.setup_error.matrix())))
    throw Error("setup_error: rotation_matrix is no rotation");
  check_derived(file, result);
  check_verdict(file, result);
  check_covariance(result.uncertainty, "uncertainty/covariance");
  check_covariance(result.by_imagers, "uncertainty/by_imagers/covariance");
  check_correlations(result);
  check_views_differ(result.views);
  for (std::size_t n = 0; n < result.views.size(); ++n) check_view(result.views[n], fmt::format("views/{}", n));
}

}  // namespace isoshift
