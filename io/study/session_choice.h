#pragma once
// Which of several sessions of X-rays in one folder a person means.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/study/session_files.h"
#include "io/study/study_files.h"

namespace isoshift {

// A line for each session: its name, when it was taken, its fraction where the X-rays say it, and their labels.
std::vector<std::string> described(std::span<const SessionFiles> sessions);

// FractionNumber of its X-rays; nothing where one lacks it, or they differ.
std::optional<int> fraction_of(const SessionFiles& session);

// The session that is meant. Throws Error that lists the sessions if none or several fit, if a fraction is asked for
// that no session has while some do not tell theirs, and if the latest is asked for and X-rays were taken after `now_s`
// (seconds since 1970 UTC).
SessionFiles chosen_session(const SessionChoice& choice, const std::vector<SessionFiles>& sessions, double now_s);

}  // namespace isoshift
