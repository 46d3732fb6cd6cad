#pragma once

#include <string>

namespace isoshift {

// Whom the operating system takes for the user of this process.
struct SystemUser {
  std::string name;       // of the account; its number where it has no name
  std::string sudo_user;  // who became that account by sudo; empty: nobody
};

SystemUser system_user();

}  // namespace isoshift
