#include "base/system_user.h"

#include <fmt/format.h>
#include <pwd.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <optional>

namespace isoshift {
namespace {

std::string name_of(uid_t id) {
  const passwd* account = ::getpwuid(id);
  return account != nullptr ? account->pw_name : fmt::format("{}", id);
}

// Nothing where nobody logged in, or the kernel does not keep who did.
std::optional<uid_t> login_id() {
  constexpr auto kNobody = static_cast<uid_t>(-1);
  uid_t id = kNobody;
  if (!(std::ifstream("/proc/self/loginuid") >> id) || id == kNobody) return std::nullopt;
  return id;
}

}  // namespace

SystemUser system_user() {
  SystemUser user{.name = name_of(::geteuid()), .sudo_user = ""};
  const char* sudo_user = std::getenv("SUDO_USER");
  if (const auto login = login_id())
    user.sudo_user = *login == ::geteuid() ? "" : name_of(*login);
  else if (sudo_user != nullptr)
    user.sudo_user = sudo_user;
  return user;
}

}  // namespace isoshift
