#include "tests/support/audited_archive.h"

#include <fmt/format.h>

#include <cmath>
#include <random>

#include "base/local_time.h"
#include "base/output_folder.h"
#include "geometry/rotation.h"
#include "io/report/result_folder.h"
#include "setup/shown_shift.h"
#include "tests/support/oblique_report.h"
#include "workflow/audit_setup/audit_words.h"
#include "workflow/audit_setup/used_shifts.h"

namespace isoshift {
namespace {

constexpr std::size_t kSessions = 60;
constexpr int kPairs = 5;  // of patients

struct Noise {
  std::mt19937_64 generator;
  std::normal_distribution<double> normal;

  // Three translations in mm and three rotations in degrees.
  ErrorComponents of(double mm, double deg) {
    ErrorComponents all{};
    for (std::size_t n = 0; n < all.size(); ++n) all[n] = (n < 3 ? mm : deg) * normal(generator);
    return all;
  }
};

SetupResult result_of(const std::string& patient, int day, int hour, std::size_t number, const ErrorComponents& error) {
  SetupResult result = oblique_report(Verdict::kAccepted);
  result.identity.patient_id = patient;
  result.identity.patient_name = "";
  result.table = {};
  result.views.front().sop_instance_uid = fmt::format("1.2.3.{}", number + 1);
  result.views.front().acquired = fmt::format("{} {:02}:00:00", date_of(day), hour);
  result.setup_error.translation() = Eigen::Vector3d(error[0], error[1], error[2]);
  result.setup_error.linear() =
      rotation_from_zxy({rad_from_deg(error[5]), rad_from_deg(error[3]), rad_from_deg(error[4])});
  result.uncertainty =
      uncertainty_of_independent_axes({0.1, 0.1, 0.1}, {rad_from_deg(0.1), rad_from_deg(0.1), rad_from_deg(0.1)});
  return result;
}

CouchAxes found_of(const SetupResult& result) {
  const ShownShift shown = shown_shift(result);
  return {shown.couch_mm[0],  shown.couch_mm[1],  shown.couch_mm[2],
          shown.couch_deg[0], shown.couch_deg[1], shown.couch_deg[2]};
}

// Sessions 2n and 2n + 1 are of one day.
std::size_t swap_patient(MadeArchive& archive) {
  for (std::size_t n = 20;; n = (n + 1) % kSessions) {
    CouchAxes &mine = archive.sessions[n].used, other = archive.sessions[n ^ 1].used;
    if (std::abs(*mine[0] - *other[0]) < 4.0) continue;
    mine = other;
    return n;
  }
}

// Turns the sign of the first translation from this session on for which that makes at least 5 mm.
void turn_sign(MadeArchive& archive, std::size_t from, std::size_t which) {
  for (std::size_t n = from;; ++n) {
    const std::size_t session = n % kSessions;
    if (session == archive.swapped || (which == 1 && session == archive.signs[0])) continue;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      double& used = *archive.sessions[session].used[axis];
      if (std::abs(used) < 2.5) continue;
      used = -used;
      archive.signs[which] = session;
      archive.sign_axes[which] = axis;
      return;
    }
  }
}

}  // namespace

std::string MadeArchive::name_of(std::size_t session) { return fmt::format("f{:02}", session + 1); }

MadeArchive made_archive(std::uint64_t seed, double drift_mm, bool with_mistakes) {
  constexpr int kFirstDay = 20454, kDaysBetweenPairs = 75, kDaysBetweenFractions = 7;  // from 2026-01-01
  Noise noise{.generator = std::mt19937_64(seed), .normal = {}};
  MadeArchive archive;
  std::vector<ErrorComponents> of_patient;
  for (int patient = 0; patient < 2 * kPairs; ++patient) of_patient.push_back(noise.of(2.0, 1.0));
  for (std::size_t n = 0; n < kSessions; ++n) {
    const int pair = static_cast<int>(n * kPairs / kSessions), patient = 2 * pair + static_cast<int>(n % 2);
    const int fraction = static_cast<int>(n - pair * kSessions / kPairs) / 2;
    const int day = kDaysBetweenPairs * pair + kDaysBetweenFractions * fraction;
    ErrorComponents truth = noise.of(2.0, 1.0), seen = noise.of(0.1, 0.1);
    for (std::size_t c = 0; c < truth.size(); ++c) {
      truth[c] += of_patient[static_cast<std::size_t>(patient)][c];
      seen[c] += truth[c];
    }
    const int hour = 9 + static_cast<int>(n % 2);
    MadeSession& session = archive.sessions.emplace_back();
    session.result = result_of(fmt::format("P{}", patient + 1), kFirstDay + day, hour, n, seen);
    const CouchAxes needed = found_of(result_of("", 0, hour, n, truth));
    const ErrorComponents by_clinic = noise.of(0.4, 0.3);
    for (std::size_t axis = 0; axis < needed.size(); ++axis) session.used[axis] = *needed[axis] + by_clinic[axis];
    *session.used[1] += drift_mm * day / 365.0;
  }
  if (with_mistakes) {
    archive.swapped = swap_patient(archive);
    turn_sign(archive, 4, 0);
    turn_sign(archive, archive.swapped + 8, 1);
  }
  for (MadeSession& session : archive.sessions)
    for (auto& value : session.used) value = std::round(*value * 10.0) / 10.0;
  return archive;
}

std::vector<AuditedSession> audited(const MadeArchive& archive) {
  std::vector<AuditedSession> sessions;
  for (std::size_t n = 0; n < archive.sessions.size(); ++n) {
    const auto& [result, used] = archive.sessions[n];
    AuditedSession& session = sessions.emplace_back();
    session.name = MadeArchive::name_of(n);
    session.acquired = result.views.front().acquired;
    session.day = *seconds_at(session.acquired) / 86400.0;
    session.verdict = result.verdict();
    session.identity = result.identity;
    session.setup_error = complete_components(shown_shift(result));
    session.found = found_of(result);
    session.sigma = {0.1, 0.1, 0.1, 0.1, 0.1, 0.1};
    session.used = used;
  }
  return sessions;
}

void write_archive(const MadeArchive& archive, const std::filesystem::path& folder,
                   const std::filesystem::path& table) {
  std::string csv = used_shifts_header() + "\n";
  for (std::size_t n = 0; n < archive.sessions.size(); ++n) {
    const std::filesystem::path place = folder / MadeArchive::name_of(n);
    std::filesystem::create_directories(place);
    write_result(archive.sessions[n].result, place);
    csv += MadeArchive::name_of(n);
    for (const auto& value : archive.sessions[n].used) csv += value ? fmt::format(",{:.1f}", *value) : ",";
    csv += "\n";
  }
  write_text(table, csv);
}

}  // namespace isoshift
