#include "workflow/room/release.h"

#include <fmt/format.h>

namespace isoshift {

using Json = nlohmann::ordered_json;

std::string to_string(const Releaser& releaser) {
  return fmt::format("{} (user {}{})", releaser.by, releaser.user,
                     releaser.sudo_user.empty() ? "" : ", sudo of " + releaser.sudo_user);
}

std::vector<Delivery> deliveries_of(const Release& release) {
  std::vector<Delivery> all;
  for (const std::string& peer : release.peers)
    for (const Release::Object& object : release.objects)
      all.push_back({.session = release.session, .peer = peer, .object = object});
  return all;
}

Json json_of(const Release& release) {
  Json objects = Json::array();
  for (const Release::Object& object : release.objects)
    objects.push_back({{"file", object.file}, {"sha256", object.sha256}});
  Json json = {{"session", release.session}, {"by", release.releaser.by}, {"user", release.releaser.user}};
  if (!release.releaser.sudo_user.empty()) json["sudo_user"] = release.releaser.sudo_user;
  json.update(
      {{"verdict", release.verdict}, {"record", release.record}, {"objects", objects}, {"peers", release.peers}});
  return json;
}

Release release_from(const nlohmann::json& json) {
  Release release{.session = json.at("session"),
                  .releaser = {.by = json.at("by"), .user = json.at("user"), .sudo_user = json.value("sudo_user", "")},
                  .on = json.at("on"),
                  .verdict = json.at("verdict"),
                  .record = json.at("record"),
                  .despite = json.value("despite", ""),
                  .objects = {},
                  .peers = json.at("peers")};
  for (const auto& object : json.at("objects")) release.objects.push_back({object.at("file"), object.at("sha256")});
  return release;
}

}  // namespace isoshift
