#include "workflow/track/track_study.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "base/error.h"
#include "base/graceful_end.h"
#include "base/json_file.h"
#include "base/option_name.h"
#include "base/output_folder.h"
#include "geometry/mask.h"
#include "io/dicom/structure_mask.h"
#include "io/study/files_below.h"
#include "io/study/motion_trace.h"
#include "workflow/track/ct_phases.h"

namespace isoshift {
namespace {

using Clock = std::chrono::steady_clock;

class TrackRun {
 public:
  TrackRun(const TrackOptions& options, Observer& observer) : options_(options), observer_(observer) {
    record_.tracking = options_.tracking;
    record_.budget_s = options_.budget_s;
    record_.tolerance_mm = options_.tolerance_mm;
  }

  TrackRecord run() {
    std::vector<std::filesystem::path> inputs = options_.study.parts.paths();
    inputs.push_back(options_.follow);
    inputs.insert(inputs.end(), options_.phases.begin(), options_.phases.end());
    OutputFolder output(options_.output, options_.overwrite, inputs);
    if (!options_.truth.empty()) {
      record_.truth = read_motion_trace(options_.truth, notes_);
      if (record_.truth.empty()) throw Error(fmt::format("{}: holds no position", options_.truth.string()));
    }
    StudyOptions named = options_.study;
    if (is_filled()) named.parts.images = {options_.follow};
    StudyRequest request = named.request();
    request.one_per_imager = true;
    if (is_filled()) wait_for_first();
    const Study study = first_study(request);
    say_warnings();
    // An imager of another beam quality may begin later.
    RendererStore renderers;
    const RegistrationSetup setup(options_.registration, study,
                                  is_filled() ? std::vector(kBeams.begin(), kBeams.end()) : beams_of(study), renderers);
    const Eigen::Vector3d target = target_of(study);
    if (!options_.phases.empty())
      record_.tracking.predictor_options.phases_mm = displacements_of_phases(
          options_.phases, study, setup, options_.registration.rendering, target, request.allowed, notes_);
    Tracker tracker(setup.renderers(), *setup.options().region, study.planned_room_from_patient, target,
                    record_.tracking);
    XrayStream stream(request, study, is_filled());
    follow(tracker, stream, study.image_files);
    if (std::ranges::none_of(record_.rows, [](const TraceRow& row) { return row.frame.is_known; }))
      throw Error(fmt::format("the target was not found in any of {} moments", record_.rows.size()));
    write(output);
    return std::move(record_);
  }

 private:
  bool is_filled() const { return !options_.follow.empty(); }  // the folder of the X-rays

  Eigen::Vector3d target_of(const Study& study) const {
    if (options_.registration.region.structures.empty()) return study.isocenter_patient_mm;
    if (!study.structures)
      throw Error(
          fmt::format("{} ({} names one)", why_no_structures(study.unused_structures), option("structures", "FILE")));
    const Structure& structure = structure_named(*study.structures, options_.registration.region.structures.front());
    return centroid_patient_mm(mask_of(structure, study.ct->hu.size, study.ct->hu.patient_from_voxel));
  }

  // X-rays must be there before anything can be checked: those of the first moment.
  void wait_for_first() const {
    if (!std::filesystem::is_directory(options_.follow))
      throw Error(fmt::format("{}: is not a folder", options_.follow.string()));
    observer_.say("waiting for X-rays in " + options_.follow.string());
    const auto begin = Clock::now();
    while (files_below({options_.follow}).empty()) {
      if (Clock::now() - begin > std::chrono::duration<double>(std::max(60.0, options_.idle_s)))
        throw Error(fmt::format("{}: no X-ray came", options_.follow.string()));
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(500));  // those of the other imager, too
  }

  // The X-rays of the folder that is being filled, without the files that cannot be read: XrayStream tries those again
  // and says which are left aside. Throws Error as the reader of the last file does if none can be read.
  std::vector<std::filesystem::path> readable_xrays() const {
    std::vector<std::filesystem::path> readable;
    std::optional<Error> unreadable;
    for (const std::filesystem::path& file : files_below({options_.follow})) {
      try {
        Notes unimportant;
        read_rt_images(file, unimportant);
        readable.push_back(file);
      } catch (const Error& error) {
        unreadable = error;
      }
    }
    if (readable.empty() && unreadable) throw *unreadable;
    return readable;
  }

  // In a folder that is being filled the first X-rays may be half written.
  Study first_study(StudyRequest request) {
    const auto begin = Clock::now();
    for (;;) {
      try {
        if (is_filled()) request.parts.images = readable_xrays();
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
    if (!is_filled()) stream.offer(files, 1, notes_);
    const std::size_t total = stream.waiting();
    auto last_news = Clock::now();
    for (;;) {
      if (is_filled()) stream.offer(files_below({options_.follow}, stream.done_files()), 100, notes_);
      say_warnings();
      const bool is_idle = Clock::now() - last_news > std::chrono::duration<double>(options_.idle_s);
      const std::vector<TimedXray> moment = stream.next_moment(options_.together_s, !is_filled() || is_idle);
      if (end.is_asked_for() || (moment.empty() && (!is_filled() || is_idle))) break;
      if (moment.empty()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        continue;
      }
      process(tracker, moment, stream.begin_s().value());
      last_news = Clock::now();
      if (is_filled())
        show_where();
      else
        observer_.progress("Following", total - stream.waiting(), total);
    }
    say_warnings();
    record_.imagers = stream.imagers();
    record_.files = stream.counts();
    record_.files.broken += unreadable_;
    for (const double time_s : stream.late_s()) record_.late_s.push_back(time_s - stream.begin_s().value());
  }

  void say_warnings() {
    for (const std::string& warning : notes_.warnings) observer_.say("warning: " + warning);
    notes_.warnings.clear();
  }

  void show_where() const {
    const TrackedFrame& frame = record_.rows.back().frame;
    std::string line = fmt::format("{:8.1f} s  {:<8} ", frame.time_s, to_string(frame.status));
    if (frame.is_known)
      line += fmt::format("target at {:6.1f} {:6.1f} {:6.1f} mm", frame.filtered_mm.x(), frame.filtered_mm.y(),
                          frame.filtered_mm.z());
    observer_.show(line);
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
        notes_.warnings.push_back(fmt::format("left aside: {}", error.what()));
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
    write_text(output.path() / "track.json", json_text(json));
    write_text(output.path() / "trace.svg", trace_svg(record_));
    output.commit();
  }

  const TrackOptions& options_;
  Observer& observer_;
  Notes notes_;
  TrackRecord record_;
  std::optional<DicomFile> file_;
  std::size_t unreadable_ = 0;
};

}  // namespace

TrackRecord track_study(const TrackOptions& options, Observer& observer) { return TrackRun(options, observer).run(); }

}  // namespace isoshift
