#include "tests/support/treatment_room.h"

#include <fmt/format.h>

#include <fstream>
#include <iterator>
#include <utility>

#include "base/error.h"
#include "base/output_folder.h"
#include "base/sha256.h"
#include "io/report/formats.h"
#include "io/report/result_folder.h"
#include "tests/support/findings.h"
#include "workflow/room/patient_files.h"

namespace isoshift {
namespace {

std::string patient(const std::string& patient_id) { return patient_id + "\\"; }
std::filesystem::path file_of(const std::string& uid) { return "/in/" + uid; }
std::string plan_uid(const std::string& patient_id) { return "plan." + patient_id; }

}  // namespace

StudyFiles ct_of(const std::string& patient_id) {
  const std::string uid = "ct." + patient_id;
  StudyFiles files;
  files.cts = {{.patient = patient(patient_id),
                .series_instance_uid = "series." + patient_id,
                .frame_of_reference_uid = "frame." + patient_id,
                .files = {file_of(uid)},
                .sop_instance_uids = {uid}}};
  return files;
}

StudyFiles plan_of(const std::string& patient_id) {
  StudyFiles files;
  files.plans = {{.file = file_of(plan_uid(patient_id)),
                  .patient = patient(patient_id),
                  .sop_instance_uid = plan_uid(patient_id),
                  .frame_of_reference_uid = "frame." + patient_id,
                  .structure_set_uid = ""}};
  return files;
}

StudyFiles xray(const std::string& patient_id, const std::string& uid, const std::string& label, double second,
                std::optional<double> table_vertical_mm) {
  constexpr double kDay = 1772409600.0;  // 2026-03-02, since 1970
  const int whole = static_cast<int>(second);
  StudyFiles files;
  files.images = {{.file = file_of(uid),
                   .patient = patient(patient_id),
                   .sop_instance_uid = uid,
                   .plan_uid = plan_uid(patient_id),
                   .label = label,
                   .at_s = kDay + second,
                   .acquired = fmt::format("2026-03-02 {:02}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60)}};
  if (table_vertical_mm)
    files.images[0].table = {
        .lateral_mm = 0.0, .longitudinal_mm = 0.0, .vertical_mm = *table_vertical_mm, .are_measured = true};
  return files;
}

double second_of(int hour, int minute, int second) { return 3600.0 * hour + 60.0 * minute + second; }

void FakeSource::bring(const StudyFiles& object) { brought_.push_back(object); }

const StudyFiles::Image* FakeSource::xray(const std::string& uid) const {
  for (const auto& [patient_id, objects] : everything_)
    if (const auto found = objects.find(uid); found != objects.end() && !found->second.images.empty())
      return &found->second.images.front();
  return nullptr;
}

void FakeSource::take(const std::string& patient_id, const std::string& uid, const StudyFiles& object) {
  Patient& patient = patients_[patient_id];
  patient.last = clock_.now();
  last_[patient_id] = clock_.file_time();
  if (here_.insert(uid).second) merge(object, patient.files);
}

void FakeSource::lose(const std::string& patient_id, const std::set<std::string>& uids) {
  std::erase_if(patients_.at(patient_id).files.images,
                [&](const StudyFiles::Image& image) { return uids.contains(image.sop_instance_uid); });
}

void FakeSource::give_away(const std::string& patient_id, const std::string& uid) {
  const auto is_it = [&](const auto& object) { return object.sop_instance_uid == uid; };
  StudyFiles& files = patients_.at(patient_id).files;
  std::erase_if(files.images, is_it);
  std::erase_if(files.plans, is_it);
  everything_[patient_id].erase(uid);
  here_.erase(uid);
}

void FakeSource::update(Notes& /*notes*/) {
  if (is_down_) throw Error("the server is down");
  for (const std::string& patient_id : std::exchange(asked_, {}))
    for (const auto& [uid, object] : everything_[patient_id])
      if (!here_.contains(uid)) take(patient_id, uid, object);
  for (const StudyFiles& object : std::exchange(brought_, {})) {
    const auto [patient_id, uid] = known_file_in(object).value();
    everything_[patient_id][uid] = object;
    take(patient_id, uid, object);
  }
}

void FakeSource::forget_before(std::filesystem::file_time_type time, const std::set<std::string>& but) {
  for (const auto& [patient_id, last] : last_) {
    if (last >= time || but.contains(patient_id) || patients_.erase(patient_id) == 0) continue;
    for (const auto& [uid, object] : everything_[patient_id]) here_.erase(uid);
  }
}

void FakeRunner::begin(const RegistrationOrder& order) {
  const StudyParts& parts = order.parts;
  Run& run = runs_.emplace_back(Run{.xrays = {},
                                    .doubts = parts.doubts,
                                    .flags = order.flags,
                                    .plan = parts.plan.filename().string(),
                                    .ct = parts.ct.front().filename().string(),
                                    .began = clock_.now()});
  for (const auto& image : parts.images) run.xrays.insert(image.filename().string());
  folder_ = order.output;
  is_running_ = true;
}

std::optional<Runner::End> FakeRunner::end() {
  if (!is_running_) throw Error("no registration is under way");
  const Run& run = runs_.back();
  if (clock_.now() - run.began < length) return std::nullopt;
  is_running_ = false;
  if (failure) return End{.failure = failure};
  SetupResult report;
  report.findings.clear();
  for (const std::string& doubt : run.doubts) report.findings.push_back({.check = Check::kFiles, .words = doubt});
  std::ranges::copy(findings_for(verdict(run.xrays)), std::back_inserter(report.findings));
  report.site.emplace().sha256 = site_sha256;
  std::string all;
  for (const std::string& uid : run.xrays) {
    auto& view = report.views.emplace_back();
    view.sop_instance_uid = uid;
    if (const StudyFiles::Image* image = source_.xray(uid)) {
      view.acquired = image->acquired;
      report.identity.patient_id = patient_id_of(image->patient);
    }
    all += uid;
  }
  std::filesystem::create_directories(folder_);
  write_text(folder_ / kResultFile, json_report(report));
  write_text(folder_ / "report.dcm", "report of " + all);
  if (report.verdict() == Verdict::kAccepted) write_text(folder_ / kRegistrationFile, "registration of " + all);
  const End end{.files = sha256_of_folder(folder_)};
  after_end(folder_);
  return end;
}

std::string FakeSender::send(const std::filesystem::path& file, const std::string& sha256, const DicomPeer& peer,
                             bool may_be_there) {
  const std::string object = (file.parent_path().filename() / file.filename()).string();
  attempts_.push_back({.peer = peer.name, .object = object, .at = clock_.now()});
  if (down.contains(peer.name)) throw PeerError("peer " + peer.name + ": no answer");
  if (sha256_of_file(file) != sha256) throw Error(object + ": is another file");
  const std::string key = peer.name + " " + object;
  if (may_be_there && stored_.contains(key)) return "was there";
  ++stored_[key];
  if (loses_answer()) throw PeerError("peer " + peer.name + ": cut off");
  return "";
}

TreatmentRoom::TreatmentRoom() {
  file.results = folder / "results";
  file.site.name = "test";
  file.site.sha256 = runner.site_sha256 = "this site file";
  file.site.sessions = {.views = 2, .quiet_s = 10.0};
  file.peers = {{.name = "record"}, {.name = "archive"}};
}

void TreatmentRoom::start() {
  watch.reset();
  runner.give_up();
  watch = std::make_unique<Watch>(file, Watch::Parts{.source = source,
                                                     .runner = runner,
                                                     .sender = sender,
                                                     .clock = clock,
                                                     .observer = observer,
                                                     .sending = sending,
                                                     .contents = contents});
}

void TreatmentRoom::pass(std::chrono::seconds length, std::chrono::seconds step) {
  for (const Clock::Time end = clock.now() + length; clock.now() < end;) {
    clock.pass(step);
    watch->round();
    watch->deliver({});
  }
}

std::string TreatmentRoom::index() const {
  std::ifstream page(file.results / "index.html");
  return {std::istreambuf_iterator<char>(page), {}};
}

std::vector<std::set<std::string>> TreatmentRoom::runs() const {
  std::vector<std::set<std::string>> all;
  for (const FakeRunner::Run& run : runner.runs()) all.push_back(run.xrays);
  return all;
}

}  // namespace isoshift
