// isoshift track: follows a moving target through X-rays over time.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "cli/commands.h"
#include "cli/registration_setup.h"
#include "cli/study_options.h"
#include "cli/xray_stream.h"
#include "geometry/error.h"
#include "geometry/mask.h"
#include "io/motion_trace.h"
#include "io/output_folder.h"
#include "io/report/line_chart.h"
#include "io/structure_mask.h"
#include "registration/motion/score.h"
#include "registration/motion/tracker.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;
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

// One line of the trace.
struct TraceRow {
  TrackedFrame frame;
  double processing_s = 0.0;
};

struct TruthErrors {
  PredictionScore measured;         // in the directions that were seen
  PredictionScore predicted, held;  // held: the last measurement, one latency later
};

// Over the second half of the time: the filters have learned by then.
TruthErrors beside_truth(const std::vector<TraceRow>& rows, const std::vector<MotionSample>& truth, double latency_s) {
  std::vector<double> measured, predicted, held;
  const double from_s = 0.5 * (rows.front().frame.time_s + rows.back().frame.time_s);
  std::optional<Eigen::Vector3d> last_mm;
  for (const TraceRow& row : rows) {
    if (row.frame.measured_mm) last_mm = row.frame.measured_mm;
    if (row.frame.time_s < from_s || !row.frame.is_known) continue;
    const auto now = position_at(truth, row.frame.time_s), later = position_at(truth, row.frame.time_s + latency_s);
    if (now && row.frame.measured_mm) {
      Eigen::Vector3d error_mm = *row.frame.measured_mm - *now;
      for (const Eigen::Vector3d& direction : row.frame.unseen_room) error_mm -= direction.dot(error_mm) * direction;
      measured.push_back(error_mm.norm());
    }
    if (!later) continue;
    predicted.push_back((row.frame.predicted_mm - *later).norm());
    held.push_back((*last_mm - *later).norm());
  }
  return {score_of(std::move(measured)), score_of(std::move(predicted)), score_of(std::move(held))};
}

// When the beam would have to wait: the target, as predicted, farther from its plan than the tolerance, or lost. From
// the moment that says so to the one that ends it.
std::vector<std::pair<double, double>> holds_of(const std::vector<TraceRow>& rows, double tolerance_mm,
                                                double latency_s) {
  std::vector<std::pair<double, double>> holds;
  bool is_holding = false;
  for (const TraceRow& row : rows) {
    const bool must_hold = !row.frame.is_known || row.frame.is_lost || row.frame.predicted_mm.norm() > tolerance_mm;
    const double at_s = row.frame.time_s + latency_s;
    if (must_hold && !is_holding) holds.emplace_back(at_s, at_s);
    if (must_hold || is_holding) holds.back().second = at_s;
    is_holding = must_hold;
  }
  return holds;
}

std::string trace_csv(const std::vector<TraceRow>& rows) {
  std::string csv =
      "t_s,measured_x_mm,measured_y_mm,measured_z_mm,filtered_x_mm,filtered_y_mm,filtered_z_mm,predicted_x_mm,"
      "predicted_y_mm,predicted_z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm,similarity,latency_s,status\n";
  const auto three = [](const Eigen::Vector3d& v) { return fmt::format("{:.4f},{:.4f},{:.4f}", v.x(), v.y(), v.z()); };
  for (const TraceRow& row : rows) {
    const TrackedFrame& frame = row.frame;
    const auto if_known = [&](const Eigen::Vector3d& v) { return frame.is_known ? three(v) : ",,"; };
    csv += fmt::format("{:.4f},{},{},{},{},{:.5f},{:.4f},{}\n", frame.time_s,
                       frame.measured_mm ? three(*frame.measured_mm) : ",,", if_known(frame.filtered_mm),
                       if_known(frame.predicted_mm), if_known(frame.sigma_mm), frame.similarity, row.processing_s,
                       to_string(frame.status));
  }
  return csv;
}

Json errors_json(const PredictionScore& errors) {
  return {{"median_mm", errors.median_mm},
          {"rmse_mm", errors.rmse_mm},
          {"p95_mm", errors.p95_mm},
          {"samples", errors.samples}};
}

std::string chart_of(const std::vector<TraceRow>& rows, const std::vector<MotionSample>& truth, double latency_s) {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e300), high = -low;
  for (const TraceRow& row : rows) {
    low = low.cwiseMin(row.frame.filtered_mm);
    high = high.cwiseMax(row.frame.filtered_mm);
  }
  int axis = 0;
  (high - low).maxCoeff(&axis);
  LineChart chart{.title = fmt::format("Target along {}, from where it was planned", "xyz"[axis]),
                  .x_label = "time, s",
                  .y_label = "mm, IEC 61217 fixed",
                  .curves = {},
                  .from_zero = false};
  LineChart::Curve measured{.name = "measured", .points = {}}, predicted{.name = "predicted", .points = {}},
      true_one{.name = "true", .points = {}};
  for (const TraceRow& row : rows) {
    if (row.frame.measured_mm) measured.points.emplace_back(row.frame.time_s, (*row.frame.measured_mm)[axis]);
    if (row.frame.is_known) predicted.points.emplace_back(row.frame.time_s + latency_s, row.frame.predicted_mm[axis]);
  }
  for (const MotionSample& sample : truth) true_one.points.emplace_back(sample.time_s, sample.position_mm[axis]);
  chart.curves = {measured, predicted};
  if (!truth.empty()) chart.curves.push_back(true_one);
  return line_chart_svg(chart, 1000.0, 360.0);
}

std::vector<std::filesystem::path> files_in(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.is_regular_file() && !entry.path().filename().string().starts_with('.')) files.push_back(entry.path());
  std::ranges::sort(files);
  return files;
}

// The target's displacement in each phase of a 4D CT: found as in X-rays, in DRRs of the phase from two sides.
std::vector<Eigen::VectorXd> displacements_of_phases(const TrackOptions& options, const Study& study,
                                                     const RegistrationSetup& setup, const Eigen::Vector3d& target,
                                                     const Allowances& allowed, Notes& notes) {
  std::vector<Eigen::VectorXd> displacements;
  for (const std::filesystem::path& folder : options.phases) {
    const std::vector<std::filesystem::path> files = files_in(folder);
    const CtSeries phase = read_ct_series(files, allowed, notes, {});
    if (phase.frame_of_reference_uid != study.ct.frame_of_reference_uid)
      throw Error(
          fmt::format("{}: {} is not that of the planning CT", folder.string(), described(DCM_FrameOfReferenceUID)));
    // As two X-rays at right angles would show the phase.
    const RendererPyramid of_phase(options.flags.rendering.kind(), phase.hu, options.flags.rendering.model(),
                                   beams_of(study), options.flags.rendering.options());
    std::vector<FixedImage> views;
    for (const double gantry_deg : {0.0, 90.0}) {
      const XrayView view = make_xray_view({.sad_mm = 1000.0,
                                            .gantry_angle_rad = rad_from_deg(gantry_deg),
                                            .receptor_translation_mm = {0.0, 0.0, -500.0},
                                            .column_spacing_mm = 1.2,
                                            .row_spacing_mm = 1.2,
                                            .position_mm = {-153.0, 153.0},
                                            .columns = 256,
                                            .rows = 256},
                                           study.xrays.front().view.beam);
      const RenderResult drr = of_phase.finest().render(
          std::span(&view, 1), std::span(&study.planned_room_from_patient, 1), PixelSet::all());
      FixedImage image{.view = view,
                       .line_integral = image_of(view, drr.line_integrals(0, 0)),
                       .field = Image<std::uint8_t>(view.columns, view.rows, 1)};
      views.push_back(std::move(image));
    }
    Tracker once(setup.renderers(), *setup.options().region, study.planned_room_from_patient, target, {});
    const TrackedFrame found = once.track(0.0, std::move(views));
    if (!found.measured_mm) throw Error(fmt::format("{}: the target was not found in this phase", folder.string()));
    displacements.emplace_back(*found.measured_mm);
  }
  return displacements;
}

class TrackRun {
 public:
  TrackRun(const TrackOptions& options, Console& console) : options_(options), console_(console) {}

  int run() {
    OutputFolder output(options_.output, options_.overwrite);
    std::vector<MotionSample> truth;
    if (!options_.truth.empty()) truth = read_motion_trace(options_.truth, notes_);
    StudyOptions parts = options_.study;
    if (!options_.follow.empty()) parts.images = {options_.follow};
    StudyRequest request = parts.request();
    request.one_per_imager = true;
    if (!options_.follow.empty()) wait_for_first();
    const Study study = first_study(request);
    say_warnings();
    const RegistrationSetup setup(options_.flags, study);
    const Eigen::Vector3d target = target_of(study);
    TrackingOptions tracking = options_.tracking;
    tracking.latency_s = options_.latency_ms / 1000.0;
    tracking.predictor = predictor_kind_from(options_.predictor).value();
    tracking.dof = options_.six_dof ? Dof::kRigid : Dof::kTranslation;
    if (!options_.phases.empty())
      tracking.predictor_options.phases_mm =
          displacements_of_phases(options_, study, setup, target, request.allowed, notes_);
    Tracker tracker(setup.renderers(), *setup.options().region, study.planned_room_from_patient, target, tracking);
    XrayStream stream(request, study, !options_.follow.empty());
    follow(tracker, stream, request);
    if (std::ranges::none_of(rows_, [](const TraceRow& row) { return row.frame.is_known; }))
      throw Error(fmt::format("the target was not found in any of {} moments", rows_.size()));
    write(output, study, stream, truth, tracking);
    return kExitAccepted;
  }

 private:
  Eigen::Vector3d target_of(const Study& study) const {
    if (options_.flags.region.structures.empty()) return study.isocenter_patient_mm;
    if (!study.structures) throw Error("the study holds no RT Structure Set (--structures FILE names one)");
    const Structure& structure = structure_named(*study.structures, options_.flags.region.structures.front());
    return centroid_patient_mm(mask_of(structure, study.ct.hu.size, study.ct.hu.patient_from_voxel));
  }

  // X-rays must be there before anything can be checked: those of the first moment.
  void wait_for_first() {
    if (!std::filesystem::is_directory(options_.follow))
      throw Error(fmt::format("{}: is no folder", options_.follow.string()));
    console_.err << "waiting for X-rays in " << options_.follow.string() << "\n";
    const auto begin = Clock::now();
    for (;;) {
      if (const auto files = files_in(options_.follow); !files.empty()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(500));  // those of the other imager, too
        break;
      }
      if (Clock::now() - begin > std::chrono::duration<double>(std::max(60.0, options_.idle_s)))
        throw Error(fmt::format("{}: no X-ray came", options_.follow.string()));
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
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
        if (options_.follow.empty() || Clock::now() - begin > kLongest) throw;
        std::this_thread::sleep_for(std::chrono::milliseconds(200));
      }
    }
  }

  void follow(Tracker& tracker, XrayStream& stream, const StudyRequest& request) {
    const bool goes_on = !options_.follow.empty();
    const std::vector<std::filesystem::path> files =
        goes_on ? std::vector<std::filesystem::path>() : find_parts(request.parts).images;
    std::unique_ptr<ProgressBar> bar;
    if (!goes_on) {
      stream.offer(files, 1, notes_);
      bar = std::make_unique<ProgressBar>(console_, "Following");
    }
    const std::size_t total = stream.waiting();
    auto last_news = Clock::now();
    for (;;) {
      if (goes_on) stream.offer(files_in(options_.follow), 100, notes_);
      say_warnings();
      const bool is_idle = Clock::now() - last_news > std::chrono::duration<double>(options_.idle_s);
      const std::vector<TimedXray> moment = stream.next_moment(options_.together_ms / 1000.0, !goes_on || is_idle);
      if (!moment.empty()) {
        process(tracker, moment, stream.begin_s().value());
        last_news = Clock::now();
        if (bar) bar->update(total - stream.waiting(), total);
        continue;
      }
      if (!goes_on || is_idle) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    say_warnings();
  }

  void say_warnings() {
    for (const std::string& warning : notes_.warnings) console_.err << "warning: " << warning << "\n";
    notes_.warnings.clear();
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
    TraceRow row;
    row.frame = tracker.track(time_s - begin_s, std::move(views));
    row.processing_s = std::chrono::duration<double>(Clock::now() - begin).count();
    rows_.push_back(std::move(row));
  }

  Json summary(const Study& study, const XrayStream& stream, const std::vector<MotionSample>& truth,
               const TrackingOptions& tracking) const {
    std::vector<double> times_s;
    std::map<std::string, std::size_t> by_status;
    std::size_t late = 0;
    for (const TraceRow& row : rows_) {
      times_s.push_back(row.processing_s);
      ++by_status[std::string(to_string(row.frame.status))];
      late += row.processing_s > options_.budget_ms / 1000.0;
    }
    std::ranges::sort(times_s);
    Json json = {{"schema", 1},
                 {"frames", rows_.size()},
                 {"imagers", study.rt_images.size()},
                 {"status", by_status},
                 {"predictor", to_string(tracking.predictor)},
                 {"latency_ms", options_.latency_ms},
                 {"dof", options_.six_dof ? "rigid" : "translation"},
                 {"processing_s",
                  {{"median", times_s[times_s.size() / 2]},
                   {"p95", times_s[static_cast<std::size_t>(0.95 * static_cast<double>(times_s.size() - 1))]},
                   {"max", times_s.back()},
                   {"budget", options_.budget_ms / 1000.0}}},
                 {"share_in_time", 1.0 - static_cast<double>(late) / static_cast<double>(rows_.size())},
                 {"over_budget", late},
                 {"files",
                  {{"repeated", stream.counts().repeated},
                   {"late", stream.counts().late},
                   {"broken", stream.counts().broken + unreadable_}}}};
    if (options_.tolerance_mm) {
      json["tolerance_mm"] = *options_.tolerance_mm;
      json["beam_holds_s"] = Json::array();
      for (const auto& [from, to] : holds_of(rows_, *options_.tolerance_mm, tracking.latency_s))
        json["beam_holds_s"].push_back({from, to});
    }
    if (!truth.empty()) {
      const TruthErrors errors = beside_truth(rows_, truth, tracking.latency_s);
      json["beside_truth"] = {{"scored", "second half of the time"},
                              {"measured", errors_json(errors.measured)},
                              {"predicted", errors_json(errors.predicted)},
                              {"hold_last", errors_json(errors.held)}};
    }
    return json;
  }

  void write(OutputFolder& output, const Study& study, const XrayStream& stream, const std::vector<MotionSample>& truth,
             const TrackingOptions& tracking) {
    const Json json = summary(study, stream, truth, tracking);
    write_text(output.path() / "trace.csv", trace_csv(rows_));
    write_text(output.path() / "track.json", json.dump(2) + "\n");
    write_text(output.path() / "trace.svg", chart_of(rows_, truth, tracking.latency_s));
    output.commit();
    if (options_.json) {
      console_.out << json.dump(2) << "\n";
      return;
    }
    std::string status;
    for (const auto& [name, count] : json["status"].items())
      status += fmt::format("{}{} {}", status.empty() ? "" : ", ", count.get<std::size_t>(), name);
    const Json& seconds = json["processing_s"];
    console_.out << fmt::format(
        "{} moments of {} imager{}: {}\ntime per moment: median {:.3f} s, 95th percentile {:.3f} s; {:.1f} % within "
        "{:.0f} ms\n",
        rows_.size(), study.rt_images.size(), study.rt_images.size() == 1 ? "" : "s", status,
        seconds["median"].get<double>(), seconds["p95"].get<double>(), 100.0 * json["share_in_time"].get<double>(),
        options_.budget_ms);
    if (json.contains("beside_truth"))
      for (const auto& [key, words] : {std::pair("measured", "measured"), std::pair("predicted", "predicted"),
                                       std::pair("hold_last", "hold-last")})
        console_.out << fmt::format("{:<10} beside the truth: median {:.2f}, RMSE {:.2f}, 95th percentile {:.2f} mm\n",
                                    words, json["beside_truth"][key]["median_mm"].get<double>(),
                                    json["beside_truth"][key]["rmse_mm"].get<double>(),
                                    json["beside_truth"][key]["p95_mm"].get<double>());
    if (json.contains("beam_holds_s"))
      console_.out << fmt::format("beyond {} mm the beam would wait {} times\n", *options_.tolerance_mm,
                                  json["beam_holds_s"].size());
    console_.out << fmt::format("\nWritten to {}\n", output.destination().string());
  }

  const TrackOptions& options_;
  Console& console_;
  Notes notes_;
  std::vector<TraceRow> rows_;
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
      ->add_option("--follow", options->follow, "Folder that is being filled with X-rays; ends when none come any more")
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
