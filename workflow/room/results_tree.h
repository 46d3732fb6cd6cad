#pragma once
// The folder in which isoshift watch keeps what it made, and what became of it. Files are its only memory, each written
// at once, so that whoever is stopped at any moment goes on from them:
//
//   sessions/NAME/           the result of a session of X-rays
//   released/NAME.json       who released it, and what goes to whom
//   sent/NAME.PEER.FILE      that peer has answered that it stored this file
//   audit.jsonl              what happened when, who released what: no names of patients, no UIDs

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/file_lock.h"

namespace isoshift {

struct Release {
  struct Object {
    std::string file;  // of the session's folder
    std::string sha256;
  };
  std::string session, by, on;  // `on`: local time
  std::vector<Object> objects;
  std::vector<std::string> peers;
};

struct Delivery {
  std::string session, peer;
  Release::Object object;
};

class ResultsTree {
 public:
  // Makes what is not there. Throws Error where it cannot.
  explicit ResultsTree(std::filesystem::path path);

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path session(const std::string& name) const { return path_ / "sessions" / name; }
  std::vector<std::string> sessions() const;  // that have a result

  // For whoever registers and sends: nothing where somebody else does.
  std::optional<FileLock> try_lock() const;

  // Removes what a killed process left half written. Only for whoever holds the lock of the tree.
  void clean() const;

  bool is_released(const std::string& session) const;
  std::optional<Release> release_of(const std::string& session) const;
  // Records who releases a session, with the objects that it holds. Throws Error for one that is not there, that was
  // rejected, or that has been released before.
  Release release(const std::string& session, const std::string& by, const std::vector<std::string>& peers) const;

  // What was released and no peer has answered for. What has been delivered once is not read again.
  std::vector<Delivery> pending() const;
  std::vector<Delivery> pending_of(const Release& release) const;
  // The file, if it is what was released. Throws Error if it has changed since.
  std::filesystem::path checked_file(const Delivery& delivery) const;
  // Writes what mark_sent() only has to put in place: with a full disk nothing is sent that cannot be marked.
  void prepare_to_send(const Delivery& delivery) const;
  // It was prepared and not marked: the peer may have it.
  bool is_in_doubt(const Delivery& delivery) const;
  void mark_sent(const Delivery& delivery, const std::string& answer) const;

  // One line, flushed. What cannot be written now is with the next one.
  void audit(const std::string& event, const nlohmann::ordered_json& details) const;
  // Adds lines for what was done by somebody who was killed before the line. Only for whoever holds the lock.
  void complete_audit() const;

 private:
  std::vector<std::string> released() const;  // sessions
  std::filesystem::path sent_file(const Delivery& delivery) const;
  std::filesystem::path prepared_file(const Delivery& delivery) const;

  std::filesystem::path path_;
  mutable std::set<std::string> delivered_;  // sessions, to all of their peers
  mutable std::string unwritten_;            // of the audit log
};

}  // namespace isoshift
