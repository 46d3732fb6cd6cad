#include "serve/desk.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <optional>
#include <thread>

#include "base/error.h"
#include "serve/answers.h"
#include "serve/manual_screen.h"
#include "workflow/manual/live_study.h"
#include "workflow/manual/manual_registration.h"

namespace isoshift {
namespace {

constexpr std::size_t kMost = 3;  // studies in memory: each needs some hundred megabytes

}  // namespace

// One session: its study, once it has been read, and what is registered from there.
class Desk::Place : private Observer {
 public:
  Place(ManualBasis basis, StudyOptions options, const std::filesystem::path& results, const Eigen::Isometry3d& start,
        Clock::Time now)
      : used(now),
        basis_(std::move(basis)),
        registration_(basis_.order, results),
        reading_([this, options = std::move(options), start] { read(options, start); }) {}

  const ManualBasis& basis() const { return basis_; }
  bool is_registering() { return registration_.state().what == ManualRegistration::State::What::kRuns; }
  bool is_busy() { return !is_read_ || is_registering(); }
  // Null while the study is being read. Throws Error if it could not be read.
  ManualScreen* screen() {
    if (!is_read_) return nullptr;
    if (!screen_) throw Error(failure_);
    return &*screen_;
  }
  bool has_failed() const { return is_read_ && !screen_; }
  std::string step() {
    const std::lock_guard lock(mutex_);
    return step_;
  }
  ManualRegistration& registration() { return registration_; }

  Clock::Time used;  // guarded by the desk

 private:
  void read(const StudyOptions& options, const Eigen::Isometry3d& start) {
    try {
      Observer& observer = *this;
      study_.emplace(options, observer);
      screen_.emplace(*study_, registration_, start);
    } catch (const std::exception& error) {
      failure_ = error.what();
    }
    is_read_ = true;
  }
  void progress(std::string_view step, double share) override {
    const std::lock_guard lock(mutex_);
    step_ = fmt::format("{}: {:.0f} %", step, 100.0 * share);
  }

  const ManualBasis basis_;
  ManualRegistration registration_;
  std::optional<LiveStudy> study_;
  std::optional<ManualScreen> screen_;
  std::string failure_;
  std::atomic<bool> is_read_ = false;  // from then on the three above do not change
  std::mutex mutex_;
  std::string step_;
  std::jthread reading_;  // the last member: it uses the others
};

Desk::Desk(Room& room, const Clock& clock, OptionsFrom options_from)
    : room_(room), clock_(clock), options_from_(std::move(options_from)) {}
Desk::~Desk() = default;

// Who has not been used for the longest time leaves.
void Desk::make_room() {
  if (places_.size() < kMost) return;
  auto oldest = places_.end();
  for (auto place = places_.begin(); place != places_.end(); ++place)
    if (!place->second->is_busy() && (oldest == places_.end() || place->second->used < oldest->second->used))
      oldest = place;
  if (oldest == places_.end())
    throw Error(fmt::format("{} sessions are being registered by hand. Try again when one of them has ended.", kMost));
  places_.erase(oldest);
}

std::shared_ptr<Desk::Place> Desk::known_place_of(const std::string& session) {
  const std::lock_guard lock(mutex_);
  const auto found = places_.find(name_of_xrays(session));
  return found == places_.end() ? nullptr : found->second;
}

void Desk::forget(const std::string& session) {
  const std::lock_guard lock(mutex_);
  places_.erase(name_of_xrays(session));
}

std::shared_ptr<Desk::Place> Desk::place_of(const std::string& session) {
  const std::lock_guard lock(mutex_);
  const std::string xrays = name_of_xrays(session);
  if (const auto found = places_.find(xrays); found != places_.end()) {
    found->second->used = clock_.now();
    return found->second;
  }
  const ManualBasis basis = room_.manual_basis(session);
  StudyOptions options = options_from_(basis.order.flags).study;
  options.parts = basis.order.parts;
  make_room();
  return places_[xrays] =
             std::make_shared<Place>(basis, options, room_.by_hand(session), room_.setup_error(session), clock_.now());
}

HttpResponse Desk::answer(const HttpRequest& request, const SignedIn& who, const std::string& session,
                          const std::string& what) {
  if (!room_.is_there(session)) {  // it may have been deleted
    forget(session);
    throw NotThere(fmt::format("there is no session {}", session));
  }
  const bool is_loaded = request.method == "GET" && what == "study",
             is_begun = request.method == "POST" && what == "begin";
  if (const auto known = is_loaded || is_begun ? known_place_of(session) : nullptr;
      known && room_.manual_basis(session) != known->basis()) {
    if (is_begun)
      return refusal(409,
                     "The X-rays have another result, or are registered in another way, since this page "
                     "was loaded. Load it again.");
    if (known->is_registering())
      return refusal(503, "A registration by hand of what was there before still runs. Wait for its end.");
    forget(session);
  }
  const std::shared_ptr<Place> place = place_of(session);
  if (place->has_failed()) forget(session);  // once: the next request reads again
  ManualScreen* screen = place->screen();
  if (screen == nullptr) return refusal(503, "The study is being read. " + place->step());
  if (request.method == "POST" && what == "hand-over") return hand_over(*place, request, who);
  HttpResponse answer = screen->answer(request, who, what);
  if (request.method == "GET" && what == "study")
    room_.audit(who.roles.contains(Role::kRegister) ? "opened by hand" : "viewed", who.user, session);
  return answer;
}

HttpResponse Desk::hand_over(Place& place, const HttpRequest& request, const SignedIn& who) {
  if (!who.roles.contains(Role::kRegister)) return refusal(403, fmt::format("{} may not register.", who.user));
  const ManualRegistration::State now = place.registration().state();
  if (now.what != ManualRegistration::State::What::kEnded) return refusal(409, "There is no result to hand over.");
  if (!has_type_json(request)) return refusal(415, "JSON is expected.");
  const auto body = nlohmann::json::parse(request.body, nullptr, false);
  if (!body.is_object() || body.value("folder", nlohmann::json()) != now.result.string())
    return refusal(
        409, fmt::format("{} has made another result of this session since. Look at that, or register again.", now.by));
  const std::string name = room_.hand_over(place.basis(), {.folder = now.result, .files = now.files}, who.user);
  place.registration().forget();
  return json_answer({{"session", name}});
}

}  // namespace isoshift
