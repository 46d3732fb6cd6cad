#include "workflow/register/serve_registrations.h"

#include <signal.h>
#include <sys/prctl.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <new>
#include <thread>

#include "base/error.h"
#include "workflow/register/registration_messages.h"

namespace isoshift {
namespace {

using OptionsFrom = std::function<RegisterOptions(const std::vector<std::string>& flags)>;

RegistrationMessage answer_to(const std::string& line, const OptionsFrom& options_from, SharedWork& shared) {
  try {
    const RegistrationOrder order = registration_order_from(line, "the order of the parent");
    RegisterOptions options = options_from(order.flags);
    options.study.parts = order.parts;
    options.output = order.output;
    if (!order.site.empty()) options.site = order.site;
    if (!order.anatomy.empty()) options.anatomy = order.anatomy;
    const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
    const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                      std::max(1U, cores / static_cast<unsigned>(order.at_a_time)));
    Observer nobody;  // all is in the result
    return Ended{register_study(options, shared, nobody).verdict};
  } catch (const WriteError& error) {
    return Failed{.why = error.what(), .is_of_disk = true};
  } catch (const std::bad_alloc&) {
    return Failed{.why = "out of memory"};
  } catch (const std::exception& error) {
    return Failed{.why = error.what()};
  }
}

}  // namespace

void serve_registrations(Channel& parent, const OptionsFrom& options_from) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // nobody would be told of what it does any more
  SharedWork shared;
  bool is_heard = parent.send(to_line(Ready()));
  while (is_heard) {
    const std::optional<std::string> line = parent.line();
    if (!line) return;
    is_heard = parent.send(to_line(answer_to(*line, options_from, shared)));
  }
}

}  // namespace isoshift
