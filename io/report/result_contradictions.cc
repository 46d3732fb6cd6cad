// Whether a result.json says one thing: much of what it holds follows from the rest. Who changes the file by hand
// changes one of the two.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "geometry/patient_setup.h"
#include "geometry/rotation.h"
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

// What the result would be written as, without what does not follow from a file of an earlier version, and without
// words, which change from version to version.
Json expected_json(const Json& file, const SetupResult& result) {
  Json expected = Json::parse(json_report(result));
  expected.erase("action_reasons");
  if (Json& target = expected["target"]; target.is_object()) {
    if (!file.contains("bodies"))
      for (const char* of_bodies :
           {"image_share", "match_within_40_mm", "match_within_20_mm", "match", "match_of_parts", "deformation_mm"})
        target.erase(of_bodies);
    if (!file.at("uncertainty").contains("covariance")) target.erase("sigma_mm");
  }
  return expected;
}

void check_derived(const Json& file, const SetupResult& result) {
  const Json expected = expected_json(file, result);
  const auto field = difference(file, expected, Json::json_pointer());
  if (!field) return;
  const std::string pointer = field->to_string();
  refuse(fmt::format("{} is {}, but {} make it {}", field_name(pointer), file.at(*field).dump(), source_of(pointer),
                     expected.at(*field).dump()));
}

void check_verdict(const SetupResult& result) {
  const bool is_accepted = result.verdict == Verdict::kAccepted;
  if (is_accepted && !result.reasons.empty())
    refuse(fmt::format("verdict is accepted, but reasons says \"{}\"", result.reasons.front()));
  if (!is_accepted && result.reasons.empty())
    refuse(fmt::format("verdict is {}, but reasons is empty", to_string(result.verdict)));
  if (result.verdict == Verdict::kRejected && !result.spatial_registration_uid.empty())
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

void check_view(const SetupResult::View& view, const std::string& where) {
  constexpr double kSameMm = 0.1, kSameDeg = 1.0, kTurnDeg = 360.0;
  const Eigen::Vector3d& source = view.source_room_mm;
  if (view.pixel_from_room && !view.pixel_from_room->hasNaN())
    if (const auto by_matrix = source_of_matrix(*view.pixel_from_room);
        by_matrix && (*by_matrix - source).norm() > kSameMm)
      refuse(fmt::format(
          "{}/source_room_mm is ({:.3f}, {:.3f}, {:.3f}), but {}/pixel_from_room makes it ({:.3f}, "
          "{:.3f}, {:.3f})",
          where, source.x(), source.y(), source.z(), where, by_matrix->x(), by_matrix->y(), by_matrix->z()));
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
  check_verdict(result);
  check_covariance(result.uncertainty, "uncertainty/covariance");
  check_covariance(result.by_imagers, "uncertainty/by_imagers/covariance");
  for (std::size_t n = 0; n < result.views.size(); ++n) check_view(result.views[n], fmt::format("views/{}", n));
}

}  // namespace isoshift
