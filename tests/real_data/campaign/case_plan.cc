#include "tests/real_data/campaign/case_plan.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace isoshift::campaign {
namespace {

using Eigen::Vector3d;

// Seeds of the two series.
bool is_of_breathing(std::uint64_t seed) { return seed >= 2000 && seed < 3000; }
bool is_of_levels(std::uint64_t seed) { return seed >= 3000 && seed < 4000; }
constexpr std::array kStrataOfLevels = {"undisturbed", "bent", "breathing", "tissue", "small-field"};

constexpr double kRadPerDeg = std::numbers::pi / 180.0;

// Numbers that are the same with every standard library: std::uniform_real_distribution is not.
class Draw {
 public:
  explicit Draw(std::uint64_t seed) : random_(seed) {}
  double between(double low, double high) {
    return low + (high - low) * static_cast<double>(random_() >> 11) * 0x1.0p-53;
  }
  bool one_in_two() { return between(0.0, 1.0) < 0.5; }
  double sign() { return one_in_two() ? 1.0 : -1.0; }
  Vector3d direction() {
    for (;;) {
      const Vector3d v(between(-1, 1), between(-1, 1), between(-1, 1));
      if (v.norm() > 0.1 && v.norm() <= 1.0) return v.normalized();
    }
  }

 private:
  std::mt19937_64 random_;
};

// About x, y, z: R = Rz Rx Ry.
Eigen::Matrix3d rotation_of(const Vector3d& deg) {
  return (Eigen::AngleAxisd(deg.z() * kRadPerDeg, Vector3d::UnitZ()) *
          Eigen::AngleAxisd(deg.x() * kRadPerDeg, Vector3d::UnitX()) *
          Eigen::AngleAxisd(deg.y() * kRadPerDeg, Vector3d::UnitY()))
      .toRotationMatrix();
}

void draw_setup(CasePlan& plan, Draw& draw) {
  constexpr double kFarthestMm = 15.0, kMostDeg = 2.5;
  if (plan.anatomy == "head") {
    plan.setup.isocenter_patient_mm = Vector3d(draw.between(-8, 8), draw.between(98, 122), draw.between(758, 778));
    plan.target_radius_mm = draw.between(25, 35);
  } else {
    plan.setup.isocenter_patient_mm = chest_spine_mm(draw.between(-215, -140));
    plan.target_radius_mm = draw.between(20, 30);
  }
  plan.setup.translation_mm = draw.between(0.0, kFarthestMm) * draw.direction();
  // A vertebra along the couch, or a little more or less.
  if (is_of_levels(plan.seed))
    plan.setup.translation_mm = Vector3d(0.0, draw.sign() * draw.between(20.0, 30.0), 0.0) + 4.0 * draw.direction();
  plan.setup.rotation = rotation_of(
      {draw.between(-kMostDeg, kMostDeg), draw.between(-kMostDeg, kMostDeg), draw.between(-kMostDeg, kMostDeg)});
}

// Flexion, to the side or a twist, in this order of frequency.
Vector3d bending_axis(Draw& draw) {
  const double which = draw.between(0.0, 1.0);
  return which < 0.5 ? Vector3d::UnitX() : which < 0.8 ? Vector3d::UnitY() : Vector3d::UnitZ();
}

void bend(CasePlan& plan, Draw& draw) {
  constexpr double kMostDeg = 8.0;
  const auto part = [&](const Vector3d& start_mm, double direction, double growth_mm, const char* name) {
    const Vector3d axis = bending_axis(draw);
    const double deg = draw.between(-kMostDeg, kMostDeg);
    plan.bendings.push_back({start_mm, direction, growth_mm, axis, deg * kRadPerDeg});
    plan.disturbances.push_back(fmt::format("{} bent by {:.1f} degrees about ({:.0f}), growing over {:.0f} mm", name,
                                            deg, fmt::join(axis, ", "), growth_mm));
  };
  if (plan.anatomy == "head") {
    // The base of the skull against its vault.
    part({0.0, 110.0, plan.setup.isocenter_patient_mm.z() - draw.between(18, 25)}, -1.0, draw.between(60, 70),
         "skull base");
    return;
  }
  // Near the target nothing bends: its motion is one.
  const double gap_mm = draw.between(12, 20), z = plan.setup.isocenter_patient_mm.z();
  part(chest_spine_mm(z + gap_mm), 1.0, draw.between(60, 110), "upper spine");
  part(chest_spine_mm(z - gap_mm), -1.0, draw.between(60, 110), "lower spine");
}

void breathe(CasePlan& plan, Draw& draw) {
  const double drawn_mm = draw.between(2.0, 14.0), forward = draw.between(0.2, 0.4);
  const double mm = is_of_breathing(plan.seed) ? 2.0 + static_cast<double>(plan.seed % 13) : drawn_mm;
  // Toward the feet and to the front.
  plan.breath = {.amplitude_mm = Vector3d(0.0, -forward * mm, -mm),
                 .still_behind_mm = plan.setup.isocenter_patient_mm.y() - 25.0,
                 .full_before_mm = plan.setup.isocenter_patient_mm.y() - 75.0};
  plan.disturbances.push_back(fmt::format("breathing of {:.1f} mm", mm));
}

void change_tissue(CasePlan& plan, Draw& draw) {
  if (plan.anatomy == "head") {
    plan.holder_is_gone = true;
    plan.disturbances.emplace_back("head holder missing");
    return;
  }
  const double which = draw.between(0.0, 1.0);
  if (which < 0.5) {
    plan.lost_mm = draw.between(4, 14);
    plan.disturbances.push_back(fmt::format("{:.0f} mm of tissue lost", plan.lost_mm));
  }
  if (which > 0.35 && which < 0.75)
    for (int n = 0; n < 3; ++n) {
      plan.gas.push_back({plan.setup.isocenter_patient_mm +
                              Vector3d(draw.between(-70, 70), draw.between(-150, -60), draw.between(-100, -20)),
                          Vector3d(draw.between(10, 30), draw.between(10, 20), draw.between(10, 30))});
      if (n == 0) plan.disturbances.emplace_back("gas");
    }
  if (which > 0.7) {
    plan.effusion_behind_mm = plan.setup.isocenter_patient_mm.y() + draw.between(-30, 20);
    plan.disturbances.emplace_back("pleural effusion");
  }
}

void put_in_metal(CasePlan& plan, Draw& draw) {
  const int count = 1 + static_cast<int>(draw.between(0.0, 3.999));
  for (int n = 0; n < count; ++n) {
    const double length_mm = draw.between(0.1, 60.0);
    const Vector3d center = plan.setup.isocenter_patient_mm + draw.between(10.0, 60.0) * draw.direction();
    const Vector3d half = 0.5 * length_mm * draw.direction();
    plan.metal.push_back({center - half, center + half, draw.between(1.5, 4.0)});
  }
  plan.disturbances.push_back(fmt::format("{} pieces of metal that the CT does not show", count));
}

void expose_views(CasePlan& plan, Draw& draw) {
  double between_deg = 90.0, first_deg = draw.one_in_two() ? 0.0 : draw.one_in_two() ? 270.0 : 45.0;
  if (plan.stratum == "view-angle") {
    between_deg = draw.between(30.0, 90.0);
    first_deg = draw.between(0.0, 359.0);
    plan.disturbances.push_back(fmt::format("views {:.0f} degrees apart", between_deg));
  }
  for (int n = 0; n < 2; ++n) {
    Exposure& exposure = plan.exposures[static_cast<std::size_t>(n)];
    exposure.gantry_deg = std::fmod(std::round(10.0 * (first_deg + n * between_deg)) / 10.0, 360.0);
    exposure.photons = draw.between(1.5e5, 4e5);
    exposure.scatter_share = draw.between(0.05, 0.3);
    exposure.blur_mm = draw.between(0.25, 0.6);
  }
  if (plan.stratum == "low-dose") {
    const double photons = std::exp(draw.between(std::log(5e3), std::log(4e4)));
    for (Exposure& exposure : plan.exposures) {
      exposure.photons = photons;
      exposure.scatter_share = draw.between(0.3, 0.8);
    }
    plan.disturbances.push_back(fmt::format("{:.0f} photons per open pixel", photons));
  }
  if (plan.stratum == "kv-mv") {
    plan.exposures[0].is_megavoltage = true;
    plan.exposures[1].is_megavoltage = draw.between(0.0, 1.0) < 0.3;
    plan.disturbances.emplace_back(plan.exposures[1].is_megavoltage ? "both views MV" : "one view MV");
  }
}

// Jaws about the isocenter, in one view a little otherwise than in the other.
void collimate(CasePlan& plan, Draw& draw) {
  const double across_mm = draw.between(60, 120), along_mm = draw.between(60, 140);
  const double leakage = draw.between(0.0, 0.02);
  for (Exposure& exposure : plan.exposures) {
    exposure.is_collimated = true;
    exposure.leakage = leakage;
    const double x = draw.between(-8, 8), y = draw.between(-8, 8);
    exposure.left_mm = x - 0.5 * across_mm;
    exposure.right_mm = x + 0.5 * across_mm;
    exposure.low_mm = y - 0.5 * along_mm;
    exposure.high_mm = y + 0.5 * along_mm;
  }
  plan.disturbances.push_back(
      fmt::format("field {:.0f} x {:.0f} mm, leakage {:.1f} %", across_mm, along_mm, 100.0 * leakage));
}

}  // namespace

std::string stratum_of(std::uint64_t seed) {
  if (is_of_breathing(seed)) return "breathing";
  if (is_of_levels(seed)) return kStrataOfLevels[seed % kStrataOfLevels.size()];
  return kStrata[seed % kStrata.size()];
}

std::string anatomy_of(std::uint64_t seed) {
  return stratum_of(seed) != "breathing" && !is_of_levels(seed) && seed / kStrata.size() % 2 == 1 ? "head" : "chest";
}

Vector3d chest_spine_mm(double z_mm) {
  // Read off the sagittal plane through the spine of data/chest/CT.
  struct Point {
    double z, y;
  };
  constexpr std::array<Point, 8> kLine = {
      {{-320, 50}, {-260, 57}, {-229, 65}, {-197, 73}, {-154, 75}, {-104, 68}, {-72, 52}, {-20, 25}}};
  if (z_mm <= kLine.front().z) return {1.0, kLine.front().y, z_mm};
  for (std::size_t n = 1; n < kLine.size(); ++n)
    if (z_mm <= kLine[n].z) {
      const double share = (z_mm - kLine[n - 1].z) / (kLine[n].z - kLine[n - 1].z);
      return {1.0, kLine[n - 1].y + share * (kLine[n].y - kLine[n - 1].y), z_mm};
    }
  return {1.0, kLine.back().y, z_mm};
}

CasePlan draw_case(std::uint64_t seed, const std::string& stratum, const std::string& anatomy) {
  Draw draw(seed);
  CasePlan plan{.seed = seed, .stratum = stratum, .anatomy = anatomy};
  draw_setup(plan, draw);
  expose_views(plan, draw);
  if (stratum == "bent") bend(plan, draw);
  if (stratum == "breathing") breathe(plan, draw);
  if (stratum == "tissue") change_tissue(plan, draw);
  if (stratum == "metal") put_in_metal(plan, draw);
  if (stratum == "small-field") collimate(plan, draw);
  return plan;
}

}  // namespace isoshift::campaign
