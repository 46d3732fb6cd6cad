#pragma once
// One study on the screen of the person at this computer: the page for registration by hand, and nothing else.

#include "serve/manual_screen.h"
#include "serve/sign_ins.h"

namespace isoshift {

class ViewScreen {
 public:
  // `user` comes in by the address /open/WORD, once: the word is the user's password in `sign_ins`.
  ViewScreen(ManualScreen& manual, SignIns& sign_ins, std::string user)
      : manual_(manual), sign_ins_(sign_ins), user_(std::move(user)) {}

  // May be called from several threads.
  HttpResponse answer(const HttpRequest& request);

 private:
  HttpResponse open(const HttpRequest& request, const std::string& word);

  ManualScreen& manual_;
  SignIns& sign_ins_;
  std::string user_;
};

}  // namespace isoshift
