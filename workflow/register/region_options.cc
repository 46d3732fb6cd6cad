#include "workflow/register/region_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "base/error.h"
#include "base/option_name.h"
#include "geometry/mask.h"
#include "io/dicom/structure_mask.h"
#include "workflow/register/study_bodies.h"

namespace isoshift {
namespace {

// Beyond the compared region the CT is rendered over this distance more, so that its cut surface is seen outside only.
constexpr double kRenderedBeyondMm = 15.0;

const Structure& structure_of(const Study& study, const std::string& name) {
  if (!study.structures)
    throw Error(fmt::format("structure {}: {} ({} names one)", name, why_no_structures(study.unused_structures),
                            option("structures", "FILE")));
  return structure_named(*study.structures, name);
}

Volume<std::uint8_t> mask_in_ct(const Study& study, const std::string& name) {
  return mask_of(structure_of(study, name), study.ct->hu.size, study.ct->hu.patient_from_voxel);
}

void unite(Volume<std::uint8_t>& mask, const Volume<std::uint8_t>& other) {
  std::ranges::transform(mask.voxels, other.voxels, mask.voxels.begin(), std::ranges::max);
}

Volume<std::uint8_t> sphere(const Study& study, double radius_mm) {
  const Volume<float>& ct = study.ct->hu;
  Volume<std::uint8_t> mask(ct.size, ct.patient_from_voxel);
  for (int k = 0; k < ct.size.z(); ++k)
    for (int j = 0; j < ct.size.y(); ++j)
      for (int i = 0; i < ct.size.x(); ++i) {
        const Eigen::Vector3d at_patient_mm = ct.patient_from_voxel * Eigen::Vector3d(i, j, k);
        mask.at(i, j, k) = (at_patient_mm - study.isocenter_patient_mm).norm() <= radius_mm ? 1 : 0;
      }
  return mask;
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
  RegionOfInterest region;
  RegionOfStudy result;
  if (options.around_isocenter_mm) {
    region.volume = sphere(study, *options.around_isocenter_mm);
    if (std::ranges::all_of(region.volume->voxels, [](std::uint8_t inside) { return inside != 0; }))
      throw UsageError(
          fmt::format("--around-isocenter {}: the whole CT lies within this distance, which is what is "
                      "registered without the switch",
                      *options.around_isocenter_mm));
  }
  const auto add = [&](const Volume<std::uint8_t>& exact) {
    const Volume<std::uint8_t> mask = dilated(exact, options.margin_mm);
    if (region.volume)
      unite(*region.volume, mask);
    else
      region.volume = mask;
  };
  for (const std::string& name : options.structures) add(mask_in_ct(study, name));
  if (!options.bodies.empty()) {
    const BodyMap map = bodies_of(*study.ct, study.structures ? &*study.structures : nullptr);
    for (const int body : options.bodies) add(body_mask(map, body, study.ct->hu));
  }
  if (region.volume) result.rendered_ct = only_inside(study.ct->hu, dilated(*region.volume, kRenderedBeyondMm));
  region.cut_ends = beyond_the_ct(study.ct->hu, threshold_hu);
  for (const std::string& name : options.excluded) {
    const Volume<std::uint8_t> mask = mask_in_ct(study, name);
    result.rendered_ct = without(result.rendered_ct.value_or(study.ct->hu), mask);
    // A couch lies behind everything: its pixels stay, only its voxels go.
    if (structure_of(study, name).interpreted_type != "SUPPORT")
      region.excluded.push_back(dilated(mask, options.margin_mm));
  }
  result.projected = ProjectedRegion(region);
  return result;
}

}  // namespace isoshift
