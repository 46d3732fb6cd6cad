#include "setup/registration.h"

#include <algorithm>
#include <numeric>

namespace isoshift {

int ViewConsistency::with_signal() const {
  return static_cast<int>(std::ranges::count_if(parts, &ViewPart::has_signal));
}

int ViewConsistency::disagreeing() const {
  return static_cast<int>(std::ranges::count_if(parts, &ViewPart::disagrees));
}

const char* to_string(IrradiatedField::Origin origin) {
  switch (origin) {
    case IrradiatedField::Origin::kWholeReceptor: return "whole receptor";
    case IrradiatedField::Origin::kFound: return "found";
    case IrradiatedField::Origin::kDeclared: return "declared";
    case IrradiatedField::Origin::kDrawn: return "drawn";
  }
  return "";
}

bool BodyMotion::is_determined() const {
  constexpr double kMostSigmaMm = 2.0, kLeastShare = 0.1;
  return (sigma_mm.array() <= kMostSigmaMm).all() && image_share >= kLeastShare;
}

void Registration::demote(Verdict to, std::string reason) {
  verdict = std::max(verdict, to);
  reasons.push_back(std::move(reason));
}

int Registration::evaluations() const {
  return std::accumulate(stages.begin(), stages.end(), 0,
                         [](int sum, const StageReport& stage) { return sum + stage.evaluations; });
}

}  // namespace isoshift
