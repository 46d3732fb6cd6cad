#pragma once

#include <string>

namespace isoshift {

// The user of this process, as the operating system knows it.
struct SystemUser {
  std::string name;       // of the account; its number where it has no name
  std::string sudo_user;  // the user who logged in and became that account, by sudo; empty: none
};

// The user who logged in is the one whom the kernel keeps (/proc/self/loginuid): the environment cannot change it.
// Where the kernel knows nobody, as in a container, it is SUDO_USER.
SystemUser system_user();

}  // namespace isoshift
