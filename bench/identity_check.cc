// Who is on the table, and are the images what they say? Registers phantom patients with their own X-rays, with X-rays
// that were mirrored, turned, exchanged or taken from the other side, and with those of all other patients; where the
// patient as a whole is not accepted, also the bodies about the isocenter, as `isoshift register` does. Prints a line
// of CSV per registration and a summary; exits with 1 if anything wrong was accepted.
//
//   identity_check [patients=20 [only the CT of patient]] > identity.csv

#include <fmt/format.h>

#include <algorithm>
#include <iostream>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <random>

#include "base/error.h"
#include "bench/scene.h"
#include "geometry/target_error.h"
#include "registration/presets.h"
#include "registration/target/target_registration.h"

namespace isoshift {
namespace {

constexpr int kPixels = 512;
constexpr std::array kGantryAnglesDeg = {0.0, 90.0};

struct Patient {
  bool is_head = true;
  std::vector<Shape> shapes;
  Eigen::Isometry3d setup_error;
  std::vector<XrayImage> xrays;
};

// Every fourth one a spine, lying off plan by up to 8 mm and 3 degrees per axis.
Patient make_patient(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> within(-1.0, 1.0);
  const auto vector = [&] { return Eigen::Vector3d(within(random), within(random), within(random)); };
  Placement placement;
  placement.translation_mm = 8.0 * vector();
  placement.rotation_deg = 3.0 * vector();
  Patient patient{.is_head = seed % 4 != 0, .setup_error = Eigen::Isometry3d::Identity()};
  patient.shapes =
      patient.is_head ? head_phantom(Eigen::Vector3d::Zero(), seed) : spine_phantom(Eigen::Vector3d::Zero(), seed);
  patient.setup_error.linear() = placement.rotation();
  patient.setup_error.translation() = placement.translation_mm;
  for (const double gantry_deg : kGantryAnglesDeg) {
    XrayImage xray{.label = fmt::format("G{:.0f}", gantry_deg), .view = bench_view(gantry_deg, kPixels)};
    xray.values =
        simulate_xray(patient.shapes, placement,
                      {.gantry_angle_deg = gantry_deg, .pixels = kPixels, .pixel_mm = 410.0 / kPixels}, 20000.0, seed);
    patient.xrays.push_back(std::move(xray));
  }
  return patient;
}

Volume<float> ct_of(const Patient& patient) {
  const Eigen::Vector3i size = patient.is_head ? Eigen::Vector3i(190, 230, 144) : Eigen::Vector3i(320, 220, 120);
  const Eigen::Vector3d spacing_mm(1.0, 1.0, 1.5);
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();
  patient_from_voxel.linear() = spacing_mm.asDiagonal();
  patient_from_voxel.translation() = -0.5 * (size.cast<double>().cwiseProduct(spacing_mm) - spacing_mm);
  return ct_of_shapes(patient.shapes, size, patient_from_voxel);
}

// The bone nearest to the isocenter. Planned, the room's axes are (x, z, -y) of the patient.
Target target_of(const BodyMap& map) {
  Target target{.name = "bone", .chosen_by = "identity_check"};
  double nearest_mm = std::numeric_limits<double>::infinity();
  for (const Body& body : map.bodies) {
    const Eigen::Vector3d& center = body.center_patient_mm;
    if (body.kind == Body::Kind::kCouch || center.norm() >= nearest_mm) continue;
    nearest_mm = center.norm();
    target.center_room_mm = {center.x(), center.z(), -center.y()};
  }
  return target;
}

XrayImage mirrored(XrayImage xray) {
  for (int row = 0; row < xray.values.rows; ++row) {
    const auto begin = xray.values.pixels.begin() + static_cast<std::ptrdiff_t>(row) * xray.values.columns;
    std::reverse(begin, begin + xray.values.columns);
  }
  return xray;
}

XrayImage turned(XrayImage xray) {
  std::ranges::reverse(xray.values.pixels);
  return xray;
}

// What may be wrong with a patient's own images.
std::vector<std::pair<std::string, std::vector<XrayImage>>> variants(const std::vector<XrayImage>& xrays) {
  std::vector<std::pair<std::string, std::vector<XrayImage>>> list = {{"right", xrays}};
  const auto with = [&](std::size_t view, const XrayImage& image) {
    std::vector<XrayImage> changed = xrays;
    changed[view] = image;
    return changed;
  };
  list.emplace_back("AP mirrored", with(0, mirrored(xrays[0])));
  list.emplace_back("lateral mirrored", with(1, mirrored(xrays[1])));
  list.emplace_back("AP turned", with(0, turned(xrays[0])));
  std::vector<XrayImage> changed = xrays;
  std::swap(changed[0].view, changed[1].view);
  list.emplace_back("angles exchanged", changed);
  for (std::size_t view = 0; view < 2; ++view) {
    changed = xrays;
    changed[view].view = bench_view(kGantryAnglesDeg[view] + 180.0, kPixels);
    list.emplace_back(fmt::format("gantry + 180 in view {}", view + 1), changed);
  }
  changed = xrays;
  for (std::size_t view = 0; view < 2; ++view) changed[view].view = bench_view(kGantryAnglesDeg[view] + 180.0, kPixels);
  list.emplace_back("gantry + 180 in both", changed);
  return list;
}

// Long because a row of the table takes many figures of one registration.
int check(int patient_count, std::optional<int> only) {
  std::vector<Patient> patients;
  patients.reserve(static_cast<std::size_t>(patient_count));
  constexpr std::uint64_t kFirstSeed = 100;
  for (int n = 0; n < patient_count; ++n) patients.push_back(make_patient(kFirstSeed + static_cast<std::uint64_t>(n)));
  Eigen::Isometry3d planned = Eigen::Isometry3d::Identity();  // HFS: (x, y, z) of the room is (x, z, -y) of the patient
  planned.linear() << 1, 0, 0, 0, 0, 1, 0, -1, 0;

  struct Count {
    int all = 0, accepted = 0;
  };
  std::map<std::string, Count> counts;
  bool wrong_accepted = false;
  fmt::print(
      "ct,xrays,case,verdict,answer_of,match_within_40_mm,match_within_20_mm,match,match_of_parts,mtre_mm,least_"
      "gradient_correlation,as_is,"
      "best_"
      "alternative,disagreeing,seconds,"
      "err_sigma,reasons\n");
  const auto one = [&](const TargetRegistration& registration, int ct, int of, const std::string& what,
                       const std::vector<XrayImage>& xrays) {
    Count& count = counts[what];
    ++count.all;
    RegistrationResult result;
    try {
      result = registration.from(planned, prepared(xrays));
    } catch (const Error& error) {
      fmt::print("{},{},{},error,,,,,,,,,,,,\"{}\"\n", ct, of, what, error.what());
      return;
    }
    const Eigen::Isometry3d found = result.actual_room_from_patient * planned.inverse();
    double least = 1.0, disagreeing = 0.0, best = 0.0;  // of the worst view
    for (const ViewMatch& view : result.views) {
      least = std::min(least, view.similarity_final);
      disagreeing = std::max(disagreeing, static_cast<double>(view.consistency.disagreeing()) /
                                              std::max(1, view.consistency.with_signal()));
    }
    double as_is = 0.0;
    for (const Alternative& alternative : result.alternatives)
      if (alternative.similarity > best) {
        best = alternative.similarity;
        as_is = alternative.as_is;
      }
    const double mtre_mm = mean_target_registration_error_mm(found, patients[static_cast<std::size_t>(of)].setup_error,
                                                             standard_targets_mm());
    std::string errors, reasons;
    const Eigen::Isometry3d error = found * patients[static_cast<std::size_t>(of)].setup_error.inverse();
    const Eigen::AngleAxisd turn(error.linear());
    for (int axis = 0; axis < 3 && result.uncertainty; ++axis)
      errors +=
          fmt::format("{:.3f}/{:.3f} ", error.translation()[axis], result.uncertainty->sigma_translation_mm()[axis]);
    for (int axis = 0; axis < 3 && result.uncertainty; ++axis)
      errors += fmt::format("{:.3f}/{:.3f} ", deg_from_rad(turn.angle() * turn.axis()[axis]),
                            deg_from_rad(result.uncertainty->sigma_rotation_rad()[axis]));
    for (const std::string& reason : result.reasons()) reasons += reason + "; ";
    fmt::print("{},{},{},{},{},{:.3f},{:.3f},{:.3f},{:.3f},{:.2f},{:.3f},{:.3f},{:.3f},{:.3f},{:.2f},{},\"{}\"\n", ct,
               of, what, to_string(result.verdict()), result.bodies.empty() ? "whole" : "bodies",
               result.target_match.of_most_within_40_mm, result.target_match.of_most_within_20_mm,
               result.target_match.of_all, result.target_match.of_parts, mtre_mm, least, as_is, best, disagreeing,
               result.seconds, errors, reasons);
    std::fflush(stdout);
    count.accepted += result.verdict() == Verdict::kAccepted ? 1 : 0;
    wrong_accepted = wrong_accepted || (result.verdict() == Verdict::kAccepted && (what != "right" || mtre_mm > 2.0));
  };
  for (int ct = 0; ct < patient_count; ++ct) {
    if (only && ct != *only) continue;
    const auto hu = std::make_shared<const Volume<float>>(ct_of(patients[static_cast<std::size_t>(ct)]));
    const RendererPyramid renderers(RendererKind::kCpu, *hu, {}, std::array{Beam::kKilovoltage});
    BodyStore bodies;
    const TargetRegistration registration({.patient = {.ct_hu = hu, .room_from_patient = planned},
                                           .target = target_of(*bodies.map(hu)),
                                           .options = preset("setup")},
                                          renderers, *hu, bodies);
    for (const auto& [what, xrays] : variants(patients[static_cast<std::size_t>(ct)].xrays))
      one(registration, ct, ct, what, xrays);
    const std::vector<XrayImage>& own = patients[static_cast<std::size_t>(ct)].xrays;
    const std::size_t next = static_cast<std::size_t>((ct + 1) % patient_count);
    if (patient_count > 1) one(registration, ct, ct, "lateral of another patient", {own[0], patients[next].xrays[1]});
    for (int of = 0; of < patient_count; ++of)
      if (of != ct) one(registration, ct, of, "another patient", patients[static_cast<std::size_t>(of)].xrays);
  }
  for (const auto& [what, count] : counts)
    std::cerr << fmt::format("{:<24} {:>4} of {:>4} accepted\n", what, count.accepted, count.all);
  return wrong_accepted ? 1 : 0;
}

}  // namespace
}  // namespace isoshift

int main(int argc, char** argv) {
  return isoshift::check(argc > 1 ? std::atoi(argv[1]) : 20,
                         argc > 2 ? std::optional(std::atoi(argv[2])) : std::nullopt);
}
