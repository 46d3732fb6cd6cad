#include "io/report/report_sections.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "geometry/rotation.h"
#include "io/report/canvas.h"
#include "io/report/moved_bodies.h"
#include "io/report/rounding.h"

namespace isoshift {
namespace {

std::string vector_words(const Eigen::Vector3d& mm, int decimals = 1) {
  return fmt::format("({:.{}f}, {:.{}f}, {:.{}f}) mm", mm.x(), decimals, mm.y(), decimals, mm.z(), decimals);
}

ReportPage::Section geometry_section(const SetupResult& report) {
  ReportPage::Section section{.title = "Geometry as understood"};
  section.rows.push_back(
      {"Isocenter", vector_words(report.isocenter_patient_mm, 2) + ", patient coordinates of the CT"});
  section.rows.push_back({"Table angles at imaging",
                          fmt::format("support {:.2f}, eccentric {:.2f}, pitch {:.2f}, roll {:.2f} deg",
                                      deg_from_rad(report.table.support_rad), deg_from_rad(report.table.eccentric_rad),
                                      deg_from_rad(report.table.pitch_rad), deg_from_rad(report.table.roll_rad))});
  if (report.table_position_mm)
    section.rows.push_back({"Table position at imaging",
                            vector_words(*report.table_position_mm) + " lateral, longitudinal, vertical, IEC 61217"});
  for (const SetupResult::View& view : report.views)
    section.rows.push_back({printable(view.label),
                            fmt::format("source at {} IEC fixed; {} x {} pixels of {:.3f} mm at the isocenter",
                                        vector_words(view.source_room_mm), view.columns, view.rows, view.pixel_mm)});
  return section;
}

// Where the target lies, as planned and as found.
ReportPage::Section target_section(const SetupResult& report, const ShownShift& shown, LengthUnit unit) {
  const auto words = [&](const std::array<std::optional<double>, 3>& mm) {
    std::vector<std::string> components;
    components.reserve(mm.size());
    for (const auto& component : mm)
      components.push_back(component ? rounded_length(*component, unit) : std::string(kNotDetermined));
    return fmt::format("({}) {}", fmt::join(components, ", "), name_of(unit));
  };
  ReportPage::Section section{.title = "Target"};
  section.rows.push_back({"Name", printable(report.target->name)});
  section.rows.push_back({"Chosen by", report.target->chosen_by});
  section.rows.push_back(
      {"Center as planned", vector_words(report.target->center_room_mm) + " from the isocenter, IEC 61217 fixed"});
  if (!shown.withheld) section.rows.push_back({"Center lies off plan by", words(shown.target_mm)});
  if (!shown.withheld && report.uncertainty)
    section.rows.push_back({"One sigma of that", words(shown.target_sigma_mm)});
  if (!shown.moved.empty())
    section.rows.push_back(
        {"Deformation", fmt::format("its surface lies at most {} {} from where a rigid motion puts it",
                                    unsigned_length(report.target_deformation_mm, unit), name_of(unit))});
  return section;
}

ReportPage::Section left_over_section(const ReportPage& page) {
  ReportPage::Section section{.title = page.left_over_words, .rows = {}};
  for (const ReportPage::LeftOver& left : page.left_over)
    section.rows.push_back({left.at, fmt::format("({}) {}, length {} {}", fmt::join(left.components, ", "), left.unit,
                                                 left.length, left.unit)});
  return section;
}

ReportPage::Section search_section(const SetupResult& report) {
  ReportPage::Section section{.title = "Search"};
  section.rows.push_back(
      {"Preset", fmt::format("{}, seed {}, {}", report.preset, report.seed,
                             !report.is_searched       ? "not searched"
                             : report.translation_only ? "translations only: rotations were taken as 0"
                                                       : "six degrees of freedom")});
  if (report.start)
    section.rows.push_back(
        {"Start", fmt::format("{}, SHA-256 {}", printable(report.start->file), printable(report.start->sha256))});
  section.rows.push_back(
      {"Region", report.region.empty() ? "everything" : printable(fmt::format("{}", fmt::join(report.region, "; ")))});
  for (const StageReport& stage : report.stages)
    section.rows.push_back(
        {"Stage " + stage.name,
         fmt::format("{} by {}: {:.4f} after {} evaluations in {:.2f} s, {}{}", stage.similarity, stage.optimizer,
                     stage.value, stage.evaluations, stage.seconds, stage.termination,
                     stage.spread_mm ? fmt::format("; ends of its starts within {:.2f} mm, {:.2f} deg",
                                                   *stage.spread_mm, deg_from_rad(stage.spread_rad.value_or(0.0)))
                                     : "")});
  return section;
}

// The field's size, as the lengths of two sides at the isocenter.
std::string field_words(const SetupResult::View& view) {
  const IrradiatedField& field = view.match.field;
  std::string words = field.origin == IrradiatedField::Origin::kWholeReceptor ? "the whole receptor"
                      : field.origin == IrradiatedField::Origin::kFound       ? "found in the image"
                      : field.origin == IrradiatedField::Origin::kDeclared ? "declared by the file, seen in the image"
                                                                           : "drawn by hand";
  if (field.corners_px.size() == 4 && field.origin != IrradiatedField::Origin::kWholeReceptor)
    words += fmt::format(": {:.1f} x {:.1f} mm at the isocenter",
                         view.pixel_mm * (field.corners_px[1] - field.corners_px[0]).norm(),
                         view.pixel_mm * (field.corners_px[2] - field.corners_px[1]).norm());
  if (field.sigma_mm > 0.0 && field.sigma_mm < 100.0) words += fmt::format(", +/- {:.1f} mm", 2.0 * field.sigma_mm);
  if (field.keep_off_mm > 0.0)
    words += fmt::format("; a side may lie {:.1f} mm farther in, which is not compared", field.keep_off_mm);
  return field.is_sure() ? words : words + "; not sure: " + printable(field.doubt);
}

// What errors of the imagers do to the result, or would do.
std::string imager_words(const SetupResult& report) {
  if (report.by_imagers) {
    const Eigen::Vector3d mm = report.by_imagers->sigma_translation_mm(), rad = report.by_imagers->sigma_rotation_rad();
    return fmt::format(
        "what is left of their errors adds one sigma of ({:.2f}, {:.2f}, {:.2f}) mm, ({:.2f}, {:.2f}, "
        "{:.2f}) deg along and about x, y, z, says the machine profile",
        mm.x(), mm.y(), mm.z(), deg_from_rad(rad.x()), deg_from_rad(rad.y()), deg_from_rad(rad.z()));
  }
  double most = 0.0;
  for (const SetupResult::View& view : report.views)
    if (view.sid_mm) most = std::max(most, view.source_room_mm.norm() / *view.sid_mm);
  constexpr const char* kUnknown = "as the files say; no machine profile tells of their errors";
  if (most == 0.0) return kUnknown;
  return fmt::format("{}. 1 mm by which a receptor is off would be {:.2f} mm of setup error, and is not in sigma",
                     kUnknown, most);
}

ReportPage::Section checks_section(const SetupResult& report) {
  ReportPage::Section section{.title = "Checks"};
  for (const SetupResult::View& view : report.views) {
    std::string words =
        fmt::format("similarity {:.4f} {}, {:.4f} as found; {}{} of {} parts with signal match elsewhere",
                    view.match.similarity_start, report.start ? "at the start" : "as planned",
                    view.match.similarity_final, report.bodies.empty() ? "" : "of the patient as a whole ",
                    view.match.consistency.disagreeing(), view.match.consistency.with_signal());
    if (const auto& left_out = view.match.left_out)
      words += fmt::format("; without it the pose moves {:.2f} mm, {:.2f} deg", left_out->distance_mm,
                           deg_from_rad(left_out->angle_rad));
    if (const auto& contradiction = view.match.contradiction)
      words += fmt::format("; alone it would want the anatomy {:.2f} mm elsewhere (sigma {:.2f} mm)", contradiction->mm,
                           contradiction->sigma_mm);
    section.rows.push_back({printable(view.label), words});
    if (!view.match.field.corners_px.empty())
      section.rows.push_back({"Field of " + printable(view.label), field_words(view)});
  }
  section.rows.push_back({"Geometry of imagers", imager_words(report)});
  for (const Alternative& alternative : report.alternatives)
    section.rows.push_back({"If " + printable(alternative.description),
                            fmt::format("similarity {:.4f}, as it is {:.4f}{}", alternative.similarity,
                                        alternative.as_is, alternative.is_ruled_out ? "; clearly less probable" : "")});
  return section;
}

ReportPage::Section provenance_section(const SetupResult& report) {
  ReportPage::Section section{.title = "Provenance"};
  std::string settings;
  for (auto [name, value] : report.renderer_settings) {
    std::ranges::replace(name, '_', ' ');
    settings += fmt::format(", {} {}", name, printable(value));
  }
  section.rows = {
      {"Program", fmt::format("isoshift {} ({})", report.version, report.commit)},
      {"Renderer", fmt::format("{} on {}{}; attenuation {}, threshold {:.0f} HU", report.renderer,
                               printable(report.device), settings, report.attenuation, report.threshold_hu)},
      {"Time", fmt::format("{:.1f} s, of which registration {:.1f} s", report.seconds_total, report.seconds)},
      {"CT series", fmt::format("{}; SHA-256 {}", printable(report.ct_series_uid), report.ct_sha256)}};
  if (!report.plan_uid.empty())
    section.rows.push_back({"Plan", fmt::format("{}; SHA-256 {}", printable(report.plan_uid), report.plan_sha256)});
  for (const SetupResult::View& view : report.views)
    section.rows.push_back(
        {printable(view.label),
         fmt::format("{} frame {}; SHA-256 {}", printable(view.sop_instance_uid), view.frame, view.sha256)});
  if (report.machine)
    section.rows.push_back({"Machine profile", fmt::format("\"{}\"; SHA-256 {}", printable(report.machine->name),
                                                           report.machine->sha256)});
  if (report.site)
    section.rows.push_back(
        {"Site file", fmt::format("\"{}\"; SHA-256 {}", printable(report.site->name), report.site->sha256)});
  if (report.site)
    section.rows.push_back({"Release", report.site->automatic_release
                                           ? fmt::format("automatic for accepted results, allowed by {} on {}",
                                                         printable(report.site->automatic_release->by),
                                                         printable(report.site->automatic_release->on))
                                           : "by a person"});
  section.rows.push_back({"Registration object", report.spatial_registration_uid.empty()
                                                     ? "none was written"
                                                     : report.spatial_registration_uid});
  return section;
}

}  // namespace

std::vector<ReportPage::Section> report_sections(const SetupResult& report, const ShownShift& shown, LengthUnit unit,
                                                 const ReportPage& page) {
  std::vector<ReportPage::Section> sections;
  if (report.target) sections.push_back(target_section(report, shown, unit));
  if (!shown.moved.empty()) sections.push_back(moved_section(shown, report.structures, unit));
  sections.push_back(geometry_section(report));
  if (!page.left_over.empty()) sections.push_back(left_over_section(page));
  for (const auto& section : {search_section(report), checks_section(report), provenance_section(report)})
    sections.push_back(section);
  return sections;
}

}  // namespace isoshift
