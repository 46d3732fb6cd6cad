#include "cli/switches/registration_switches.h"

#include "cli/switches/region_switches.h"
#include "cli/switches/rendering_switches.h"
#include "cli/switches/search_switches.h"

namespace isoshift {

void add_registration_switches(CLI::App& command, RegistrationRequest& request) {
  add_search_switches(command, request.search);
  add_region_switches(command, request.region);
  add_rendering_options(command, request.rendering);
}

}  // namespace isoshift
