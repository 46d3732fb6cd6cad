#pragma once
// What a case of the campaign is: drawn from a seed and a stratum, and nothing else.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/real_data/campaign/deformation.h"
#include "tests/real_data/campaign/xray.h"

namespace isoshift::campaign {

inline constexpr std::array<const char*, 9> kStrata = {"undisturbed", "bent",  "breathing", "tissue",    "small-field",
                                                       "low-dose",    "metal", "kv-mv",     "view-angle"};

struct CasePlan {
  std::uint64_t seed = 0;
  std::string stratum, anatomy;  // "head" or "chest"
  Setup setup;
  double target_radius_mm = 25.0;
  std::vector<Bending> bendings;
  Breath breath;
  double lost_mm = 0.0;  // of skin and fat
  double effusion_behind_mm = 1e9;
  bool holder_is_gone = false;
  struct Ball {
    Eigen::Vector3d center_mm, half_extent_mm;
  };
  std::vector<Ball> gas;
  struct Rod {
    Eigen::Vector3d begin_mm, end_mm;
    double radius_mm;
  };
  std::vector<Rod> metal;
  std::array<Exposure, 2> exposures;
  std::vector<std::string> disturbances;  // in words, with their amounts
};

// The stratum and the anatomy go round with the seed. A head has no breath: those cases are chests, and so are all of
// the series (README.md): seeds from 2000 breathe by 2 to 14 mm in steps of 1, those from 3000 lie a vertebra off.
std::string stratum_of(std::uint64_t seed);
std::string anatomy_of(std::uint64_t seed);

CasePlan draw_case(std::uint64_t seed, const std::string& stratum, const std::string& anatomy);

// Where the spine runs in the chest's CT: the middle of the vertebral bodies at a height.
Eigen::Vector3d chest_spine_mm(double z_mm);

}  // namespace isoshift::campaign
