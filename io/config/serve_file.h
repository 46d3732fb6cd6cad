#pragma once
// Where isoshift room serve listens, who may use it, and whose results it shows: a JSON file (docs/commands/serve.md).

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "io/config/watch_file.h"

namespace isoshift {

enum class Role { kView, kRegister, kRelease };
inline constexpr std::array kRoles = {Role::kView, Role::kRegister, Role::kRelease};
std::string_view to_string(Role role);

struct ServeFile {
  struct Tls {
    std::filesystem::path certificate, key;  // PEM
  };
  // A reverse proxy that signs users in, in the hospital's way, and names them in a header of every request.
  struct Proxy {
    std::string header;  // that names the user, in lower case: "x-remote-user"
    std::string secret;  // that the proxy alone knows, and sends as X-Isoshift-Proxy
  };

  std::filesystem::path path;
  WatchFile watch;
  std::string address = "127.0.0.1";
  std::uint16_t port = 8443;
  std::optional<Tls> tls;                       // unset: only this computer is listened to
  std::string pam_service;                      // signs users in by PAM; empty: the proxy does
  std::optional<Proxy> proxy;                   // unset: PAM does
  std::map<std::string, std::set<Role>> roles;  // by user. Who has no role may not come in
};

// Paths are relative to the file's folder. Throws Error naming the file, the place in it and what is expected there.
ServeFile read_serve_file(const std::filesystem::path& path);

}  // namespace isoshift
