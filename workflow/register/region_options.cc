#include "workflow/register/region_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <utility>

#include "base/error.h"
#include "base/option_name.h"
#include "geometry/mask.h"
#include "io/dicom/structure_mask.h"
#include "workflow/register/study_bodies.h"

namespace isoshift {
namespace {

const Structure& structure_of(const Study& study, const std::string& name) {
  if (!study.structures)
    throw Error(fmt::format("structure {}: {} ({} names one)", name, why_no_structures(study.unused_structures),
                            option("structures", "FILE")));
  return structure_named(*study.structures, name);
}

Volume<std::uint8_t> mask_in_ct(const Study& study, const std::string& name) {
  return mask_of(structure_of(study, name), study.ct->hu.size, study.ct->hu.patient_from_voxel);
}

std::vector<ChosenVolume> excluded_volumes(const RegionOptions& options, const Study& study) {
  std::vector<ChosenVolume> volumes;
  volumes.reserve(options.excluded.size());
  for (const std::string& name : options.excluded) {
    const bool is_couch = structure_of(study, name).interpreted_type == "SUPPORT";
    volumes.push_back({.words = fmt::format("structure {}, which is excluded,", name),
                       .mask = mask_in_ct(study, name),
                       .is_drawn = true,
                       .is_excluded = true,
                       .keeps_pixels = is_couch});
  }
  return volumes;
}

}  // namespace

RectanglesByLabel RegionOptions::rectangles_of(const Study& study) const {
  RectanglesByLabel by_label;
  for (const std::string& text : rectangles) {
    const auto equals = text.rfind('=');
    PixelRectangle r;
    int read = 0;
    const std::string numbers = equals == std::string::npos ? "" : text.substr(equals + 1);
    if (std::sscanf(numbers.c_str(), "%d,%d,%d,%d%n", &r.first_column, &r.first_row, &r.last_column, &r.last_row,
                    &read) != 4 ||
        read != static_cast<int>(numbers.size()) || r.last_column <= r.first_column || r.last_row <= r.first_row)
      throw UsageError(fmt::format(
          "--rectangle {}: expected LABEL=FIRST_COLUMN,FIRST_ROW,LAST_COLUMN,LAST_ROW, in pixels from 0", text));
    const std::string label = text.substr(0, equals);
    const auto labeled = std::ranges::find(study.xrays, label, &XrayImage::label);
    if (labeled == study.xrays.end())
      throw UsageError(fmt::format("--rectangle {}: no X-ray is labeled {}", text, label));
    const XrayView& view = labeled->view;
    if (r.first_column < 0 || r.first_row < 0 || r.last_column >= view.columns || r.last_row >= view.rows)
      throw UsageError(fmt::format("--rectangle {}: it reaches beyond the X-ray, which has {} columns and {} rows",
                                   text, view.columns, view.rows));
    by_label[label] = r;
  }
  return by_label;
}

std::vector<std::string> RegionOptions::in_words() const {
  std::vector<std::string> words;
  words.reserve(structures.size());
  for (const std::string& name : structures)
    words.push_back(fmt::format("structure {}, margin {} mm", name, margin_mm));
  for (const int body : bodies) words.push_back(fmt::format("body {}, margin {} mm", body, margin_mm));
  if (around_isocenter_mm) words.push_back(fmt::format("within {} mm of the isocenter", *around_isocenter_mm));
  for (const std::string& name : excluded) words.push_back(fmt::format("without {}, margin {} mm", name, margin_mm));
  for (const std::string& rectangle : rectangles) words.push_back(fmt::format("rectangle {}", rectangle));
  return words;
}

RegionOfStudy region_of(const RegionOptions& options, const Study& study, double threshold_hu) {
  if (options.around_isocenter_mm && !(*options.around_isocenter_mm > 0.0))
    throw UsageError(fmt::format("--around-isocenter {}: expected more than 0 mm", *options.around_isocenter_mm));
  RegionOfStudy result{.chosen = excluded_volumes(options, study)};
  std::optional<Volume<std::uint8_t>> compared;
  const auto add = [&](std::string words, Volume<std::uint8_t> exact, double margin_mm, bool is_drawn = false) {
    Volume<std::uint8_t> grown = margin_mm > 0.0 ? dilated(exact, margin_mm) : exact;
    if (compared)
      unite(*compared, grown);
    else
      compared = std::move(grown);
    result.chosen.push_back({.words = std::move(words), .mask = std::move(exact), .is_drawn = is_drawn});
  };
  if (options.around_isocenter_mm) {
    add(fmt::format("the sphere of {} mm about the isocenter", *options.around_isocenter_mm),
        sphere_in(study.ct->hu, study.isocenter_patient_mm, *options.around_isocenter_mm), 0.0);
    if (std::ranges::all_of(compared->voxels, [](std::uint8_t inside) { return inside != 0; }))
      throw UsageError(
          fmt::format("--around-isocenter {}: the whole CT lies within this distance, which is what is "
                      "registered without the switch",
                      *options.around_isocenter_mm));
  }
  for (const std::string& name : options.structures)
    add("structure " + name, mask_in_ct(study, name), options.margin_mm, true);
  if (!options.bodies.empty()) {
    const BodyMap map = bodies_of(*study.ct, study.structures ? &*study.structures : nullptr);
    for (const int body : options.bodies) {
      Volume<std::uint8_t> mask = body_mask(map, body, study.ct->hu);
      add(body_in_words(map, body), std::move(mask), options.margin_mm);
    }
  }
  result.region = region_within(compared, compared, result.chosen, options.margin_mm, study.ct->hu, threshold_hu);
  return result;
}

}  // namespace isoshift
