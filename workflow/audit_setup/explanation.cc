#include "workflow/audit_setup/explanation.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <utility>

namespace isoshift {
namespace {

struct Mistake {
  std::string words;
  CouchAxes would_be_used;
  double misfit = 0.0;  // sum of squares over the axes, in standard deviations
};

// The shift that the other sessions let expect: what was found, and by how much used shifts differ from that.
CouchAxes expected_shift(const AuditedSession& session, const CouchAxes& level) {
  CouchAxes expected;
  for (std::size_t axis = 0; axis < expected.size(); ++axis)
    if (session.found[axis] && level[axis]) expected[axis] = *session.found[axis] + *level[axis];
  return expected;
}

std::vector<Mistake> mistakes_with(const CouchAxes& expected) {
  std::vector<Mistake> mistakes;
  const auto add = [&](std::string words, const CouchAxes& would_be_used) {
    mistakes.push_back({.words = std::move(words), .would_be_used = would_be_used});
  };
  // The expected shift with some axes multiplied.
  const auto times = [&](double factor, std::initializer_list<std::size_t> axes) {
    CouchAxes changed = expected;
    for (const std::size_t axis : axes)
      if (changed[axis]) *changed[axis] *= factor;
    return changed;
  };
  add("the shift was not applied", times(0.0, {0, 1, 2, 3, 4, 5}));
  add("all signs are wrong: the shift was applied backwards", times(-1.0, {0, 1, 2, 3, 4, 5}));
  for (std::size_t axis = 0; axis < expected.size(); ++axis) {
    add(fmt::format("wrong sign of {}", kCouchAxes[axis]), times(-1.0, {axis}));
    add(fmt::format("{} was not applied", kCouchAxes[axis]), times(0.0, {axis}));
  }
  using Axes = std::pair<std::size_t, std::size_t>;
  for (const auto& [one, other] : {Axes(0, 1), Axes(0, 2), Axes(1, 2), Axes(3, 4), Axes(3, 5), Axes(4, 5)}) {
    CouchAxes exchanged = expected;
    std::swap(exchanged[one], exchanged[other]);
    add(fmt::format("{} and {} are exchanged", kCouchAxes[one], kCouchAxes[other]), exchanged);
  }
  return mistakes;
}

// Nothing where the mistake does not explain the used shift.
std::optional<double> misfit_of(const CouchAxes& would_be_used, const CouchAxes& used, const CouchAxes& deviation,
                                double threshold) {
  double misfit = 0.0;
  for (std::size_t axis = 0; axis < used.size(); ++axis) {
    if (!used[axis] || !deviation[axis]) continue;  // not compared
    if (!would_be_used[axis]) return std::nullopt;
    const double off = std::abs(*used[axis] - *would_be_used[axis]) / *deviation[axis];
    if (off > threshold) return std::nullopt;
    misfit += off * off;
  }
  return misfit;
}

}  // namespace

std::string explanation_of(std::size_t outlier, std::span<const AuditedSession* const> sessions,
                           const DifferencesFound& found) {
  const AuditedSession& session = *sessions[outlier];
  std::vector<Mistake> mistakes = mistakes_with(expected_shift(session, found.level[outlier]));
  for (std::size_t n = 0; n < sessions.size(); ++n) {
    const AuditedSession& other = *sessions[n];
    if (n == outlier || std::floor(other.day) != std::floor(session.day)) continue;
    const bool is_same_patient = patient_key(other.identity) == patient_key(session.identity);
    mistakes.push_back({.words = fmt::format("swapped {}: the used shift is that of session {}, of {} and the same day",
                                             is_same_patient ? "session" : "patient", other.name,
                                             is_same_patient ? "the same patient" : "another patient"),
                        .would_be_used = expected_shift(other, found.level[n])});
  }
  std::vector<Mistake> explaining;
  for (Mistake& mistake : mistakes)
    if (const auto misfit = misfit_of(mistake.would_be_used, session.used, found.deviation[outlier], found.threshold)) {
      mistake.misfit = *misfit;
      explaining.push_back(std::move(mistake));
    }
  if (explaining.empty()) return "no single mistake explains it";
  std::ranges::stable_sort(explaining, {}, &Mistake::misfit);
  const double most = explaining.front().misfit + 2.0 * std::log(20.0);
  std::vector<std::string> words;
  for (const Mistake& mistake : explaining)
    if (mistake.misfit < most) words.push_back(mistake.words);
  return fmt::format("{}", fmt::join(words, "; or: "));
}

}  // namespace isoshift
