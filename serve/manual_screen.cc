#include "serve/manual_screen.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>

#include "base/error.h"
#include "base/stopwatch.h"
#include "io/report/polygons_json.h"
#include "io/report/report_page.h"
#include "io/report/result_folder.h"
#include "serve/answers.h"
#include "workflow/manual/landmarks.h"
#include "workflow/register/setup_error_json.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array kDetails = {LiveStudy::Detail::kFull, LiveStudy::Detail::kHalf, LiveStudy::Detail::kQuarter};
constexpr std::string_view kResults = "results/", kReportName = "/report.html";
constexpr double kMostMm = 1000.0;  // nobody is moved farther by hand

template <class Vector>
Json array_of(const Vector& values) {
  Json array = Json::array();
  for (const auto& value : values) array.push_back(value);
  return array;
}

Json rows_of(const auto& matrix) {
  Json rows = Json::array();
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    Json& values = rows.emplace_back(Json::array());
    for (Eigen::Index column = 0; column < matrix.cols(); ++column) values.push_back(matrix(row, column));
  }
  return rows;
}

// A browser's numbers drift: its rotation is brought back to the nearest one.
Eigen::Isometry3d pose_from(const Json& json) {
  Eigen::Isometry3d pose = setup_error_from(json);
  if (!(pose.translation().norm() <= kMostMm)) throw Error("setup_error: moves the patient by more than 1000 mm.");
  pose.linear() = Eigen::Quaterniond(pose.linear()).normalized().toRotationMatrix();
  return pose;
}

Json view_json(const LiveStudy::View& view) {
  Json sizes = Json::array();
  for (std::size_t n = 0; n < kDetails.size(); ++n) sizes.push_back({view.xray.columns >> n, view.xray.rows >> n});
  return {{"label", view.label},
          {"sizes", sizes},
          {"isocenter_px", array_of(view.isocenter_px)},
          {"px_per_mm", rows_of(view.px_per_mm)},
          {"from_source", array_of(view.from_source)},
          {"field", polygons_json(view.field)},
          {"directions", array_of(view.directions)}};
}

// By view: [column, row] or null.
std::vector<std::optional<Eigen::Vector2d>> marks_from(const Json& json) {
  std::vector<std::optional<Eigen::Vector2d>> marks;
  for (const Json& one : json) {
    auto& mark = marks.emplace_back();
    if (!one.is_null()) mark = Eigen::Vector2d(one.at(0).get<double>(), one.at(1).get<double>());
  }
  return marks;
}

void append(std::string& bytes, const Image<std::uint8_t>& image) {
  bytes.append(reinterpret_cast<const char*>(image.pixels.data()), image.pixels.size());
}

HttpResponse pixels_answer(std::string bytes) { return {.type = "application/octet-stream", .body = std::move(bytes)}; }

}  // namespace

HttpResponse ManualScreen::answer(const HttpRequest& request, const SignedIn& who, const std::string& what) {
  if (const std::string id = request.header("x-isoshift-study"); what != "study" && !id.empty() && id != id_)
    return refusal(409, "The study was read again since this page was loaded. Load it again.");
  if (request.method == "GET") {
    if (what == "study") return study();
    if (what == "xrays") return xrays();
    if (what == "state") return state();
    if (what.starts_with(kResults) && what.ends_with(kReportName) && what.size() > kResults.size() + kReportName.size())
      return report(what.substr(kResults.size(), what.size() - kResults.size() - kReportName.size()));
    return refusal(404, "There is nothing at this address.");
  }
  if (!has_type_json(request)) return refusal(415, "JSON is expected.");
  try {
    if (what == "drrs") return drrs(request);
    if (what == "outlines") return outlines(request);
    if (what == "landmarks") return landmarks(request);
    if (what == "begin") return begin(request, who);
  } catch (const Json::exception&) {
    return refusal(400,
                   "setup_error with translation_mm and rotation_matrix is expected, and detail, part, landmarks, or "
                   "searched and region.");
  }
  if (what != "cancel") return refusal(404, "There is nothing at this address.");
  if (!who.roles.contains(Role::kRegister)) return refusal(403, fmt::format("{} may not register.", who.user));
  registration_.cancel(who.user);
  return state();
}

HttpResponse ManualScreen::study() const {
  const Study& study = study_.study();
  Json views = Json::array();
  for (const LiveStudy::View& view : study_.views()) views.push_back(view_json(view));
  Json parts = Json::array();
  for (const LiveStudy::Part& part : study_.parts()) parts.push_back(part.words);
  const Identity& patient = study.ct->identity;
  return json_answer({{"id", id_},
                      {"patient", name_for_people(patient.patient_name)},
                      {"patient_id", patient.patient_id},
                      {"plan", study.plan ? study.plan->label : ""},
                      {"start", json_of_setup_error(start_)},
                      {"parts", std::move(parts)},
                      {"views", std::move(views)}});
}

HttpResponse ManualScreen::xrays() const {
  std::string bytes;
  for (const LiveStudy::View& view : study_.views()) append(bytes, view.xray);
  return pixels_answer(std::move(bytes));
}

HttpResponse ManualScreen::drrs(const HttpRequest& request) const {
  const Json body = Json::parse(request.body);
  const Eigen::Isometry3d setup_error = pose_from(body.at("setup_error"));
  const auto detail = body.at("detail").get<std::size_t>();
  if (detail >= kDetails.size()) return refusal(400, "detail is 0 (full), 1 (half) or 2 (a quarter).");
  const Stopwatch watch;
  std::string bytes;
  for (const Image<std::uint8_t>& drr : study_.drrs(setup_error, kDetails[detail])) append(bytes, drr);
  const double passed_ms = 1000.0 * watch.seconds();
  HttpResponse response = pixels_answer(std::move(bytes));
  response.headers.emplace_back("X-Isoshift-Milliseconds", fmt::format("{:.1f}", passed_ms));
  return response;
}

HttpResponse ManualScreen::outlines(const HttpRequest& request) const {
  const Json body = Json::parse(request.body);
  const auto part = body.at("part").get<std::size_t>();
  if (part >= study_.parts().size()) return refusal(400, "part is not one of those of the study.");
  Json views = Json::array();
  for (const std::vector<Polygon>& view : study_.outlines_of(part, pose_from(body.at("setup_error"))))
    views.push_back(polygons_json(view));
  return json_answer({{"views", std::move(views)}});
}

HttpResponse ManualScreen::landmarks(const HttpRequest& request) const {
  const Json body = Json::parse(request.body);
  std::vector<Landmark> landmarks;
  for (const Json& one : body.at("landmarks"))
    landmarks.push_back({.in_xrays = marks_from(one.at("xrays")), .in_drrs = marks_from(one.at("drrs"))});
  const LandmarkFit fit = fit_landmarks(study_.cameras(), landmarks, pose_from(body.at("setup_error")));
  return json_answer(
      {{"setup_error", json_of_setup_error(fit.setup_error)}, {"left_mm", fit.left_mm}, {"apart_mm", fit.apart_mm}});
}

// What a person wants compared: {"part": number or null, "boxes": by view, null or first column, first row, last
// column, last row on the picture}.
std::vector<std::string> ManualScreen::region_from(const Json& region) const {
  std::vector<std::string> flags;
  if (!region.at("part").is_null()) {
    const auto part = region.at("part").get<std::size_t>();
    if (part >= study_.parts().size()) throw Error("part is not one of those of the study.");
    flags = study_.parts()[part].flags;
  }
  const std::vector<LiveStudy::View>& views = study_.views();
  const Json& boxes = region.at("boxes");
  for (std::size_t n = 0; n < std::min(views.size(), boxes.size()); ++n) {
    if (boxes[n].is_null()) continue;
    const auto box = boxes[n].get<std::array<int, 4>>();
    const int block = views[n].block;
    flags.insert(flags.end(),
                 {"--rectangle", fmt::format("{}={},{},{},{}", views[n].label, box[0] * block, box[1] * block,
                                             (box[2] + 1) * block - 1, (box[3] + 1) * block - 1)});
  }
  return flags;
}

HttpResponse ManualScreen::begin(const HttpRequest& request, const SignedIn& who) {
  if (!who.roles.contains(Role::kRegister)) return refusal(403, fmt::format("{} may not register.", who.user));
  const Json body = Json::parse(request.body);
  registration_.begin(pose_from(body.at("setup_error")), who.user, body.at("searched"), region_from(body.at("region")));
  return state();
}

HttpResponse ManualScreen::state() {
  const ManualRegistration::State now = registration_.state();
  using What = ManualRegistration::State::What;
  switch (now.what) {
    case What::kIdle: return json_answer({{"state", "idle"}});
    case What::kRuns:
      return json_answer(
          {{"state", "runs"}, {"by", now.by}, {"step", now.progress.step}, {"share", now.progress.share}});
    case What::kFailed: return json_answer({{"state", "failed"}, {"by", now.by}, {"why", now.failure}});
    case What::kEnded: break;
  }
  const SetupResult result = read_report(now.result);
  return json_answer({{"state", "ended"},
                      {"by", now.by},
                      {"folder", now.result.string()},
                      {"verdict", to_string(result.verdict())},
                      {"reasons", result.reasons()},
                      {"searched", result.is_searched},
                      {"setup_error", json_of_setup_error(result.setup_error)}});
}

HttpResponse ManualScreen::report(const std::string& number) const {
  std::ifstream file;
  if (std::ranges::all_of(number, [](char c) { return c >= '0' && c <= '9'; }))
    file.open(registration_.results() / number / "report.html", std::ios::binary);
  if (!file.is_open()) return refusal(404, "There is no such result, or it was handed over.");
  return report_answer({std::istreambuf_iterator<char>(file), {}});
}

}  // namespace isoshift
