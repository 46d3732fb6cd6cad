#pragma once
// From a study and what registration found to the report of it.

#include <string>

#include "cli/registration_setup.h"
#include "io/report/setup_report.h"
#include "io/site_file.h"
#include "io/study.h"
#include "registration/register_views.h"

namespace isoshift {

// The site's decisions about results of this anatomy ("" for its default). Throws UsageError for one the site does not
// know.
SetupReport::Site site_in_report(const SiteFile& site, const std::string& anatomy);

// All but notes, times of loading and what is written; with the pictures of the views, rendered anew.
SetupReport setup_report_of(const Study& study, const RegistrationFlags& flags, const RegistrationSetup& setup,
                            const RegistrationResult& result);

}  // namespace isoshift
