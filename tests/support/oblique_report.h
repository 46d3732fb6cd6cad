#pragma once
// A result to report, without a registration.

#include <string>

#include "setup/setup_result.h"

namespace isoshift {

// A view of another size than its picture.
SetupResult::View view_with_picture(const std::string& label);

// head-oblique at its truth, the worked example of docs/conventions.md.
SetupResult oblique_report(Verdict verdict);

// The worked example in a patient who has bent: the spine toward the feet lies off, the one toward the head is turned.
SetupResult bent_report(Verdict verdict);

// A site with a couch of four degrees of freedom.
SiteRules small_couch();

}  // namespace isoshift
