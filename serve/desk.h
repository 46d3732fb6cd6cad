#pragma once
// The sessions that people look at closely or register by hand on the room's screen. The study of a session is read in
// the background, and stays in memory while people work on it.

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "serve/http_message.h"
#include "serve/room.h"
#include "serve/sign_ins.h"
#include "workflow/register/register_study.h"

namespace isoshift {

// May be called from several threads.
class Desk {
 public:
  // Flags of isoshift register as its options.
  using OptionsFrom = std::function<RegisterOptions(const std::vector<std::string>& flags)>;

  Desk(Room& room, const Clock& clock, OptionsFrom options_from);
  ~Desk();

  // `what`: as of ManualScreen::answer(), or
  //
  //   POST hand-over   hands the last result, whose folder it names, to the engine, which makes a session of it
  //
  // Status 503 while the study is being read: ask again. It is read again when a page is loaded (GET study) after the
  // X-rays got another result, or other files or a choice of a person behind them.
  HttpResponse answer(const HttpRequest& request, const SignedIn& who, const std::string& session,
                      const std::string& what);

 private:
  class Place;
  std::shared_ptr<Place> place_of(const std::string& session);
  std::shared_ptr<Place> known_place_of(const std::string& session);  // null: there is none
  void forget(const std::string& session);
  void make_room();
  HttpResponse hand_over(Place& place, const HttpRequest& request, const SignedIn& who);

  Room& room_;
  const Clock& clock_;
  OptionsFrom options_from_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Place>> places_;  // by the name of their X-rays
};

}  // namespace isoshift
