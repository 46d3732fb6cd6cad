#pragma once
// Builds the result of a study from what registration found.

#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "io/config/site_file.h"
#include "io/study/study.h"
#include "registration/register_views.h"
#include "setup/setup_result.h"
#include "workflow/register/registration_setup.h"

namespace isoshift {

// The site file of --site; nothing if the user names none.
std::optional<SiteFile> named_site(const std::filesystem::path& file);

// How far X-rays of one setup may be apart in time (s), where no read-outs tell that the table stood still.
double max_span_s_of(const std::optional<SiteFile>& site);

// The site's decisions about results of this anatomy, by --site FILE and --anatomy NAME. Without a site file returns
// `before`. Without an anatomy ("") takes the anatomy of `before`, or else the site's default. Throws UsageError for an
// anatomy that the site file does not have, and for an anatomy without a site file.
std::optional<SiteRules> chosen_site(const std::optional<SiteFile>& file, const std::string& anatomy,
                                     std::optional<SiteRules> before = std::nullopt);

// Radiation Machine Name; empty: unknown.
std::string radiation_machine(const RtImage& image);

// The result without notes, loading times and written files. `images`: the prepared X-rays that were registered. The
// DRRs in the pictures of the views are rendered anew.
SetupResult setup_result_of(const Study& study, std::span<const FixedImage> images, const RegistrationRequest& request,
                            const RegistrationSetup& setup, Target target, RegistrationResult found);

}  // namespace isoshift
