#include "io/config/serve_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "base/error.h"
#include "base/secret_file.h"
#include "io/config/config_folder.h"

namespace isoshift {
namespace {

// Addresses of this computer alone.
bool is_loopback(const std::string& address) { return address.starts_with("127.") || address == "::1"; }

ServeFile::Proxy proxy_from(JsonSection section, const ConfigFolder& folder) {
  ServeFile::Proxy proxy{.header = ConfigFolder::text(section, "header", "the name of the header with the user"),
                         .secret = secret_line(folder.file(section, "secret_file"))};
  std::ranges::transform(proxy.header, proxy.header.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  section.end();
  return proxy;
}

std::set<Role> roles_from(const nlohmann::json& json, JsonSection& section, const std::string& user) {
  constexpr const char* kExpected = "a list of \"view\", \"register\" and \"release\"";
  std::set<Role> roles;
  if (!json.is_array()) section.refuse(user.c_str(), kExpected);
  for (const nlohmann::json& word : json) {
    const auto* role = std::ranges::find_if(kRoles, [&](Role one) { return word == to_string(one); });
    if (role == kRoles.end()) section.refuse(user.c_str(), kExpected);
    roles.insert(*role);
  }
  if (!roles.contains(Role::kView)) section.refuse(user.c_str(), "\"view\" among its roles");
  return roles;
}

}  // namespace

std::string_view to_string(Role role) {
  switch (role) {
    case Role::kView: return "view";
    case Role::kRegister: return "register";
    case Role::kRelease: return "release";
  }
  return "";
}

ServeFile read_serve_file(const std::filesystem::path& path) {
  const JsonFile json = read_json_file(path);
  JsonSection section(json.json, path.string());
  const ConfigFolder folder(path);
  constexpr const char* kVersion = "1, the version of its format";
  if (section.required<int>("serve_file", kVersion) != 1) section.refuse("serve_file", kVersion);
  ServeFile serve{.path = path, .watch = read_watch_file(folder.file(section, "watch"))};
  constexpr const char* kAddress = "an IP address of this computer";
  if (section.find<std::string>("address", kAddress)) serve.address = ConfigFolder::text(section, "address", kAddress);
  constexpr const char* kPort = "0 to 65535; 0: any that is free";
  const int port = section.find<int>("port", kPort).value_or(serve.port);
  if (port < 0 || port > 65535) section.refuse("port", kPort);
  serve.port = static_cast<std::uint16_t>(port);
  if (auto tls = section.section("tls")) {
    serve.tls = {.certificate = folder.file(*tls, "certificate"), .key = folder.file(*tls, "key")};
    (void)open_secret(serve.tls->key);
    tls->end();
  } else if (!is_loopback(serve.address)) {
    section.refuse_missing("tls", "{\"certificate\": FILE, \"key\": FILE}, since address is not 127.0.0.1 or ::1");
  }
  if (auto proxy = section.section("proxy")) serve.proxy = proxy_from(std::move(*proxy), folder);
  constexpr const char* kPam = "the name of a PAM service: a file in /etc/pam.d";
  if (section.find<std::string>("pam_service", kPam))
    serve.pam_service = ConfigFolder::text(section, "pam_service", kPam);
  if (serve.proxy.has_value() == !serve.pam_service.empty())
    throw Error(fmt::format("{}: pam_service and proxy: expected one of them", path.string()));
  auto roles = section.section("roles");
  if (!roles) section.refuse_missing("roles", "{\"USER\": [\"view\", \"register\", \"release\"], ...}");
  for (const auto& [user, list] : json.json.at("roles").items()) {
    (void)roles->find<nlohmann::json>(user.c_str(), "");
    serve.roles[user] = roles_from(list, *roles, user);
  }
  roles->end();
  section.end();
  return serve;
}

}  // namespace isoshift
