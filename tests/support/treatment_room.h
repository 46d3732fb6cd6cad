#pragma once
// A treatment room in which nothing takes time: a clock that a test sets, images that were never taken, registrations
// and peers that only write down what they are told to do.

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "io/config/watch_file.h"
#include "setup/verdict.h"
#include "tests/support/temporary_folder.h"
#include "workflow/observer.h"
#include "workflow/room/clock.h"
#include "workflow/room/runner.h"
#include "workflow/room/sender.h"
#include "workflow/room/session_inputs.h"
#include "workflow/room/source.h"
#include "workflow/room/watch.h"

namespace isoshift {

class ManualClock : public Clock {
 public:
  Time now() const override { return now_; }
  std::filesystem::file_time_type file_time() const override { return file_time_; }
  void wait(std::chrono::milliseconds length) override { pass(length); }
  void pass(std::chrono::milliseconds length) {
    now_ += length;
    file_time_ += length;
  }

 private:
  Time now_{std::chrono::hours(1000)};
  std::filesystem::file_time_type file_time_ = std::filesystem::file_time_type::clock::now();
};

// Objects of a patient, as the sources read them. The file of each is named after its SOPInstanceUID.
StudyFiles ct_of(const std::string& patient_id);
StudyFiles plan_of(const std::string& patient_id);
// `second`: of the day on which it was taken; see second_of().
StudyFiles xray(const std::string& patient_id, const std::string& uid, const std::string& label, double second,
                std::optional<double> table_vertical_mm = std::nullopt);
double second_of(int hour, int minute, int second = 0);

// A server that has everything that was ever brought, and gives what was forgotten only when it is asked.
class FakeSource : public Source {
 public:
  explicit FakeSource(const Clock& clock) : clock_(clock) {}

  std::vector<std::string> broken;  // messages on files that cannot be read

  void bring(const StudyFiles& object);                                         // comes with the next update
  void lose(const std::string& patient_id, const std::set<std::string>& uids);  // X-rays
  void give_away(const std::string& patient_id, const std::string& uid);  // an X-ray or a plan: to be brought again
  void set_down(bool is_down) { is_down_ = is_down; }
  void set_coming(bool is_coming) { is_coming_ = is_coming; }

  // The X-ray of this SOPInstanceUID; null where no X-ray of it was brought.
  const StudyFiles::Image* xray(const std::string& uid) const;

  void update(Notes& notes) override;
  const std::map<std::string, Patient>& patients() const override { return patients_; }
  std::vector<std::string> unreadable() const override { return broken; }
  bool is_coming(const std::string& /*patient_id*/) const override { return is_coming_; }
  void ask_for_rest(const std::string& patient_id) override { asked_.insert(patient_id); }
  void forget_before(std::filesystem::file_time_type time, const std::set<std::string>& but) override;

 private:
  void take(const std::string& patient_id, const std::string& uid, const StudyFiles& object);

  const Clock& clock_;
  std::vector<StudyFiles> brought_;
  std::map<std::string, std::map<std::string, StudyFiles>> everything_;  // by patient and UID
  std::map<std::string, Patient> patients_;
  std::map<std::string, std::filesystem::file_time_type> last_;  // news of each patient
  std::set<std::string> here_;                                   // UIDs
  std::set<std::string> asked_;                                  // patients
  bool is_down_ = false, is_coming_ = false;
};

class FakeRunner : public Runner {
 public:
  FakeRunner(const Clock& clock, const FakeSource& source) : clock_(clock), source_(source) {}

  struct Run {
    std::set<std::string> xrays;      // SOPInstanceUIDs
    std::vector<std::string> doubts;  // whether they show one setup
    std::vector<std::string> flags;   // of isoshift register
    std::string plan, ct;             // names of the plan's and the first CT file
    Clock::Time began;
  };
  std::function<Verdict(const std::set<std::string>& xrays)> verdict = [](const auto&) { return Verdict::kAccepted; };
  std::optional<Failure> failure;  // of every registration that ends
  // What somebody does to the folder of a registration that has ended.
  std::function<void(const std::filesystem::path& folder)> after_end = [](const auto&) {};
  std::string site_sha256;         // of the site file that the results name
  std::chrono::seconds length{0};  // of a registration

  const std::vector<Run>& runs() const { return runs_; }
  bool is_running() const { return is_running_; }

  void begin(const RegistrationOrder& order) override;
  std::optional<End> end() override;
  void give_up() override { is_running_ = false; }

 private:
  const Clock& clock_;
  const FakeSource& source_;
  std::vector<Run> runs_;
  std::filesystem::path folder_;
  bool is_running_ = false;
};

class FakeSender : public Sender {
 public:
  explicit FakeSender(const Clock& clock) : clock_(clock) {}

  struct Attempt {
    std::string peer, object;  // "SESSION/FILE"
    Clock::Time at;
    bool operator==(const Attempt&) const = default;
  };
  std::set<std::string> down;                                 // peers
  std::function<bool()> loses_answer = [] { return false; };  // after the peer has stored the object

  const std::vector<Attempt>& attempts() const { return attempts_; }
  // How often each peer has stored each object: "PEER SESSION/FILE".
  const std::map<std::string, int>& stored() const { return stored_; }

  std::string send(const std::filesystem::path& file, const std::string& sha256, const DicomPeer& peer,
                   bool may_be_there) override;

 private:
  const Clock& clock_;
  std::vector<Attempt> attempts_;
  std::map<std::string, int> stored_;
};

// Files that are not there: a file holds its path, until a test writes something else.
class FakeContents : public FileContents {
 public:
  std::map<std::filesystem::path, std::string> written;

  std::string version(const std::filesystem::path& file) const override { return sha256(file); }
  std::string sha256(const std::filesystem::path& file) const override {
    const auto found = written.find(file);
    return found == written.end() ? file.string() : found->second;
  }
};

class SayingsObserver : public Observer {
 public:
  void say(std::string_view line) override { lines.emplace_back(line); }

  std::vector<std::string> lines;
};

// All of it, with a watch file that asks for two X-rays and 10 s of quiet, and names the peers "record" and "archive".
struct TreatmentRoom {
  TreatmentRoom();

  void start();  // again, too: as if the watch before had been killed
  // Rounds and deliveries, one of each at every step.
  void pass(std::chrono::seconds length, std::chrono::seconds step = std::chrono::seconds(1));
  std::string index() const;                        // index.html
  std::vector<std::set<std::string>> runs() const;  // the X-rays of every registration that began

  TemporaryFolder folder{memory_folder()};  // a watch waits for the disk at every step: 15 s in a day
  WatchFile file;
  ManualClock clock;
  FakeSource source{clock};
  FakeRunner runner{clock, source};
  FakeSender sender{clock};
  FakeContents contents;
  SayingsObserver observer, sending;
  std::unique_ptr<Watch> watch;
};

}  // namespace isoshift
