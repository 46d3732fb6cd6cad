#pragma once
// From a study and what registration found to its result.

#include <filesystem>
#include <optional>
#include <string>

#include "io/config/site_file.h"
#include "io/study/study.h"
#include "registration/register_views.h"
#include "setup/setup_result.h"
#include "workflow/register/registration_setup.h"

namespace isoshift {

// The file of --site; nothing where none is named.
std::optional<SiteFile> named_site(const std::filesystem::path& file);

// --site FILE and --anatomy NAME: the site's decisions about results of this anatomy ("" for its default); `before`
// where no file is named, whose anatomy also holds where none is. Throws UsageError for an anatomy the site does not
// know, and for one without a file.
std::optional<SiteRules> chosen_site(const std::optional<SiteFile>& file, const std::string& anatomy,
                                     std::optional<SiteRules> before = std::nullopt);

// All but notes, times of loading and what is written; with the pictures of the views, rendered anew.
SetupResult setup_result_of(const Study& study, const RegistrationRequest& request, const RegistrationSetup& setup,
                            RegistrationResult found);

}  // namespace isoshift
