#include "workflow/scout/scout_files.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/json_file.h"
#include "base/sha256.h"
#include "base/version.h"
#include "geometry/motion_axes.h"
#include "geometry/rotation.h"
#include "io/report/canvas.h"
#include "io/report/report_page.h"
#include "workflow/scout/scout_picture.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array kAxisKeys = {"left", "posterior", "superior", "about_left", "about_posterior", "about_superior"};

// mm, or degrees of radians.
double shown(std::size_t axis, double value) { return is_rotation(axis) ? deg_from_rad(value) : value; }

Json axes_json(const ScoutRegistration& found) {
  if (found.verdict == Verdict::kRejected) return nullptr;
  Json axes;
  for (std::size_t n = 0; n < found.axes.size(); ++n) {
    const ScoutAxis& axis = found.axes[n];
    const std::string unit = unit_of(n);
    axes[kAxisKeys[n]] = {{"is_seen", axis.is_seen},
                          {"offset_" + unit, shown(n, axis.offset)},
                          {"sigma_" + unit, std::isfinite(axis.sigma) ? Json(shown(n, axis.sigma)) : Json(nullptr)},
                          {"repeatability_" + unit, shown(n, axis.repeatability)}};
  }
  return axes;
}

std::string list_of(const char* title, const std::vector<std::string>& lines) {
  if (lines.empty()) return "";
  std::string text = fmt::format("\n{}\n", title);
  for (const std::string& line : lines) text += fmt::format("  - {}\n", line);
  return text;
}

}  // namespace

ScoutAxisWords words_of(const ScoutAxis& axis, std::size_t n) {
  if (!axis.is_seen) return {};
  return {
      .offset = fmt::format("{:+6.2f} +/- {:.2f} {}", shown(n, axis.offset), 2.0 * shown(n, axis.sigma), unit_of(n)),
      .repeatability = fmt::format("{:6.3f} {}", shown(n, axis.repeatability), unit_of(n))};
}

std::string width_in_words(const ScoutRegistration& found) {
  return fmt::format("{:.3f} +/- {:.3f}", found.width, 2.0 * found.width_sigma);
}

std::string scout_text(const ScoutRegistration& found, const ScoutRequest& request) {
  std::string text = fmt::format(
      "SCOUT AGAINST ITS CT\n{}\n\n"
      "CT           {}\nScout        {}\n             SOP Instance UID {}\n             SHA-256 {}\n"
      "Patient      ID {}; the scout says {}\n"
      "Tube         on the patient's {} side{}; gradient correlation {:.3f}, {:.3f} from the other side\n"
      "Rendered by  {} on {}\n\nVERDICT      {}\n",
      kDisclaimer, found.ct_series_instance_uid, request.scout.string(), found.scout_sop_instance_uid,
      found.scout_sha256, patient_in_words(found.patient),
      found.scout_patient_position.empty() ? "no position" : found.scout_patient_position, to_string(found.tube),
      request.tube ? " (--tube)" : ", where the scout matches better", found.match, found.match_from_other_side,
      found.renderer, found.device, to_string(found.verdict));
  for (const std::string& reason : found.reasons) text += fmt::format("  - {}\n", reason);
  const std::string overrides = list_of("OVERRIDES    (what a person supplied or allowed)", found.notes.overrides);
  if (found.verdict == Verdict::kRejected)
    return text + "\nOFFSET       withheld: the result was rejected\n" + overrides;
  text += fmt::format(
      "\nOFFSET       (where the anatomy of the CT lies in the scout, against where the CT says; axes of the "
      "patient,\n              at ({:.1f}, {:.1f}, {:.1f}) mm, the center of the CT; +/- is two sigma)\n",
      found.center_patient_mm.x(), found.center_patient_mm.y(), found.center_patient_mm.z());
  for (std::size_t n = 0; n < found.axes.size(); ++n)
    text += fmt::format("  {:<19} {}\n", kScoutAxisWords[n],
                        found.axes[n].is_seen ? words_of(found.axes[n], n).offset : "not seen by this scout");
  text += fmt::format("  {:<19} {} times that of the CT\n", "width of the scout", width_in_words(found));
  text +=
      fmt::format("\nREPEATED     (from {} starts up to {:.0f} mm away: the largest distance from the offset above)\n",
                  found.starts, ScoutRegistration::kStartMm);
  for (std::size_t n = 0; n < found.axes.size(); ++n)
    if (found.axes[n].is_seen)
      text += fmt::format("  {:<19} {}\n", kScoutAxisWords[n], words_of(found.axes[n], n).repeatability);
  return text + overrides;
}

std::string scout_json(const ScoutRegistration& found, const ScoutRequest& request, const std::string& pdf_sha256,
                       const std::string& png_sha256) {
  const bool is_rejected = found.verdict == Verdict::kRejected;
  Json json = {
      {"schema", 1},
      {"program", {{"name", "isoshift"}, {"version", kVersion}, {"commit", kCommit}}},
      {"verdict", to_string(found.verdict)},
      {"reasons", found.reasons},
      {"tube", to_string(found.tube)},
      {"tube_is_measured", !request.tube.has_value()},
      {"gradient_correlation", found.match},
      {"gradient_correlation_from_other_side", found.match_from_other_side},
      {"center_patient_mm", {found.center_patient_mm.x(), found.center_patient_mm.y(), found.center_patient_mm.z()}},
      {"axes", axes_json(found)},
      {"width", is_rejected ? Json(nullptr) : Json(found.width)},
      {"width_sigma", is_rejected || !std::isfinite(found.width_sigma) ? Json(nullptr) : Json(found.width_sigma)},
      {"starts", found.starts},
      {"starts_up_to_mm", ScoutRegistration::kStartMm},
      {"renderer", found.renderer},
      {"device", found.device},
      {"patient", {{"id", found.patient.patient_id}, {"id_issuer", found.patient.patient_id_issuer}}},
      {"frame_of_reference_uid", found.frame_of_reference_uid},
      {"scout",
       {{"file", request.scout.string()},
        {"sop_instance_uid", found.scout_sop_instance_uid},
        {"patient_position", found.scout_patient_position.empty() ? Json(nullptr) : Json(found.scout_patient_position)},
        {"sha256", found.scout_sha256}}},
      {"ct_series_instance_uid", found.ct_series_instance_uid},
      {"warnings", found.notes.warnings},
      {"overrides", found.notes.overrides}};
  if (!pdf_sha256.empty()) json["files_sha256"] = {{"scout.pdf", pdf_sha256}, {"scout.png", png_sha256}};
  return json_text(json);
}

std::string scout_png(const ScoutRegistration& found) {
  constexpr double kWidth = 1600.0, kMostHeight = 2400.0, kMargin = 12.0;
  // How high the tiles become is known once they are drawn.
  Canvas trial(Canvas::Kind::kPng, 10.0, 10.0);
  const double height = draw_scout(trial, 0.0, 0.0, kWidth, kMostHeight, found.picture, found.picture_aspect);
  Canvas canvas(Canvas::Kind::kPng, kWidth + 2.0 * kMargin, height + 2.0 * kMargin);
  canvas.fill(0.0, 0.0, canvas.width(), canvas.height(), color::kWhite);
  draw_scout(canvas, kMargin, kMargin, kWidth, kMostHeight, found.picture, found.picture_aspect);
  return canvas.finish();
}

void write_scout_result(const ScoutRegistration& found, const ScoutRequest& request, OutputFolder& output) {
  const std::string pdf = scout_pdf(found, request), png = scout_png(found);
  write_text(output.path() / "scout.pdf", pdf);
  write_text(output.path() / "scout.png", png);
  write_text(output.path() / "scout.json", scout_json(found, request, sha256_of(pdf), sha256_of(png)));
  output.commit();
}

}  // namespace isoshift
