#include "workflow/audit_setup/audit_words.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "geometry/motion_axes.h"

namespace isoshift {
namespace {

template <class Names>
std::vector<std::string> drift_lines(const std::array<std::optional<Drift>, 6>& drifts, const Names& names) {
  std::vector<std::string> lines;
  bool is_tested = false;
  for (std::size_t axis = 0; axis < drifts.size(); ++axis) {
    const auto& drift = drifts[axis];
    is_tested = is_tested || drift.has_value();
    if (drift && drift->is_significant())
      lines.push_back(fmt::format("drift of {}: {} (p = {:.2g})", names[axis], in_words(*drift, axis), drift->p));
  }
  if (!is_tested)
    lines.push_back(fmt::format("drift is not tested: {} sessions of {} patients are needed", kLeastSessionsForDrift,
                                kLeastPatientsForDrift));
  else if (lines.empty())
    lines.emplace_back("no drift is significant");
  return lines;
}

std::string indented(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += "  " + line + "\n";
  return text;
}

std::string agreement_text(const SetupAudit& audit) {
  std::string text = fmt::format(
      "\nAGREEMENT    (used minus found, without outliers; mm and deg; table top, IEC 61217)\n"
      "  {:<14}{:>8}{:>10}{:>10}{:>10}{:>22}{:>26}\n",
      "", "sessions", "bias", "+/- 95 %", "SD", "limits of agreement", "slope per 30 days");
  for (std::size_t n = 0; n < audit.axes.size(); ++n) {
    const SetupAudit::Axis& axis = audit.axes[n];
    if (!axis.without_outliers) continue;
    const Agreement& agreement = *axis.without_outliers;
    text += fmt::format("  {:<14}{:>8}{:>+10.2f}", kCouchAxes[n], agreement.count, agreement.bias);
    if (agreement.sd)
      text += fmt::format(
          "{:>10}{:>10.2f}{:>22}", agreement.bias_within ? fmt::format("{:.2f}", *agreement.bias_within) : "-",
          *agreement.sd,
          fmt::format("{:+.2f} to {:+.2f}", agreement.bias - *agreement.limit, agreement.bias + *agreement.limit));
    if (axis.drift)
      text += fmt::format("{:>26}", fmt::format("{:+.3f} +/- {:.3f}", axis.drift->slope, axis.drift->slope_within));
    text += "\n";
  }
  return text;
}

std::string population_text(const char* what, const std::optional<SetupAudit::Population>& population) {
  if (!population) return fmt::format("  {:<31} not known: two patients with two sessions are needed\n", what);
  const auto three = [](const auto& values) {
    return fmt::format("{:6.2f}{:6.2f}{:6.2f}", values[0], values[1], values[2]);
  };
  return fmt::format("  {:<31} {:>8}  {}  {}  {}  {}\n", what, population->errors.patients,
                     three(population->errors.mean), three(population->errors.systematic),
                     three(population->errors.random), three(population->margin_mm));
}

}  // namespace

std::string date_of(double day) {
  const std::chrono::year_month_day date(std::chrono::sys_days(std::chrono::days(static_cast<int>(std::floor(day)))));
  return fmt::format("{:04}-{:02}-{:02}", static_cast<int>(date.year()), static_cast<unsigned>(date.month()),
                     static_cast<unsigned>(date.day()));
}

std::string in_words(const Drift& drift, std::size_t axis) {
  if (drift.shape == DriftShape::kLine)
    return fmt::format("{:+.2f} +/- {:.2f} {} per {:.0f} days", drift.slope, drift.slope_within, unit_of(axis),
                       kDaysOfSlope);
  return fmt::format("a step of {:+.2f} +/- {:.2f} {} on or shortly before {}", drift.change, drift.change_within,
                     unit_of(axis), date_of(drift.begins));
}

std::string in_words(const SetupAudit::Outlier& outlier, const SetupAudit& audit) {
  const AuditedSession& session = audit.sessions[outlier.session];
  std::vector<std::string> words;
  words.reserve(outlier.axes.size());
  for (const std::size_t axis : outlier.axes)
    words.push_back(fmt::format("{}: used {:+.1f}, found {:+.1f} {}", kCouchAxes[axis], *session.used[axis],
                                *session.found[axis], unit_of(axis)));
  return fmt::format("{}", fmt::join(words, "; "));
}

std::string remark_on(std::size_t session, const SetupAudit& audit) {
  const AuditedSession& one = audit.sessions[session];
  if (!one.counts())
    return fmt::format("not counted: {}{}{}", one.left_out, one.reasons.empty() ? "" : ": ",
                       fmt::join(one.reasons, "; "));
  if (const SetupAudit::Outlier* outlier = audit.outlier_of(session))
    return fmt::format("{} ({})", outlier->explanation, in_words(*outlier, audit));
  if (!one.is_compared() && audit.compared > 0)
    return fmt::format("not compared: {}", one.not_compared.empty() ? "no used shift" : one.not_compared);
  return "";
}

std::string counts_of(const SetupAudit& audit) {
  std::string text =
      fmt::format("sessions: {}, counted: {} (patients: {})", audit.sessions.size(), audit.counted, audit.patients);
  const auto counted = [](const AuditedSession& session) { return session.counts(); };
  const auto first = std::ranges::find_if(audit.sessions, counted);
  const auto last = std::find_if(audit.sessions.rbegin(), audit.sessions.rend(), counted);
  if (first != audit.sessions.end()) text += fmt::format(", {} to {}", date_of(first->day), date_of(last->day));
  return text +
         fmt::format("; {} compared with used shifts, {} of them outliers", audit.compared, audit.outliers.size());
}

std::vector<std::string> drifts_of_differences(const SetupAudit& audit) {
  std::array<std::optional<Drift>, 6> drifts;
  std::ranges::transform(audit.axes, drifts.begin(), &SetupAudit::Axis::drift);
  return drift_lines(drifts, kCouchAxes);
}

std::vector<std::string> drifts_of_setup(const SetupAudit& audit) { return drift_lines(audit.setup_drift, kSetupAxes); }

std::vector<std::string> doubtful_axes(const SetupAudit& audit) {
  std::vector<std::string> lines;
  for (std::size_t n = 0; n < audit.axes.size(); ++n) {
    if (audit.axes[n].looks_opposite)
      lines.push_back(fmt::format(
          "warning: {}: the used shifts agree better with the opposite of what was found: they may not count as IEC "
          "61217 does (docs/conventions.md)",
          kCouchAxes[n]));
    if (audit.axes[n].looks_unrelated)
      lines.push_back(fmt::format(
          "warning: {}: the used shifts lie hardly nearer to what was found than no shift would: were none applied, or "
          "are they numbers of another axis, of other sessions or in another unit?",
          kCouchAxes[n]));
  }
  return lines;
}

std::string meaning_of_outliers(const SetupAudit& audit) {
  if (!(audit.threshold > 0.0)) return "Outliers are not looked for: too few sessions are compared.";
  return fmt::format(
      "Outlier: the difference lies more than {:.1f} standard deviations from the median, or from the drift, on any "
      "axis. The standard deviation is that of the MAD of the axis (at least 0.1 mm or deg), more where the "
      "registration was less sure. If differences are normal, one in {:.0f} audits calls one without cause; with "
      "longer tails more do.",
      audit.threshold, 1.0 / kFalseOutliers);
}

std::string audit_text(const SetupAudit& audit) {
  std::string text = "SETUP AUDIT\nNot for clinical use unless validated by the site.\n\n" + counts_of(audit) + "\n";
  if (audit.compared > 0) {
    text += "\nOUTLIERS\n";
    for (const SetupAudit::Outlier& outlier : audit.outliers) {
      const AuditedSession& session = audit.sessions[outlier.session];
      text += fmt::format("  {}, {}: {}\n      {}\n", session.name, session.acquired, outlier.explanation,
                          in_words(outlier, audit));
    }
    if (audit.outliers.empty()) text += "  none\n";
    text += "  " + meaning_of_outliers(audit) + "\n" + agreement_text(audit) + indented(drifts_of_differences(audit)) +
            indented(doubtful_axes(audit));
  }
  text += "\nSETUP ERROR  (found by isoshift, first session of a day; room, IEC 61217 fixed)\n" +
          indented(drifts_of_setup(audit)) + "  " + kMeaningOfDrift + "\n";
  text += fmt::format("\nMARGINS      (mm)\n  {:<31} {:>8}  {:>18}  {:>18}  {:>18}  {:>18}\n", "", "patients", "M",
                      "Sigma", "sigma", "margin");
  text += population_text("as set up (x, y, z)", audit.uncorrected);
  if (audit.compared > 0) text += population_text("after used shifts (lat lng vrt)", audit.corrected);
  text += std::string("  ") + kMeaningOfMargins + "\n";
  std::string others;
  for (std::size_t n = 0; n < audit.sessions.size(); ++n)
    if (const std::string remark = remark_on(n, audit); !remark.empty() && audit.outlier_of(n) == nullptr)
      others += fmt::format("  {}: {}\n", audit.sessions[n].name, remark);
  if (!others.empty()) text += "\nLEFT OUT\n" + others;
  return text;
}

}  // namespace isoshift
