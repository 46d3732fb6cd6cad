#include "phantom/study_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>
#include <set>

#include "base/error.h"
#include "base/output_folder.h"
#include "geometry/patient_setup.h"
#include "phantom/study_objects.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

Json list(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json rows(const Eigen::Matrix3d& matrix) {
  Json result = Json::array();
  for (int row = 0; row < 3; ++row) result.push_back({matrix(row, 0), matrix(row, 1), matrix(row, 2)});
  return result;
}

// Each body is followed through the room: from where it was planned to where it lies now.
Json truth_of_bodies(const PhantomOptions& options) {
  const Placement& placement = options.placement;
  Placement as_planned = placement;
  as_planned.translation_mm.setZero();
  as_planned.rotation_deg.setZero();
  Json bodies = Json::array();
  for (const auto& [body, moved_from_planned] : phantom_of(options).bodies) {
    const auto found_at = [&](const Eigen::Vector3d& planned_fixed_mm) {
      return placement.fixed_from_patient(moved_from_planned * as_planned.patient_from_fixed(planned_fixed_mm));
    };
    const Eigen::Vector3d translation_mm = found_at(Eigen::Vector3d::Zero());
    Eigen::Matrix3d rotation;
    for (int axis = 0; axis < 3; ++axis) rotation.col(axis) = found_at(Eigen::Vector3d::Unit(axis)) - translation_mm;
    bodies.push_back({{"name", body.name},
                      {"center_patient_mm", list(body.center_patient_mm)},
                      {"rotation_matrix", rows(rotation)},
                      {"translation_mm", list(translation_mm)}});
  }
  return bodies;
}

void write_truth(const PhantomOptions& options, const std::filesystem::path& path) {
  const Placement& placement = options.placement;
  const bool is_bent = !options.bends.empty();
  Json truth = {{"isocenter_patient_mm", list(placement.isocenter_patient_mm)},
                {"patient_position", placement.patient_position},
                {"couch_deg", placement.couch_angle_deg}};
  Json& error = truth["setup_error_room"];
  if (is_bent) error["center_patient_mm"] = list(placement.isocenter_patient_mm);
  error["translation_mm"] = list(placement.translation_mm);
  error["rotation_deg_rx_ry_rz"] = list(placement.rotation_deg);
  error["rotation_matrix"] = rows(placement.rotation());
  error["means"] =
      fmt::format("anatomy{} planned at x (IEC 61217 fixed, mm from the isocenter) is found at R x + t; R = Rz Rx Ry",
                  is_bent ? " at the target's center" : "");
  if (is_bent) {
    for (const Bend& bend : options.bends) truth["bends"].push_back(bend.text());
    truth["bodies"] = truth_of_bodies(options);
    truth["bodies_mean"] = "the same for each rigid body of the phantom";
  }
  write_text(path, truth.dump(1) + "\n");
}

// The 4D CT and the X-rays of all moments, with the truth of each.
void write_breathing(const PhantomOptions& options, const StudyUids& study, Uids& uids,
                     const std::filesystem::path& folder, const Progress& progress) {
  const BreathingOptions& breathing = options.breathing;
  const Breathing motion(breathing, options.seed);
  for (int phase = 0; phase < breathing.phases; ++phase) {
    const std::filesystem::path path = folder / "PHASES" / fmt::format("{:02}", phase);
    std::filesystem::create_directories(path);
    write_ct(options, study, uids.next(),
             Breathing::phase_displacement_mm(static_cast<double>(phase) / breathing.phases), uids, path, {});
  }
  const Placement& placement = options.placement;
  const Eigen::Vector3d planned_mm = placement.isocenter_patient_mm;
  Placement as_planned = placement;
  as_planned.translation_mm.setZero();
  as_planned.rotation_deg.setZero();
  std::string truth = "t_s,x_mm,y_mm,z_mm\n";
  std::filesystem::create_directories(folder / "RTIMAGE");
  const int moments = static_cast<int>(breathing.seconds * breathing.rate_hz);
  const auto imagers = options.gantry_angles_deg.size();
  for (int n = 0; n < moments; ++n) {
    Moment moment{.time_s = n / breathing.rate_hz, .instance = n + 1, .displacement_mm = {}, .noise_seed = 0};
    moment.displacement_mm = motion.displacement_mm(moment.time_s);
    const Eigen::Vector3d moved_mm =
        placement.fixed_from_patient(planned_mm + moment.displacement_mm) - as_planned.fixed_from_patient(planned_mm);
    truth += fmt::format("{:.4f},{:.6f},{:.6f},{:.6f}\n", moment.time_s, moved_mm.x(), moved_mm.y(), moved_mm.z());
    for (std::size_t imager = 0; imager < imagers; ++imager) {
      moment.noise_seed = (options.seed * 1000 + imager) * 1'000'003 + static_cast<std::uint64_t>(n);
      write_xray(
          options, study, uids.next(), imager, moment,
          folder / "RTIMAGE" / fmt::format("{}_{:05}.dcm", image_label(options.gantry_angles_deg[imager]), n + 1));
    }
    if (progress) progress(static_cast<std::size_t>(n) + 1, static_cast<std::size_t>(moments));
  }
  write_text(folder / "truth.csv", truth);
}

// The session of a day: an X-ray at each gantry angle.
void write_session(const PhantomOptions& options, const StudyUids& study, Uids& uids, int day,
                   const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  const std::uint64_t seed = (options.seed + static_cast<std::uint64_t>(day - 1) * 1'000'003) * 1000;
  for (std::size_t n = 0; n < options.gantry_angles_deg.size(); ++n)
    write_xray(options, study, uids.next(), n,
               {.time_s = 10.0 * static_cast<double>(n),
                .instance = static_cast<int>(n + 1),
                .displacement_mm = Eigen::Vector3d::Zero(),
                .noise_seed = seed + n,
                .day = day},
               folder / fmt::format("{}.dcm", image_label(options.gantry_angles_deg[n])));
}

void write_later_fractions(const PhantomOptions& options, const StudyUids& study, Uids& uids,
                           const std::filesystem::path& folder) {
  std::mt19937_64 random(options.seed);
  std::normal_distribution<double> translation(0.0, 2.0), rotation(0.0, 0.7);
  for (int fraction = 2; fraction <= options.fractions; ++fraction) {
    PhantomOptions of_day = options;
    for (double& mm : of_day.placement.translation_mm) mm += translation(random);
    for (double& deg : of_day.placement.rotation_deg) deg += rotation(random);
    const std::string name = fmt::format("F{:02}", fraction);
    write_session(of_day, study, uids, fraction, folder / "RTIMAGE" / name);
    write_truth(of_day, folder / fmt::format("truth_{}.json", name));
  }
}

}  // namespace

std::string_view anatomy_name(PhantomOptions::Anatomy anatomy) {
  switch (anatomy) {
    case PhantomOptions::Anatomy::kHead: return "head";
    case PhantomOptions::Anatomy::kSpine: return "spine";
    case PhantomOptions::Anatomy::kThorax: return "thorax";
    case PhantomOptions::Anatomy::kBalls: return "balls";
  }
  return "";
}

void PhantomOptions::check() const {
  constexpr double kTurnDeg = 360.0, kFarthestMm = 1000.0;
  if (!patient_position_from(placement.patient_position))
    throw UsageError(fmt::format("patient position {} is not one of HFS, HFP, FFS, FFP, HFDR, HFDL, FFDR, FFDL",
                                 placement.patient_position));
  if (!(voxel_mm >= 0.5 && voxel_mm <= 5.0))
    throw UsageError(fmt::format("voxel size {} mm is not within 0.5 to 5", voxel_mm));
  if (image_pixels < 64 || image_pixels > 2048)
    throw UsageError(fmt::format("{} image pixels are not within 64 to 2048", image_pixels));
  if (gantry_angles_deg.empty() || gantry_angles_deg.size() > 12) throw UsageError("1 to 12 gantry angles are needed");
  std::set<std::string> labels;
  for (const double angle_deg : gantry_angles_deg)
    if (!(std::abs(angle_deg) <= kTurnDeg) || !labels.insert(image_label(angle_deg)).second)
      throw UsageError(
          fmt::format("gantry angle {}: expected angles of -360 to 360, a degree or more apart", angle_deg));
  if (!(std::abs(placement.couch_angle_deg) <= kTurnDeg) || !(std::abs(receptor_angle_deg) <= kTurnDeg))
    throw UsageError(fmt::format("couch angle {} and receptor angle {}: expected -360 to 360 degrees",
                                 placement.couch_angle_deg, receptor_angle_deg));
  const auto is_within = [](const auto& components, double most) { return (components.array().abs() <= most).all(); };
  if (!is_within(placement.translation_mm, kFarthestMm) || !is_within(placement.rotation_deg, kTurnDeg) ||
      !is_within(panel_fault.shift_mm, kFarthestMm) || !is_within(panel_fault.turn_deg, kTurnDeg))
    throw UsageError(
        "setup error and the panel's fault: expected at most 1000 mm in each direction, and 360 degrees about it");
  if (!(std::abs(ct_tilt_deg) <= 30.0))
    throw UsageError(fmt::format("a CT tilt of {} degrees is not within 30", ct_tilt_deg));
  check_bends(bends, anatomy_name(anatomy), placement.patient_position);
  if (breathing.seconds != 0.0 && anatomy != Anatomy::kThorax)
    throw UsageError("only a thorax breathes: --anatomy thorax");
  if (!(breathing.seconds >= 0.0 && breathing.seconds <= 7200.0) ||
      !(breathing.rate_hz >= 0.1 && breathing.rate_hz <= 50.0))
    throw UsageError(fmt::format("{} s of breathing at {} Hz: expected at most 7200 s at 0.1 to 50 Hz",
                                 breathing.seconds, breathing.rate_hz));
  if (fractions < 1 || fractions > 31 || (fractions > 1 && breathing.seconds > 0.0))
    throw UsageError(fmt::format("{} fractions: expected 1 to 31, and one of a phantom that breathes", fractions));
  for (const double angle_deg : megavoltage_angles_deg)
    if (std::ranges::find(gantry_angles_deg, angle_deg) == gantry_angles_deg.end())
      throw UsageError(fmt::format("no X-ray is taken at gantry angle {}, which is to be MV", angle_deg));
  if (!(photons >= 0.0 && std::isfinite(photons)))
    throw UsageError(fmt::format("{} photons: expected 0 or more", photons));
}

BentPhantom phantom_of(const PhantomOptions& options, const Eigen::Vector3d& target_displacement_mm) {
  const Eigen::Vector3d& isocenter = options.placement.isocenter_patient_mm;
  PhantomParts parts;
  BendingAnatomy anatomy{.isocenter_patient_mm = isocenter};
  switch (options.anatomy) {
    case PhantomOptions::Anatomy::kHead:
      parts = head_parts(isocenter, options.seed);
      anatomy.spine_from_isocenter_mm = Eigen::Vector3d(0, 24, 0);
      anatomy.couch_top_from_isocenter_mm = 101.0;
      anatomy.couch_width_mm = 170.0;
      break;
    case PhantomOptions::Anatomy::kSpine:
      parts = spine_parts(isocenter, options.seed);
      anatomy.spine_from_isocenter_mm = Eigen::Vector3d::Zero();
      anatomy.couch_top_from_isocenter_mm = 70.0;
      anatomy.couch_width_mm = 400.0;
      break;
    case PhantomOptions::Anatomy::kThorax:
      parts = thorax_parts(isocenter, options.seed, target_displacement_mm);
      if (std::ranges::find(options.bends, Bend::Kind::kShoulders, &Bend::kind) != options.bends.end())
        add_shoulders(parts, isocenter, options.seed);
      anatomy.spine_from_isocenter_mm = Eigen::Vector3d(65, 70, 0);
      anatomy.couch_top_from_isocenter_mm = 123.0;
      anatomy.couch_width_mm = 400.0;
      break;
    case PhantomOptions::Anatomy::kBalls: parts = ball_parts(isocenter, options.seed); break;
  }
  if (!options.bends.empty()) make_vertebrae_differ(parts, options.seed);
  return bent(std::move(parts), options.bends, anatomy);
}

bool has_target(const PhantomOptions& options) {
  return options.anatomy == PhantomOptions::Anatomy::kThorax || !options.bends.empty();
}

void write_phantom_study(const PhantomOptions& options, const std::filesystem::path& folder, const Progress& progress) {
  options.check();
  Uids uids(options.seed);
  StudyUids study = make_uids(options, uids);
  const bool breathes = options.breathing.seconds > 0.0;
  study.ct_instances = write_ct(options, study, study.ct_series, Eigen::Vector3d::Zero(), uids, folder / "CT",
                                breathes ? Progress() : progress);
  if (has_target(options)) study.structures = uids.next();
  write_plan(options, study, folder / "RTPLAN.dcm");
  if (!breathes) write_session(options, study, uids, 1, folder / "RTIMAGE");
  if (has_target(options)) write_structures(options, study, uids, folder / "RTSTRUCT.dcm");
  if (breathes) write_breathing(options, study, uids, folder, progress);
  write_later_fractions(options, study, uids, folder);
  write_truth(options, folder / "truth.json");
}

}  // namespace isoshift
