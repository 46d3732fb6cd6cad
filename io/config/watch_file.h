#pragma once
// What isoshift room watch follows, where its results go, and to which peers released results are sent: a JSON file
// (docs/commands/watch.md).

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/config/site_file.h"

namespace isoshift {

// Who receives released results by C-STORE.
struct DicomPeer {
  struct Tls {
    std::filesystem::path ca, certificate, key;  // PEM; the key without passphrase
    std::string fingerprint;                     // SHA-256 of the peer's certificate, hexadecimal; empty: it names host
  };
  std::string name, host;
  std::uint16_t port = 104;
  std::string called_aet, calling_aet;
  std::optional<Tls> tls;  // unset only where the file says so
};

struct OrthancServer {
  std::string url;  // "https://localhost:8042"
  std::string user, password;
  std::filesystem::path ca;  // of its certificate; empty: the system's
};

struct WatchFile {
  std::filesystem::path path;
  std::filesystem::path folder;          // that is followed, or
  std::optional<OrthancServer> orthanc;  // the server
  std::filesystem::path results;
  SiteFile site;                          // with its rule for sessions
  std::vector<std::string> registration;  // flags of isoshift register
  std::vector<DicomPeer> peers;
  bool syslog = false;                // the audit log goes to the system's log, too
  std::optional<int> keep_days;       // results are deleted that long after their registration; unset: never
  bool needs_second_person = false;   // who agrees before another one releases what was not accepted
  std::filesystem::path signing_key;  // of releases: Ed25519, PEM; empty: they are not signed

  std::vector<std::string> names_of_peers() const;
};

// Paths are relative to the file's folder. Throws Error naming the file, the place in it and what is expected there.
WatchFile read_watch_file(const std::filesystem::path& path);

}  // namespace isoshift
