// isoshift track: follows a moving target through X-rays over time.

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <thread>

#include "cli/commands.h"
#include "cli/ct_phases.h"
#include "cli/graceful_end.h"
#include "cli/registration_setup.h"
#include "cli/track_record.h"
#include "geometry/error.h"
#include "geometry/mask.h"
#include "io/motion_trace.h"
#include "io/output_folder.h"
#include "io/structure_mask.h"

namespace isoshift {
namespace {

using Clock = std::chrono::steady_clock;

struct TrackOptions {
  StudyOptions study;
  RegistrationFlags flags;
  TrackingOptions tracking;
  std::string predictor = "rls";
  std::filesystem::path output, follow, truth;
  std::vector<std::filesystem::path> phases;
  bool six_dof = false;
  double latency_ms = 300.0, together_ms = 50.0, budget_ms = 200.0, idle_s = 5.0;
  std::optional<double> tolerance_mm;
  bool overwrite = false, json = false;
};

class TrackRun {
 public:
  TrackRun(const TrackOptions& options, Console& console) : options_(options), console_(console) {
    record_.tracking = options_.tracking;
    record_.tracking.latency_s = options_.latency_ms / 1000.0;
    record_.tracking.predictor = predictor_kind_from(options_.predictor).value();
    record_.tracking.dof = options_.six_dof ? Dof::kRigid : Dof::kTranslation;
    record_.budget_s = options_.budget_ms / 1000.0;
    record_.tolerance_mm = options_.tolerance_mm;
  }

  int run() {
    OutputFolder output(options_.output, options_.overwrite);
    if (!options_.truth.empty()) record_.truth = read_motion_trace(options_.truth, notes_);
    StudyOptions parts = options_.study;
    if (is_filled()) parts.images = {options_.follow};
    StudyRequest request = parts.request();
    request.one_per_imager = true;
    if (is_filled()) wait_for_first();
    const Study study = first_study(request);
    say_warnings();
    // An imager of another beam quality may begin later.
    RendererStore renderers;
    const RegistrationSetup setup(options_.flags, study,
                                  is_filled() ? std::vector(kBeams.begin(), kBeams.end()) : beams_of(study), renderers);
    const Eigen::Vector3d target = target_of(study);
    if (!options_.phases.empty())
      record_.tracking.predictor_options.phases_mm = displacements_of_phases(
          options_.phases, study, setup, options_.flags.rendering, target, request.allowed, notes_);
    Tracker tracker(setup.renderers(), *setup.options().region, study.planned_room_from_patient, target,
                    record_.tracking);
    XrayStream stream(request, study, is_filled());
    follow(tracker, stream, study.image_files);
    if (std::ranges::none_of(record_.rows, [](const TraceRow& row) { return row.frame.is_known; }))
      throw Error(fmt::format("the target was not found in any of {} moments", record_.rows.size()));
    write(output);
    return kExitAccepted;
  }

 private:
  bool is_filled() const { return !options_.follow.empty(); }  // the folder of the X-rays

  Eigen::Vector3d target_of(const Study& study) const {
    if (options_.flags.region.structures.empty()) return study.isocenter_patient_mm;
    if (!study.structures) throw Error("the study holds no RT Structure Set (--structures FILE names one)");
    const Structure& structure = structure_named(*study.structures, options_.flags.region.structures.front());
    return centroid_patient_mm(mask_of(structure, study.ct->hu.size, study.ct->hu.patient_from_voxel));
  }

  // X-rays must be there before anything can be checked: those of the first moment.
  void wait_for_first() const {
    if (!std::filesystem::is_directory(options_.follow))
      throw Error(fmt::format("{}: is no folder", options_.follow.string()));
    console_.err << "waiting for X-rays in " << options_.follow.string() << std::endl;
    const auto begin = Clock::now();
    while (files_below({options_.follow}).empty()) {
      if (Clock::now() - begin > std::chrono::duration<double>(std::max(60.0, options_.idle_s)))
        throw Error(fmt::format("{}: no X-ray came", options_.follow.string()));
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(500));  // those of the other imager, too
  }

  // In a folder that is being filled the first X-rays may be half written.
  Study first_study(const StudyRequest& request) {
    const auto begin = Clock::now();
    for (;;) {
      try {
        Notes notes = notes_;
        Study study = load_study(request, notes, {});
        notes_ = notes;
        return study;
      } catch (const Error&) {
        constexpr std::chrono::seconds kLongest(10);
        if (!is_filled() || Clock::now() - begin > kLongest) throw;
        std::this_thread::sleep_for(std::chrono::milliseconds(200));
      }
    }
  }

  // Until all files are done, or no more come, or somebody ends it.
  void follow(Tracker& tracker, XrayStream& stream, const std::vector<std::filesystem::path>& files) {
    const GracefulEnd end;
    ProgressBar bar(console_, "Following");
    if (!is_filled()) stream.offer(files, 1, notes_);
    const std::size_t total = stream.waiting();
    auto last_news = Clock::now();
    for (;;) {
      if (is_filled()) stream.offer(files_below({options_.follow}, stream.done_files()), 100, notes_);
      say_warnings();
      const bool is_idle = Clock::now() - last_news > std::chrono::duration<double>(options_.idle_s);
      const std::vector<TimedXray> moment = stream.next_moment(options_.together_ms / 1000.0, !is_filled() || is_idle);
      if (end.is_asked_for() || (moment.empty() && (!is_filled() || is_idle))) break;
      if (moment.empty()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        continue;
      }
      process(tracker, moment, stream.begin_s().value());
      last_news = Clock::now();
      if (is_filled())
        say_where();
      else
        bar.update(total - stream.waiting(), total);
    }
    if (is_filled() && console_.err_is_terminal) console_.err << "\n";
    say_warnings();
    record_.imagers = stream.imagers();
    record_.files = stream.counts();
    record_.files.broken += unreadable_;
    for (const double time_s : stream.late_s()) record_.late_s.push_back(time_s - stream.begin_s().value());
  }

  void say_warnings() {
    if (notes_.warnings.empty()) return;
    if (console_.err_is_terminal) console_.err << kClearedLine;
    print_warnings(notes_.warnings, console_);
    notes_.warnings.clear();
  }

  void say_where() const {
    if (!console_.err_is_terminal) return;
    const TrackedFrame& frame = record_.rows.back().frame;
    console_.err << kClearedLine << fmt::format("{:8.1f} s  {:<8} ", frame.time_s, to_string(frame.status));
    if (frame.is_known)
      console_.err << fmt::format("target at {:6.1f} {:6.1f} {:6.1f} mm", frame.filtered_mm.x(), frame.filtered_mm.y(),
                                  frame.filtered_mm.z());
    console_.err << std::flush;
  }

  void process(Tracker& tracker, const std::vector<TimedXray>& moment, double begin_s) {
    const auto begin = Clock::now();
    double time_s = 0.0;
    std::vector<FixedImage> views;
    for (const TimedXray& timed : moment) {
      time_s += timed.time_s / static_cast<double>(moment.size());
      try {
        if (timed.xray) {
          views.push_back(prepare(*timed.xray));
          continue;
        }
        if (!file_ || file_->path() != timed.header.path)
          file_ = DicomFile::read(timed.header.path, DicomFile::Extent::kWhole);
        Notes said;  // the first X-rays' notes have been said
        const XrayView view = xray_view(timed.header, beam_of(timed.header, said), said);
        views.push_back(prepare(read_xray_image(*file_, timed.header, view)));
      } catch (const Error& error) {
        notes_.warnings.push_back(fmt::format("left out: {}", error.what()));
        ++unreadable_;
      }
    }
    TraceRow row{.frame = tracker.track(time_s - begin_s, std::move(views))};
    row.processing_s = std::chrono::duration<double>(Clock::now() - begin).count();
    record_.rows.push_back(std::move(row));
  }

  void write(OutputFolder& output) const {
    const auto json = track_json(record_);
    write_text(output.path() / "trace.csv", trace_csv(record_));
    write_text(output.path() / "track.json", json.dump(2) + "\n");
    write_text(output.path() / "trace.svg", trace_svg(record_));
    output.commit();
    if (options_.json)
      console_.out << json.dump(2) << "\n";
    else
      console_.out << track_text(json) << fmt::format("\nWritten to {}\n", output.destination().string());
  }

  static constexpr const char* kClearedLine = "\r\x1b[K";

  const TrackOptions& options_;
  Console& console_;
  Notes notes_;
  TrackRecord record_;
  std::optional<DicomFile> file_;
  std::size_t unreadable_ = 0;
};

}  // namespace

void add_track_command(CLI::App& app, Console& console, int& exit_status) {
  auto options = std::make_shared<TrackOptions>();
  CLI::App* command = app.add_subcommand("track", "Follow a moving target through X-rays over time, and predict it");
  command->footer(
      "\nExample:\n  isoshift track breathing/ --structure Target -o track --truth breathing/truth.csv\n"
      "  isoshift track --ct CT --plan RTPLAN.dcm --structures RTSTRUCT.dcm --follow incoming/ --structure Target -o "
      "track\n\n"
      "Writes trace.csv, track.json and trace.svg. Positions are displacements of the target from where it was "
      "planned, mm,\n"
      "IEC 61217 fixed.");
  add_study_options(*command, options->study);
  command->add_option("-o,--output", options->output, "Folder for the results")->required()->type_name("FOLDER");
  command
      ->add_option("--follow", options->follow,
                   "Folder that is being filled with X-rays; ends when none come any more, or with Ctrl-C")
      ->type_name("FOLDER");
  command->add_option("--idle", options->idle_s, "With --follow: end after so long without an X-ray")
      ->type_name("S")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  command->add_option("--predictor", options->predictor, "How the target is predicted")
      ->check(CLI::IsMember(predictor_names()))
      ->capture_default_str();
  command->add_option("--phases", options->phases, "Folders of the phases of a 4D CT, in order, for --predictor model")
      ->type_name("FOLDER...");
  command->add_option("--latency", options->latency_ms, "From an X-ray to the beam: over this the target is predicted")
      ->type_name("MS")
      ->check(CLI::Range(1.0, 2000.0))
      ->capture_default_str();
  command->add_option("--together", options->together_ms, "X-rays of several imagers are of one moment within this")
      ->type_name("MS")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  command->add_option("--budget", options->budget_ms, "Moments that take longer are counted")
      ->type_name("MS")
      ->capture_default_str();
  command->add_flag("--rigid", options->six_dof, "Six degrees of freedom instead of the three translations");
  command->add_option("--box", options->tracking.box_mm, "Search box about the expected position, half its width")
      ->type_name("MM")
      ->check(CLI::Range(1.0, 50.0))
      ->capture_default_str();
  command
      ->add_option("--tolerance", options->tolerance_mm,
                   "Suggest when the beam would wait: the target farther off than this")
      ->type_name("MM")
      ->check(CLI::PositiveNumber);
  command->add_option("--truth", options->truth, "True positions (t_s, x, y, z): print the result beside them")
      ->type_name("CSV");
  command->add_flag("--overwrite", options->overwrite, "Replace an earlier output in that folder");
  command->add_flag("--json", options->json, "Print track.json instead of its figures");
  options->flags.region.margin_mm = 2.0;  // what lies around a moving target does not move with it
  add_region_switches(*command, options->flags.region);
  add_rendering_options(*command, options->flags.rendering);
  command->callback([options, &console, &exit_status] {
    options->flags.settle();
    if (!options->phases.empty() && options->predictor != "model")
      throw UsageError("--phases are for --predictor model");
    if (!options->phases.empty() && options->phases.size() < 4)
      throw UsageError(fmt::format("{} phases: a cycle needs at least 4", options->phases.size()));
    exit_status = TrackRun(*options, console).run();
  });
}

}  // namespace isoshift
