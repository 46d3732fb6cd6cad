#pragma once
// Passwords of the system's users, by PAM.

#include <string>

namespace isoshift {

// Whether this is the user's password, and the account may be used now, by the rules in /etc/pam.d/SERVICE. May take
// seconds: PAM lets those wait who guess.
bool is_password_of(const std::string& service, const std::string& user, const std::string& password);

}  // namespace isoshift
