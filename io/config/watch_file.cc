#include "io/config/watch_file.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "base/json_file.h"
#include "base/secret_file.h"
#include "io/config/config_folder.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

class Reader : public ConfigFolder {
 public:
  using ConfigFolder::ConfigFolder;

  OrthancServer orthanc(JsonSection section) const {
    constexpr const char* kUrl = "http://HOST:PORT or https://HOST:PORT";
    OrthancServer server{.url = text(section, "url", kUrl)};
    if (!server.url.starts_with("http://") && !server.url.starts_with("https://")) section.refuse("url", kUrl);
    while (server.url.ends_with('/')) server.url.pop_back();
    check_encryption(server.url, section);
    if (const auto user = section.find<std::string>("user", "a name")) {
      server.user = *user;
      server.password = secret_line(file(section, "password_file"));
    }
    if (section.find<std::string>("ca", "the name of a file")) server.ca = file(section, "ca");
    section.end();
    return server;
  }

  DicomPeer peer(JsonSection section) const {
    constexpr const char* kPort = "1 to 65535";
    DicomPeer peer{.name = text(section, "name", "a name"), .host = text(section, "host", "a host")};
    const auto is_allowed = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '-'; };
    if (!std::ranges::all_of(peer.name, is_allowed)) section.refuse("name", "letters, digits, \"_\" and \"-\"");
    const int port = section.required<int>("port", kPort);
    if (port < 1 || port > 65535) section.refuse("port", kPort);
    peer.port = static_cast<std::uint16_t>(port);
    peer.called_aet = aet(section, "called_aet");
    peer.calling_aet = aet(section, "calling_aet");
    constexpr const char* kTls =
        "{\"ca\": FILE, \"certificate\": FILE, \"key\": FILE}, with \"fingerprint\" where the certificate does not "
        "name the host, or false for none";
    const auto tls = section.required<nlohmann::json>("tls", kTls);
    if (tls.is_object()) {
      JsonSection files(tls, section.where() + ": tls");
      peer.tls = {.ca = file(files, "ca"),
                  .certificate = file(files, "certificate"),
                  .key = file(files, "key"),
                  .fingerprint = fingerprint(files)};
      files.end();
    } else if (tls != false) {
      section.refuse("tls", kTls);
    }
    section.end();
    return peer;
  }

 private:
  // Passwords do not belong into URLs, which logs and error messages show. What is read is about patients: it travels
  // without encryption on this computer only, or where the file says so.
  static void check_encryption(const std::string& url, JsonSection& section) {
    const std::size_t begin = url.find("//") + 2;
    const std::string host_and_port = url.substr(begin, url.find('/', begin) - begin);
    if (host_and_port.find('@') != std::string::npos)
      section.refuse("url", "no user and no password in it: they belong into user and password_file");
    constexpr const char* kTls = "false: http without encryption to another computer is wanted";
    const auto tls = section.find<bool>("tls", kTls);
    if (tls.value_or(false)) section.refuse("tls", kTls);
    const std::string host = host_and_port.substr(0, host_and_port.find_last_of(':'));
    const bool is_here = host == "localhost" || host.starts_with("127.") || host == "[::1]";
    if (url.starts_with("http://") && !is_here && !tls)
      section.refuse("url", "https, or \"tls\": false where http without encryption to another computer is wanted");
  }

  std::string aet(JsonSection& section, const char* key) const {
    constexpr const char* kExpected = "an application entity title of at most 16 characters";
    std::string title = text(section, key, kExpected);
    if (title.size() > 16) section.refuse(key, kExpected);
    return title;
  }

  // Of a certificate, as OpenSSL prints it or as its digits alone.
  static std::string fingerprint(JsonSection& section) {
    constexpr const char* kExpected =
        "64 hexadecimal digits, as openssl x509 -noout -fingerprint -sha256 -in CERTIFICATE prints them";
    constexpr std::size_t kDigits = 64;
    const auto text = section.find<std::string>("fingerprint", kExpected);
    if (!text) return "";
    std::string digits;
    for (const unsigned char c : *text)
      if (c != ':') digits += static_cast<char>(std::tolower(c));
    if (digits.size() != kDigits || digits.find_first_not_of("0123456789abcdef") != std::string::npos)
      section.refuse("fingerprint", kExpected);
    return digits;
  }
};

}  // namespace

WatchFile read_watch_file(const fs::path& path) {
  const JsonFile json = read_json_file(path);
  JsonSection section(json.json, path.string());
  const Reader read(path);
  constexpr const char* kVersion = "1, the version of its format";
  if (section.required<int>("watch_file", kVersion) != 1) section.refuse("watch_file", kVersion);
  WatchFile watch{.path = path};
  if (auto orthanc = section.section("orthanc")) watch.orthanc = read.orthanc(std::move(*orthanc));
  if (section.find<std::string>("folder", "the name of a folder")) {
    if (watch.orthanc) throw Error(fmt::format("{}: folder and orthanc: expected one of them", path.string()));
    watch.folder = read.place(section, "folder", "the name of a folder");
    if (!fs::is_directory(watch.folder))
      throw Error(fmt::format("{}: folder: {} is not a folder", path.string(), watch.folder.string()));
  } else if (!watch.orthanc) {
    section.refuse_missing("folder", "the folder to follow, or orthanc: the server");
  }
  watch.results = read.place(section, "results", "the name of a folder");
  watch.site = read_site_file(read.file(section, "site"));
  if (!watch.site.sessions)
    throw Error(
        fmt::format("{}: sessions: is missing, expected {{\"views\": 2, \"quiet_s\": 10}}: when the X-rays of a "
                    "session are complete",
                    watch.site.path.string()));
  watch.registration = section.find<std::vector<std::string>>("register", "a list of flags of isoshift register")
                           .value_or(std::vector<std::string>());
  using List = std::vector<nlohmann::json>;
  const List peers = section.find<List>("peers", "a list of peers").value_or(List());
  for (std::size_t n = 0; n < peers.size(); ++n) {
    DicomPeer peer = read.peer(JsonSection(peers[n], fmt::format("{}: peer {}", path.string(), n + 1)));
    if (std::ranges::find(watch.peers, peer.name, &DicomPeer::name) != watch.peers.end())
      throw Error(fmt::format("{}: peer {}: the name {} is there twice", path.string(), n + 1, peer.name));
    watch.peers.push_back(std::move(peer));
  }
  if (section.find<std::string>("signing_key", "the name of a file"))
    watch.signing_key = read.file(section, "signing_key");
  watch.syslog = section.find<bool>("syslog", "true or false").value_or(false);
  constexpr const char* kDays = "a whole number of days, at least 1";
  watch.keep_days = section.find<int>("keep_days", kDays);
  if (watch.keep_days && *watch.keep_days < 1) section.refuse("keep_days", kDays);
  watch.needs_second_person = section.find<bool>("second_person", "true or false").value_or(false);
  section.end();
  return watch;
}

std::vector<std::string> WatchFile::names_of_peers() const {
  std::vector<std::string> names;
  names.reserve(peers.size());
  for (const DicomPeer& peer : peers) names.push_back(peer.name);
  return names;
}

}  // namespace isoshift
