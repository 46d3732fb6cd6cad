#pragma once

#include <optional>
#include <string>

namespace isoshift {

// Now, "2026-03-01T10:16:02+0100".
std::string local_time();

// Such a time as seconds since 1970-01-01 00:00:00 UTC; nothing for another text.
std::optional<double> utc_seconds_at(const std::string& local_time);

// A time of the form "2026-03-01 10:15:00" as seconds since 1970-01-01 00:00:00 of the same clock; nothing for another
// text.
std::optional<double> seconds_at(const std::string& time);

}  // namespace isoshift
