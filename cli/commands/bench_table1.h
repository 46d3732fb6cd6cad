#pragma once
// Table 1 of the founding paper (Spoerk et al. 2012): time per image and error of every renderer, row by row.

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "drr/renderer.h"

namespace isoshift {

struct Table1Options {
  std::filesystem::path ct;  // empty: the phantom's head
  std::optional<std::string> gl, gpu;
  std::vector<std::string> renderers;  // empty: all
  int every = 997;                     // not a divisor of 27,000: all axes turn
  int pixels = 512;
  std::filesystem::path output;  // empty: rows are not kept

  bool wants(RendererKind kind) const;
};

// The paper's model: 8-bit volumes of windowed HU.
AttenuationModel paper_model(double threshold_hu);

// Measures every wanted row of every cell (a volume at a threshold), and returns all as JSON. `on_cell` hears of each
// cell that is done. With `output`, every row is kept there in a file as it ends; rows that are there already are not
// measured again, and those of other renderers are in the tables, too. Throws Error if the folder holds anything else,
// or a wanted row that was measured otherwise.
nlohmann::ordered_json table1(const Table1Options& options, const std::function<void(double share)>& progress,
                              const std::function<void(const nlohmann::ordered_json& cell)>& on_cell);

// A cell in words.
std::string table1_text(const nlohmann::ordered_json& cell);

}  // namespace isoshift
