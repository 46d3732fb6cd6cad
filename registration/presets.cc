#include "registration/presets.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/error.h"
#include "geometry/rotation.h"

namespace isoshift {
namespace {

// Stochastic rank correlation captures from far; gradient correlation ends precisely (docs/evaluation.md).
std::vector<Stage> setup_stages() {
  return {{.name = "coarse",
           .similarity = SimilarityKind::kStochasticRankCorrelation,
           .optimizer = OptimizerKind::kLevenbergMarquardt,
           .pixel_mm = 5.0,
           .voxel_mm = 4.0,
           .candidates = 60,
           .starts = 2,
           .keep = 2,
           .reach_mm = 20.0,
           .reach_rad = rad_from_deg(8.0),
           .initial_step_mm = 8.0,
           .initial_step_rad = rad_from_deg(3.5),
           .relative_tolerance = 0.02},
          {.name = "medium",
           .similarity = SimilarityKind::kStochasticRankCorrelation,
           .optimizer = OptimizerKind::kLevenbergMarquardt,
           .pixel_mm = 2.5,
           .voxel_mm = 2.0,
           .pixel_fraction = 0.25,
           .min_pixels = 2000,
           .starts = 2,
           .keep = 2,
           .initial_step_mm = 1.5,
           .initial_step_rad = rad_from_deg(0.9),
           .relative_tolerance = 0.05},
          // From three starts: do they agree?
          {.name = "restarts",
           .similarity = SimilarityKind::kGradientCorrelation,
           .optimizer = OptimizerKind::kLevenbergMarquardt,
           .pixel_mm = 2.5,
           .voxel_mm = 2.0,
           .pixel_fraction = 0.3,
           .min_pixels = 2500,
           .candidates = 2,
           .starts = 3,
           .reach_mm = 2.0,
           .reach_rad = rad_from_deg(1.5),
           .initial_step_mm = 1.0,
           .initial_step_rad = rad_from_deg(0.6),
           .relative_tolerance = 0.02},
          {.name = "fine",
           .similarity = SimilarityKind::kGradientCorrelation,
           .optimizer = OptimizerKind::kLevenbergMarquardt,
           .pixel_mm = 1.2,
           .voxel_mm = 1.0,
           .pixel_fraction = 0.3,
           .min_pixels = 8000,
           .initial_step_mm = 0.4,
           .initial_step_rad = rad_from_deg(0.25),
           .relative_tolerance = 0.01}};
}

// As setup from one start, without the candidates of a far search, and ending on pixels of 2 mm.
std::vector<Stage> fast_stages() {
  std::vector<Stage> stages = setup_stages();
  std::erase_if(stages, [](const Stage& stage) { return stage.name == "restarts"; });
  for (Stage& stage : stages) {
    stage.candidates = 0;
    stage.starts = stage.keep = 1;
  }
  Stage& fine = stages.back();
  fine.pixel_mm = 2.0;
  fine.voxel_mm = 2.0;
  fine.min_pixels = 3000;
  fine.relative_tolerance = 0.02;
  return stages;
}

std::vector<Stage> paper_stages() {
  return {{.name = "single",
           .similarity = SimilarityKind::kStochasticRankCorrelation,
           .optimizer = OptimizerKind::kNelderMead,
           .pixel_mm = 1.0,
           .pixel_fraction = 0.05,
           .initial_step_mm = 8.0,
           .initial_step_rad = rad_from_deg(3.0),
           .relative_tolerance = 0.005,
           .max_evaluations = 500}};
}

}  // namespace

RegistrationOptions preset(std::string_view name) {
  RegistrationOptions options;
  options.preset = name;
  if (name == "setup") {
    options.stages = setup_stages();
  } else if (name == "fast") {
    options.stages = fast_stages();
    options.check_alternatives = false;
  } else if (name == "paper") {
    options.stages = paper_stages();
    options.eight_bit_xrays = true;
    options.check_alternatives = false;
  } else {
    throw UsageError(fmt::format("there is no preset {}; the presets are {}", name, fmt::join(kPresets, ", ")));
  }
  return options;
}

}  // namespace isoshift
