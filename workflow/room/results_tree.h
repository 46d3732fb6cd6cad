#pragma once
// The folder in which isoshift watch keeps what it made, and what became of it. Files are its only memory, each written
// at once, so that whoever is stopped at any moment goes on from them:
//
//   sessions/NAME/           the result of a session of X-rays
//   registered/NAME.json     the SHA-256 of every file in that folder when it was registered
//   released/NAME.json       who released it, and what goes to whom
//   sent/NAME.PEER.FILE      that peer has answered that it stored this file
//   audit.jsonl              what happened when, who released what: no names of patients, no UIDs
//
// Nothing is released or sent unless the folder is what its record says and the audit log has a line for the record and
// for the release, each with the SHA-256 of its file. A line is on the disk before its step takes effect.

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/file_lock.h"
#include "workflow/room/audit_log.h"
#include "workflow/room/session_record.h"

namespace isoshift {

// Who releases a session: by what name, as which user of the system, and from which user that one came by sudo.
struct Releaser {
  std::string by, user, sudo_user;  // sudo_user: empty without sudo
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
  std::string record;  // SHA-256 of the record of the session as it was released
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
  void clean();

  // The folder in which this process registers a session. publish() makes it the session's folder.
  std::filesystem::path registering(const std::string& session) const;
  // Throws Error if there is a session of this name already.
  void check_is_new(const std::string& session) const;
  // Records what was registered, adds its line to the audit log, and moves the folder to its place, in this order: a
  // session without a record was not registered here. Throws Error where one of the three fails. Only for whoever
  // holds the lock of the tree.
  void publish(const std::string& session);
  // The record of a session. Throws Error if there is none, or if the audit log does not have it.
  SessionRecord registered(const std::string& session) const;

  bool is_released(const std::string& session) const;
  // Throws Error for a release file that isoshift release did not write, or that was changed.
  std::optional<Release> release_of(const std::string& session) const;
  // Records who releases a session, with the objects that it holds. Throws Error for a session that is not there, that
  // was rejected, that has been released before, or that is not what was registered, and where the audit log cannot be
  // written; then it is not released.
  Release release(const std::string& session, const Releaser& releaser, const std::vector<std::string>& peers);

  struct Pending {
    std::vector<Delivery> deliveries;
    std::map<std::string, std::string> refused;  // why nothing of a session is sent
  };
  // What was released and no peer has answered for. What has been delivered once is not read again.
  Pending pending();
  std::vector<Delivery> pending_of(const Release& release) const;
  // The file, if it is still released, and its session is what was registered. Throws Error if not.
  std::filesystem::path checked_file(const Delivery& delivery) const;
  // Writes what mark_sent() only has to put in place: with a full disk nothing is sent that cannot be marked.
  void prepare_to_send(const Delivery& delivery);
  // It was prepared and not marked: the peer may have it.
  bool is_in_doubt(const Delivery& delivery) const;
  void mark_sent(const Delivery& delivery, const std::string& answer);

  // A line in the audit log for what has happened. What cannot be written now is kept.
  void audit(const std::string& event, const nlohmann::ordered_json& details);
  // Writes the lines that were kept. Throws Error if they cannot be.
  void write_kept_audit();
  // Adds lines for objects that were sent by somebody who was killed before the line. Only for whoever holds the lock.
  void complete_audit();

 private:
  std::filesystem::path record_file(const std::string& session) const;
  std::filesystem::path release_file(const std::string& session) const;
  std::vector<std::string> released() const;  // sessions
  // The record of a session whose folder holds what was registered. Throws Error if not.
  SessionRecord checked(const std::string& session) const;
  FileLock lock_releases() const;
  void check_objects_are_new(const Release& release) const;
  void put_release(const Release& release);
  std::filesystem::path sent_file(const Delivery& delivery) const;
  std::filesystem::path prepared_file(const Delivery& delivery) const;
  bool is_sent(const Delivery& delivery) const;

  std::filesystem::path path_;
  AuditLog audit_;
  std::set<std::string> delivered_;  // sessions, to all of their peers
};

}  // namespace isoshift
