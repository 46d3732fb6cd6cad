#pragma once

#include <string>

namespace isoshift {

// The user of this process, as the operating system knows it.
struct SystemUser {
  std::string name;       // of the account; its number where it has no name
  std::string sudo_user;  // the user who became that account by sudo; empty: none
};

SystemUser system_user();

}  // namespace isoshift
