#pragma once
// The folder in which isoshift room watch keeps results, releases and deliveries. These files are its only memory. Each
// is written whole or not at all, so that a process that was stopped at any moment can continue from them:
//
//   sessions/NAME/           the result of a session of X-rays
//   registered/NAME.json     the SHA-256 of every file in that folder when it was registered
//   released/NAME.json       who released the session, and which objects are sent to which peers
//   decided/NAME.N.json      what a person has decided about the session
//   chosen/NAME.N.json       what a person has chosen for the session's X-rays, as they were registered or will be
//   orders/NAME.json         how the session was registered: what a person who registers it by hand begins with
//   inputs/NAME.json         the SHA-256 of the files from which it was registered
//   handed_over/NAME/        a result of the session's X-rays by hand that watch has yet to take over; beside it, in
//                            NAME.N.json, who has handed it over, the SHA-256 of its files as they were made, and from
//                            what it was registered
//   sent/NAME.PEER.FILE      the mark that this peer has confirmed this file; it counts with its line in the audit log
//   deleted/NAME.json        that the results of these X-rays were deleted
//   objections.json          what other X-rays of the patient say against results
//   audit.jsonl              the audit log, without names of patients and without UIDs
//
// The X-rays of a session NAME can have further results, made by hand or because the files of the first are others
// now: they are sessions of their own, NAME-2 and so on. Only the newest result of the same X-rays is released or sent.
//
// A session is released or sent only if its folder is unchanged since its record was written, and if the audit log has
// a line for the record and for the release, each with the SHA-256 of its file. A line is on the disk before its step
// takes effect.

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/file_lock.h"
#include "base/signing_key.h"
#include "io/config/watch_file.h"
#include "workflow/register/registration_messages.h"
#include "workflow/room/audit_log.h"
#include "workflow/room/choice.h"
#include "workflow/room/decision.h"
#include "workflow/room/deletion.h"
#include "workflow/room/release.h"
#include "workflow/room/sent_marks.h"
#include "workflow/room/session_inputs.h"
#include "workflow/room/session_record.h"

namespace isoshift {

// What other X-rays of the patient say against a result.
struct Objection {
  std::string words;
  bool newer_have_results = false;  // there are newer X-rays, and nothing else: all of them have results of their own

  bool operator==(const Objection&) const = default;
};

// With what a person begins who registers X-rays by hand.
struct ManualBasis {
  std::string newest;                   // the newest result of the X-rays
  RegistrationOrder order;              // how they are registered, from the planned pose
  std::optional<SessionInputs> inputs;  // from what the newest result was registered; nothing: that was not kept

  bool operator==(const ManualBasis&) const = default;
};

// A result that a registration has left, and the SHA-256 of its files as the registration wrote them.
struct MadeResult {
  std::filesystem::path folder;
  FileHashes files;
};

// Throws Error if another user owns the results tree: isoshift room watch could not read files that this user writes
// there.
void check_is_owner(const std::filesystem::path& results);

class ResultsTree {
 public:
  // Makes the folders that do not exist. Throws Error if that fails.
  explicit ResultsTree(std::filesystem::path path);
  // That of a watch file, with its key: releases are signed, and those that the key has not signed do not count.
  explicit ResultsTree(const WatchFile& watch);

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path session(const std::string& name) const { return path_ / "sessions" / name; }
  std::vector<std::string> sessions() const;  // sessions that have a result

  // The lock of the tree, for the process that registers and sends; nothing if another process holds it.
  std::optional<FileLock> try_lock() const;

  // Removes files that a killed process left half written. The caller must hold the lock of the tree.
  void clean();

  // The folder in which this process registers a session. publish() moves it to the session's place.
  std::filesystem::path registering(const std::string& session) const;
  // Throws Error if there is a session of this name already.
  void check_is_new(const std::string& session) const;
  // Writes the record of a session, adds its line to the audit log, and moves the folder to its place, in this order,
  // so that a session without a record cannot be one that was registered here. `made`: the files as the registration
  // wrote them. Throws Error if one of the three steps fails, or if the folder holds anything else. The caller must
  // hold the lock of the tree.
  void publish(const std::string& session, const FileHashes& made);

  // Keeps how a session is registered, and from what. The caller must hold the lock of the tree.
  void keep_order(const std::string& session, const RegistrationOrder& order);
  void keep_inputs(const std::string& session, const SessionInputs& inputs);
  // From what the newest result of the session's X-rays was registered; nothing if that was not kept.
  std::optional<SessionInputs> inputs(const std::string& session) const;
  // A file from which its X-rays were registered and that is gone: another file may have replaced it. Empty: none is.
  std::filesystem::path missing_input(const std::string& session) const;
  // How its X-rays were registered, from the planned pose. Throws Error if that was not kept.
  RegistrationOrder order(const std::string& session) const;
  // Throws as order() does.
  ManualBasis manual_basis(const std::string& session) const;
  // Hands a finished result by hand to the process that registers, as a line in the audit log says, and returns the
  // name that it will have. The folder is moved away. Throws Error, and changes nothing, if it is no result of these
  // X-rays or was changed since it was made, if the basis is another one now, or if an earlier one was not taken over
  // yet.
  std::string hand_over(const ManualBasis& basis, const MadeResult& result, const std::string& by);
  std::vector<std::string> handed_over() const;  // sessions
  // Publishes what was handed over as a session of its own, with the inputs of its basis, and returns its name. Throws
  // as publish() does, and if hand_over() did not hand it over, or not once. The caller must hold the lock of the tree.
  std::string take_over(const std::string& session);
  // Whether a result of the session's X-rays by hand waits to be taken over.
  bool is_handed_over(const std::string& session) const;
  // The newest result of the same X-rays: the session itself, or a further one.
  std::string newest_of_same_xrays(const std::string& session) const;
  // The name of the next result of the session's X-rays.
  std::string further_name(const std::string& session) const;

  // The record of a session. Throws Error if there is no record, or if the audit log has no line for it.
  SessionRecord registered(const std::string& session) const;

  // When the record of a session was written; nothing without a record. Another time: the session was registered again.
  std::optional<std::filesystem::file_time_type> registered_at(const std::string& session) const;

  // What other X-rays say against results, by session.
  std::map<std::string, Objection> objections() const;
  // That against one result; without words: none. If the audit log says that there is another one than objections.json
  // says, the words say so.
  Objection objection(const std::string& session) const;
  // The caller must hold the lock of the tree.
  void keep_objections(const std::map<std::string, Objection>& objections);

  // Records what a person has decided about the result that its record names; when, and by which user of the system,
  // is added here. Throws Error if there is no such session, if its record is another one now, if somebody agrees with
  // what was rejected and not taken back, if there is nothing to take back, or if the audit log cannot be written.
  void decide(Decision decision);
  // The newest decision about the present result of a session; nothing if there is none, or if it was taken back.
  // Throws Error if the files do not say what the audit log proves.
  std::optional<Decision> decision(const std::string& session) const;

  // Records what a person has chosen for X-rays, or that an earlier choice is withdrawn; when, and by which user of the
  // system, is added here. Throws Error if the audit log cannot be written.
  void choose(Choice choice);
  // The newest choice for the X-rays of a session; nothing if there is none. Throws Error if the files do not say what
  // the audit log proves.
  std::optional<Choice> choice(const std::string& session) const;
  // The sessions for whose X-rays people have chosen, each with a text that changes with the files that say so.
  std::map<std::string, std::string> chosen() const;

  // Whether it was released, and a peer has yet to confirm an object.
  bool is_to_be_sent(const std::string& session) const;
  // Deletes all results of the session's X-rays, and what is kept of them or was chosen for them; the audit log, and a
  // file in deleted/, say so. Throws Error, and deletes nothing, if there is no such session, if what was released of
  // it is still to be sent, or if the audit log cannot be written. `by`: the person, or the rule of the watch file.
  void remove(const std::string& session, const std::string& by);
  // All deletions. Removes what a killed process has left of results that it was deleting.
  std::vector<Deletion> finish_deletions() const;
  // When the newest deletion took place.
  std::filesystem::file_time_type newest_deletion() const;

  bool is_released(const std::string& session) const;
  std::set<std::string> released() const;  // sessions
  // The release of a session, if there is one. Throws Error for a release file that isoshift room release did not
  // write, or that was changed.
  std::optional<Release> release_of(const std::string& session) const;
  // Releases a session with its objects. Throws Error, and releases nothing, if the session does not exist, was
  // rejected, has been released before, or has changed since its registration, if its X-rays have a newer result, if a
  // person decided against it or a second person is needed, if other X-rays speak against it and the releaser does not
  // say so, or if the audit log cannot be written.
  // `seen`: what the person has seen; if anything of that is another one now, nothing is released.
  struct Seen {
    std::string record;     // SHA-256 of the record
    std::string objection;  // in words
  };
  Release release(const std::string& session, const Releaser& releaser, const std::vector<std::string>& peers,
                  const std::optional<Seen>& seen = std::nullopt);

  struct Pending {
    std::vector<Delivery> deliveries;
    std::map<std::string, std::string> refused;  // reason why a session is not sent, by session
  };
  // The released objects that their peers have not confirmed yet, in the order of the releases, so that a peer receives
  // the newest last. A session whose objects have all been delivered is not read again.
  Pending pending();
  std::vector<Delivery> pending_of(const Release& release) const;
  // The file to send. Throws Error if it is no longer released, if its session has changed since its registration, or
  // if other X-rays have come to speak against it since its release.
  std::filesystem::path checked_file(const Delivery& delivery) const;
  // Prepares the mark: an object that could not be marked is not sent.
  void prepare_to_send(const Delivery& delivery);
  // True if a sending was prepared, or has its mark without its line in the audit log, or its line without its mark:
  // the peer may have the object.
  bool is_in_doubt(const Delivery& delivery) const;
  void mark_sent(const Delivery& delivery, const std::string& answer);

  // Adds a line to the audit log for a step that has taken effect. If the line cannot be written now, it is kept.
  void audit(const std::string& event, const nlohmann::ordered_json& details);
  // Throws Error if the audit log is not whole.
  void check_audit() const;
  // Writes the lines that were kept. Throws Error if they still cannot be written.
  void write_kept_audit();

 private:
  std::filesystem::path record_file(const std::string& session) const;
  std::filesystem::path order_file(const std::string& session) const;
  std::filesystem::path inputs_file(const std::string& session) const;
  std::filesystem::path handed_over_folder(const std::string& session) const;
  std::filesystem::path release_file(const std::string& session) const;
  // The record of a session. Throws Error if the session's folder has changed since its registration.
  SessionRecord checked(const std::string& session) const;
  // `handed_over`: the SHA-256 of the file that says who has; empty if nobody has.
  void publish(const std::string& session, const MadeResult& result, const std::string& handed_over);
  bool is_decided(const std::string& session) const;
  void check_is_not_deleted(const std::string& session) const;
  // Throws Error if a newer result, one by hand that waits to be taken over, a decision, or a file that has changed
  // since the registration forbids that the session is released or sent.
  void check_stands(const std::string& session) const;
  void check_inputs(const std::string& session) const;
  void check_second_person(const SessionRecord& record, const std::string& releaser) const;
  FileLock lock_releases() const;
  void check_objects_are_new(const Release& release) const;
  void put_release(const Release& release);
  bool has_line(const Delivery& delivery) const;  // the audit log tells that it was sent

  std::filesystem::path path_;
  AuditLog audit_;
  SentMarks marks_;
  std::optional<SigningKey> key_;
  bool needs_second_person_ = false;  // for results that were not accepted
  std::set<std::string> delivered_;   // sessions that all of their peers have confirmed
};

}  // namespace isoshift
