#include "base/system_user.h"

#include <fmt/format.h>
#include <pwd.h>
#include <unistd.h>

#include <cstdlib>

namespace isoshift {

SystemUser system_user() {
  const passwd* account = ::getpwuid(::geteuid());
  const char* sudo_user = std::getenv("SUDO_USER");
  return {.name = account != nullptr ? account->pw_name : fmt::format("{}", ::geteuid()),
          .sudo_user = sudo_user != nullptr ? sudo_user : ""};
}

}  // namespace isoshift
