#pragma once
// Whether the numbers of a registration can be trusted. Registration finds the verdict, every output shows it, and the
// exit status depends on it.

#include <string_view>

namespace isoshift {

enum class Verdict { kAccepted, kReview, kRejected };

constexpr std::string_view to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::kAccepted: return "accepted";
    case Verdict::kReview: return "review";
    case Verdict::kRejected: return "rejected";
  }
  return "";
}

}  // namespace isoshift
