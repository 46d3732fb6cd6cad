#include "workflow/register/serve_registrations.h"

#include <signal.h>
#include <sys/prctl.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <new>
#include <thread>

#include "base/error.h"
#include "base/sha256.h"
#include "workflow/register/registration_messages.h"

namespace isoshift {
namespace {

using OptionsFrom = std::function<RegisterOptions(const std::vector<std::string>& flags)>;

// Tells the parent how far a registration is, a few times a second.
class ProgressTeller : public Observer {
 public:
  explicit ProgressTeller(Channel& parent) : parent_(parent) {}

  void progress(std::string_view step, double share) override {
    constexpr std::chrono::milliseconds kPause(100);
    const auto now = std::chrono::steady_clock::now();
    if (step == step_ && now < next_) return;
    step_ = step;
    next_ = now + kPause;
    parent_.send(to_line(RegistrationMessage(Progressed{.step = step_, .share = share})));
  }

 private:
  Channel& parent_;
  std::string step_;
  std::chrono::steady_clock::time_point next_;
};

RegistrationMessage answer_to(const std::string& line, const OptionsFrom& options_from, SharedWork& shared,
                              Channel& parent) {
  try {
    const RegistrationOrder order = registration_order_from(line, "the order of the parent");
    RegisterOptions options = options_from(order.flags);
    options.study.parts = order.parts;
    options.start = order.start;
    options.registration.search.is_searched = order.is_searched;
    options.output = order.output;
    options.registration.rendering.take_gpu_of(order.worker);
    if (!order.site.empty()) options.site = order.site;
    if (!order.anatomy.empty()) options.anatomy = order.anatomy;
    const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
    const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                      std::max(1U, cores / static_cast<unsigned>(order.at_a_time)));
    Observer nobody;  // all is in the result
    ProgressTeller teller(parent);
    const Verdict verdict = register_study(options, shared, order.tells_progress ? teller : nobody).verdict();
    return Ended{.verdict = verdict, .files = sha256_of_folder(order.output)};
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
    is_heard = parent.send(to_line(answer_to(*line, options_from, shared, parent)));
  }
}

}  // namespace isoshift
