#pragma once
// The audit log of a results tree: one JSON object per line. Lines are only added, and each is linked to those before
// it (audit_chain.h). The log holds no names of patients and no UIDs. It also proves which registrations and releases
// took place: their lines contain the SHA-256 of their files.

#include <sys/types.h>

#include <array>
#include <ctime>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "workflow/room/audit_chain.h"

namespace isoshift {

// Events in which people say something about a session, each in a file (statement_files.h).
inline constexpr std::array kStatements = {"decided", "chosen", "handed over"};

// In the file of a release or statement: the head of the audit log that it saw.
inline constexpr const char* kAuditHeadKey = "audit_head";

class AuditLog {
 public:
  explicit AuditLog(std::filesystem::path path) : path_(std::move(path)) {}

  // Hears of every line that was written. Must not throw.
  using Mirror = std::function<void(const nlohmann::ordered_json& line)>;
  void set_mirror(Mirror mirror) { mirror_ = std::move(mirror); }

  // Adds a line for a step that is about to take effect. On return the line is on the disk. Throws Error if the line
  // cannot be written: then the step must not be taken.
  void append(const std::string& event, const nlohmann::ordered_json& details);
  // Adds a line for a step that has taken effect. If the line cannot be written now, it is kept for later.
  void note(const std::string& event, const nlohmann::ordered_json& details);
  // Writes the lines that were kept. Throws Error if they still cannot be written.
  void write_kept();

  // The link of the next line: it stands for all lines so far, those that were kept left out. Throws Error as below.
  std::string head() const;

  // The following say what the lines prove. They throw Error if the log exists and cannot be read, if it is not the log
  // that was read before, with more lines, and if a link is broken: a line may have been taken out.
  // True if the newest registration of the session has this record.
  bool has_registration(const std::string& session, const std::string& record_sha256) const;
  bool has_been_released(const std::string& session) const;
  // True if the newest release of the session has this file.
  bool has_release(const std::string& session, const std::string& release_sha256) const;
  // The place of the session's newest release among all releases in the log, from 1; 0 if there is none.
  std::size_t release_number(const std::string& session) const;
  // True if the peer has confirmed the object. Lines that were kept count, too.
  bool has_sending(const std::string& session, const std::string& peer, const std::string& object_sha256) const;
  // The SHA-256 of the newest objection to the session's result; empty if there is none.
  std::string newest_objection(const std::string& session) const;
  // The SHA-256 of the file of what a person has last said about the session in lines of this event (kStatements);
  // empty if there is none.
  std::string newest_statement(const std::string& event, const std::string& session) const;
  std::set<std::string> sessions_with(const std::string& event) const;
  // The session that was made of a result by hand; empty if none was. `statement`: the SHA-256 of the file that says
  // who has handed it over.
  std::string made_of_hand_over(const std::string& statement) const;
  // The session with which an object was released; nothing if the object was not released.
  std::optional<std::string> session_releasing(const std::string& object_sha256) const;

 private:
  struct Version {
    ino_t inode = 0;
    off_t size = -1;
    timespec written{};
  };
  struct Proofs {
    std::map<std::string, std::string> registrations;                       // SHA-256 of the newest record, by session
    std::map<std::string, std::string> objections;                          // SHA-256 of the newest one, by session
    std::map<std::pair<std::string, std::string>, std::string> statements;  // SHA-256 of the file, by event and session
    std::map<std::string, std::string> taken_over;       // session, by SHA-256 of the file that hands it over
    std::map<std::string, std::string> releases;         // SHA-256 of the newest release file, by session
    std::map<std::string, std::size_t> release_numbers;  // by session
    std::size_t releases_so_far = 0;
    std::map<std::string, std::string> objects;     // session, by SHA-256 of a released object
    std::set<std::array<std::string, 3>> sendings;  // session, peer, SHA-256 of the object

    void add_lines(std::string_view lines);
    void add(const nlohmann::ordered_json& line);
  };
  void write(const std::vector<nlohmann::ordered_json>& lines) const;
  // Waits a few seconds for other writers. Throws Error if one of them does not end.
  void lock(int descriptor) const;
  const Proofs& proofs() const;  // reads the log again if it has changed
  [[noreturn]] void refuse_another_log() const;

  std::filesystem::path path_;
  Mirror mirror_;
  std::vector<nlohmann::ordered_json> kept_;  // lines that could not be written yet
  mutable Version read_version_;
  mutable std::string read_lines_;  // the whole lines that were read: a log only grows, and only what is new is parsed
  mutable std::string cut_off_;     // what stands behind them: a line that is being written, or never was
  mutable AuditChain chain_;
  mutable Proofs proofs_;
};

}  // namespace isoshift
