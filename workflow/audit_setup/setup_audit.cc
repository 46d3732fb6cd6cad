#include "workflow/audit_setup/setup_audit.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "base/median.h"
#include "workflow/audit_setup/explanation.h"

namespace isoshift {
namespace {

// A number for every patient, the same for all of the patient's sessions.
class PatientNumbers {
 public:
  std::size_t of(const AuditedSession& session) {
    return numbers_.try_emplace(patient_key(session.identity), numbers_.size()).first->second;
  }
  std::size_t count() const { return numbers_.size(); }

 private:
  std::map<std::string, std::size_t> numbers_;
};

// The errors of patients as sessions come in, in the order of time.
class ErrorsByPatient {
 public:
  void add(const AuditedSession& session, const ErrorComponents& error) {
    by_patient_[patient_key(session.identity)].push_back(error);
  }
  std::optional<SetupAudit::Population> population() const {
    std::vector<PatientErrors> patients;
    patients.reserve(by_patient_.size());
    for (const auto& [patient, fractions] : by_patient_) patients.push_back(errors_of_patient(patient, fractions));
    const std::optional<PopulationErrors> errors = errors_of_population(patients);
    if (!errors) return std::nullopt;
    return SetupAudit::Population{.errors = *errors, .margin_mm = van_herk_margin_mm(*errors)};
  }

 private:
  std::map<std::string, std::vector<ErrorComponents>> by_patient_;
};

void audit_setup_errors(SetupAudit& audit) {
  PatientNumbers patients;
  ErrorsByPatient errors;
  std::array<std::vector<Measurement>, 6> series;
  for (const AuditedSession& session : audit.sessions) {
    if (!session.counts()) continue;
    const std::size_t patient = patients.of(session);
    if (!session.is_first_of_day || !session.setup_error) continue;
    errors.add(session, *session.setup_error);
    for (std::size_t component = 0; component < series.size(); ++component)
      series[component].push_back({.day = session.day, .patient = patient, .value = (*session.setup_error)[component]});
  }
  audit.patients = patients.count();
  audit.uncorrected = errors.population();
  for (std::size_t component = 0; component < series.size(); ++component)
    audit.setup_drift[component] = drift_of(series[component], series.size());
}

// Whether the used shifts of an axis lie much nearer to the opposite of what was found: a display that counts the other
// way.
bool looks_opposite(const std::vector<const AuditedSession*>& compared, std::size_t axis) {
  constexpr double kMuchNearer = 0.5;
  std::vector<double> apart, apart_from_opposite;
  for (const AuditedSession* session : compared) {
    if (!session->used[axis] || !session->found[axis]) continue;
    apart.push_back(std::abs(*session->used[axis] - *session->found[axis]));
    apart_from_opposite.push_back(std::abs(*session->used[axis] + *session->found[axis]));
  }
  return !apart.empty() && median(apart_from_opposite) < kMuchNearer * median(apart);
}

// Whether the used shifts of an axis lie hardly nearer to what was found than no shift: they may be numbers of another
// axis, of other sessions, or in another unit.
bool looks_unrelated(const std::vector<const AuditedSession*>& compared, std::size_t axis) {
  constexpr std::size_t kFewest = 4;
  constexpr double kHardlyNearer = 0.75, kLeast = 1.0;  // of what was found, in mm or degrees
  std::vector<double> apart, apart_from_nothing;
  for (const AuditedSession* session : compared) {
    if (!session->used[axis] || !session->found[axis]) continue;
    apart.push_back(std::abs(*session->used[axis] - *session->found[axis]));
    apart_from_nothing.push_back(std::abs(*session->found[axis]));
  }
  if (apart.size() < kFewest) return false;
  const double nothing = median(apart_from_nothing);
  return nothing > kLeast && median(apart) > kHardlyNearer * nothing;
}

// Differences of sessions with the numbers of their patients.
class DifferencesOfPatients {
 public:
  void add(double difference, std::size_t patient) {
    differences_.push_back(difference);
    patients_.push_back(patient);
  }
  std::optional<Agreement> agreement() const {
    return differences_.empty() ? std::nullopt : std::optional(agreement_of(differences_, patients_));
  }

 private:
  std::vector<double> differences_;
  std::vector<std::size_t> patients_;
};

void audit_axis(const std::vector<const AuditedSession*>& compared, const std::vector<SessionDifference>& differences,
                const DifferencesFound& found, std::size_t axis, SetupAudit::Axis& audited) {
  DifferencesOfPatients all, without_outliers;
  for (std::size_t n = 0; n < differences.size(); ++n) {
    const auto off = differences[n].difference[axis];
    if (!off) continue;
    all.add(*off, differences[n].patient);
    if (!found.is_outlier(n)) without_outliers.add(*off, differences[n].patient);
  }
  audited.of_all = all.agreement();
  audited.without_outliers = without_outliers.agreement();
  audited.drift = found.axes[axis].drift;
  audited.scatter = found.axes[axis].scatter;
  audited.looks_opposite = looks_opposite(compared, axis);
  audited.looks_unrelated = !audited.looks_opposite && looks_unrelated(compared, axis);
}

void audit_differences(SetupAudit& audit) {
  PatientNumbers patients;
  std::vector<const AuditedSession*> compared;
  std::vector<std::size_t> places;  // in audit.sessions
  std::vector<SessionDifference> differences;
  for (std::size_t n = 0; n < audit.sessions.size(); ++n) {
    const AuditedSession& session = audit.sessions[n];
    if (!session.is_compared()) continue;
    compared.push_back(&session);
    places.push_back(n);
    differences.push_back({.day = session.day,
                           .patient = patients.of(session),
                           .difference = session.difference(),
                           .sigma = session.sigma});
  }
  const DifferencesFound found = find_in_differences(differences);
  audit.compared = compared.size();
  audit.threshold = found.threshold;
  for (std::size_t axis = 0; axis < audit.axes.size(); ++axis)
    audit_axis(compared, differences, found, axis, audit.axes[axis]);
  audit.level.resize(audit.sessions.size());
  ErrorsByPatient left;
  for (std::size_t n = 0; n < compared.size(); ++n) {
    audit.level[places[n]] = found.level[n];
    if (found.is_outlier(n)) {
      audit.outliers.push_back(
          {.session = places[n], .axes = found.outlying[n], .explanation = explanation_of(n, compared, found)});
      continue;
    }
    const CouchAxes off = compared[n]->difference();
    if (compared[n]->is_first_of_day && off[0] && off[1] && off[2]) left.add(*compared[n], {*off[0], *off[1], *off[2]});
  }
  audit.corrected = left.population();
}

}  // namespace

const SetupAudit::Outlier* SetupAudit::outlier_of(std::size_t session) const {
  const auto found = std::ranges::find(outliers, session, &Outlier::session);
  return found == outliers.end() ? nullptr : &*found;
}

SetupAudit audit_of(std::vector<AuditedSession> sessions) {
  SetupAudit audit{.sessions = std::move(sessions)};
  audit.counted = static_cast<std::size_t>(std::ranges::count_if(audit.sessions, &AuditedSession::counts));
  audit_setup_errors(audit);
  audit_differences(audit);
  return audit;
}

}  // namespace isoshift
