#pragma once
// The release of a session, and what is sent because of it.

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace isoshift {

// Who releases a session: the name given, the user of the system, and the user who became that user by sudo.
struct Releaser {
  std::string by, user, sudo_user;  // sudo_user: empty without sudo
  bool is_person = true;            // false: the site's rule; it releases only what was accepted, and only once
  bool despite_objection = false;   // a person knows what other X-rays say against the result
};

// "J. Doe (user isoshift, sudo of jdoe)".
std::string to_string(const Releaser& releaser);

struct Release {
  struct Object {
    std::string file;  // of the session's folder
    std::string sha256;
  };
  std::string session;
  Releaser releaser;
  std::string on;  // local time
  std::string verdict;
  std::string record;     // SHA-256 of the session's record at the time of the release
  std::string despite;    // what other X-rays say against the result; empty: nothing
  bool is_again = false;  // the audit log has an earlier release of the session, whose file is gone
  std::vector<Object> objects;
  std::vector<std::string> peers;
};

struct Delivery {
  std::string session, peer;
  Release::Object object;
};

// Every object of a release to every peer.
std::vector<Delivery> deliveries_of(const Release& release);

// What the file of a release and its line in the audit log both say.
nlohmann::ordered_json json_of(const Release& release);
// From the file. Throws nlohmann::json::exception for anything else.
Release release_from(const nlohmann::json& json);

}  // namespace isoshift
