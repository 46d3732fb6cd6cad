#include "io/study/session_choice.h"

#include <dcmtk/dcmdata/dcdeftag.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <ranges>

#include "base/error.h"
#include "base/option_name.h"
#include "io/dicom/dicom_dataset.h"

namespace isoshift {
namespace {

// Whether an X-ray of the session was taken on that day, "2026-03-01": sessions may go on after midnight.
bool is_of_day(const SessionFiles& session, const std::string& day) {
  return std::ranges::any_of(session.images, [&](const auto& image) { return image.acquired.starts_with(day); });
}

std::string as_asked(const SessionChoice& choice) {
  std::vector<std::string> words;
  if (!choice.name.empty()) words.push_back("named " + choice.name);
  if (!choice.date.empty()) words.push_back("of " + choice.date);
  if (choice.fraction) words.push_back(fmt::format("of fraction {}", *choice.fraction));
  return fmt::format("{}", fmt::join(words, ", "));
}

}  // namespace

std::optional<int> fraction_of(const SessionFiles& session) {
  const auto fraction = session.images.front().fraction;
  const bool is_common =
      std::ranges::all_of(session.images, [&](const auto& image) { return image.fraction == fraction; });
  return is_common ? fraction : std::nullopt;
}

std::vector<std::string> described(std::span<const SessionFiles> sessions) {
  std::vector<std::string> lines;
  for (const SessionFiles& session : sessions) {
    const auto labels = session.images | std::views::transform([](const auto& image) {
                          return image.label.empty() ? image.file.filename().string() : image.label;
                        });
    const std::string& acquired = session.images.front().acquired;
    const auto fraction = fraction_of(session);
    lines.push_back(fmt::format("session {}: {}{}, {}", session.name, acquired.empty() ? "time unknown" : acquired,
                                fraction ? fmt::format(", fraction {}", *fraction) : "", fmt::join(labels, ", ")));
  }
  return lines;
}

SessionFiles chosen_session(const SessionChoice& choice, const std::vector<SessionFiles>& sessions, double now_s) {
  const auto fail = [&](const std::string& what) {
    throw Error(fmt::format("{}. The sessions are:\n       {}", what, fmt::join(described(sessions), "\n       ")));
  };
  std::vector<SessionFiles> fitting;
  std::string unnumbered;  // an X-ray of a session that may be of any fraction
  const auto has_fraction = [&](const StudyFiles::Image& image) { return image.fraction == choice.fraction; };
  for (const SessionFiles& session : sessions) {
    if (!session.name.starts_with(choice.name)) continue;
    if (!choice.date.empty() && !is_of_day(session, choice.date)) continue;
    if (choice.fraction && !fraction_of(session)) unnumbered = session.images.front().file.string();
    if (choice.fraction && !fraction_of(session) && std::ranges::any_of(session.images, has_fraction))
      fail(
          fmt::format("{}: is of a session in which only some X-rays are of fraction {}, so that it is not known which "
                      "session is meant. Name it: {}",
                      unnumbered, *choice.fraction, option("session", "NAME")));
    if (choice.fraction && fraction_of(session) != choice.fraction) continue;
    fitting.push_back(session);
  }
  if (fitting.empty() && !unnumbered.empty())
    fail(fmt::format("{}: {} is missing or differs within the session, so that its fraction is not known", unnumbered,
                     isoshift::described(DCM_FractionNumber)));
  if (fitting.empty()) fail(fmt::format("there is no session {}", as_asked(choice)));
  if (!choice.is_latest && fitting.size() > 1)
    fail(fmt::format("{} sessions are {}", fitting.size(), as_asked(choice)));
  for (const SessionFiles& session : fitting)
    if (patient_id_of(session.patient) != patient_id_of(fitting.front().patient) ||
        !may_be_of_one_issuer(session.patient, fitting.front().patient))
      fail("the sessions that fit are of several patients");
  if (choice.is_latest)
    for (const SessionFiles& session : fitting)
      for (const StudyFiles::Image& image : session.images)
        if (image.at_s && *image.at_s > now_s + StudyFiles::kLargestUtcOffsetS)
          fail(fmt::format(
              "{}: was taken at {}, in the future: a clock is wrong, and it is not known which session is the "
              "latest. Name it: {}",
              image.file.string(), image.acquired, option("session", "NAME")));
  const auto newest = [](const SessionFiles& session) -> const StudyFiles::Image& { return session.images.back(); };
  for (const SessionFiles& session : fitting)
    for (const SessionFiles& other : fitting)
      if (&session != &other &&
          (!tells_which_is_first(newest(session), newest(other)) || newest(session).at_s == newest(other).at_s))
        fail(fmt::format("{} and {}: their times do not tell which was taken later", newest(session).file.string(),
                         newest(other).file.string()));
  return *std::ranges::max_element(fitting, {}, [&](const SessionFiles& session) { return newest(session).at_s; });
}

}  // namespace isoshift
