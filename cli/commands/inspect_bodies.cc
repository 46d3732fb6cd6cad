#include "cli/commands/inspect_bodies.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/error.h"
#include "io/report/canvas.h"

namespace isoshift {
namespace {

// Hues that differ between neighbors in number.
Rgb color_of(int number) {
  constexpr double kGoldenTurn = 0.618034;
  const double turn = 2.0 * std::numbers::pi * kGoldenTurn * number;
  const auto channel = [&](double at) {
    return static_cast<std::uint8_t>(std::lround(150.0 + 95.0 * std::cos(turn - at * 2.0 * std::numbers::pi / 3.0)));
  };
  return {channel(0), channel(1), channel(2)};
}

Rgb darker(const Rgb& color, double share) {
  Rgb result;
  std::ranges::transform(color, result.begin(),
                         [&](std::uint8_t value) { return static_cast<std::uint8_t>(value * share); });
  return result;
}

// The labels along an axis: of each line, the first that is not 0; deeper ones are darker.
Image<Rgb> seen_along(const Volume<std::uint8_t>& labels, int axis, bool from_end) {
  const int across = axis == 0 ? 1 : 0;
  Image<Rgb> image(labels.size[across], labels.size.z(), color::kBlack);
  for (int k = 0; k < labels.size.z(); ++k)
    for (int c = 0; c < labels.size[across]; ++c)
      for (int depth = 0; depth < labels.size[axis]; ++depth) {
        Eigen::Vector3i at;
        at[across] = c;
        at[axis] = from_end ? labels.size[axis] - 1 - depth : depth;
        at.z() = k;
        const int label = labels.at(at.x(), at.y(), at.z());
        if (label == 0) continue;
        image.at(c, labels.size.z() - 1 - k) = darker(color_of(label), 1.0 - 0.6 * depth / labels.size[axis]);
        break;
      }
  return image;
}

}  // namespace

std::string bodies_table(const BodyMap& map) {
  std::string text = fmt::format("  {:>4}  {:<9} {:<14} {:>26}  {:>9}  joints (s: stiff)\n", "body", "kind", "name",
                                 "center, patient mm", "cm3");
  for (std::size_t n = 0; n < map.bodies.size(); ++n) {
    const Body& body = map.bodies[n];
    std::vector<std::string> joints;
    for (const Joint& joint : map.joints)
      if (std::cmp_equal(joint.a, n) || std::cmp_equal(joint.b, n))
        joints.push_back(
            fmt::format("{}{}", (std::cmp_equal(joint.a, n) ? joint.b : joint.a) + 1, joint.is_stiff ? "s" : ""));
    const Eigen::Vector3d& at = body.center_patient_mm;
    text += fmt::format("  {:>4}  {:<9} {:<14} {:>26}  {:>9.1f}  {}\n", n + 1, to_string(body.kind),
                        body.name + (body.is_cut ? ", cut" : ""),
                        fmt::format("({:.1f}, {:.1f}, {:.1f})", at.x(), at.y(), at.z()), body.volume_mm3 / 1000.0,
                        fmt::join(joints, " "));
  }
  return text;
}

std::string bodies_picture(const BodyMap& map, const std::string& title) {
  const double edge_mm = map.labels.spacing_mm().x();
  constexpr double kPixelsPerMm = 2.0, kMargin = 20.0, kTop = 40.0;
  const Eigen::Vector3d extent = kPixelsPerMm * edge_mm * map.labels.size.cast<double>();
  Canvas canvas(Canvas::Kind::kPng, extent.x() + extent.y() + 3.0 * kMargin, extent.z() + kTop + kMargin);
  canvas.fill(0, 0, canvas.width(), canvas.height(), color::kWhite);
  canvas.text(kMargin, 12.0, printable(title), {.size = 14.0, .bold = true});
  const Eigen::Affine3d voxel_from_patient = map.labels.patient_from_voxel.inverse();
  const auto draw = [&](double left, int axis, bool from_end) {
    const int across = axis == 0 ? 1 : 0;
    canvas.image(left, kTop, extent[across], extent.z(), seen_along(map.labels, axis, from_end));
    for (std::size_t n = 0; n < map.bodies.size(); ++n) {
      if (map.bodies[n].kind == Body::Kind::kCouch) continue;
      const Eigen::Vector3d at = voxel_from_patient * map.bodies[n].center_patient_mm;
      const double x = left + kPixelsPerMm * edge_mm * (at[across] + 0.5);
      const double y = kTop + extent.z() - kPixelsPerMm * edge_mm * (at.z() + 0.5);
      canvas.text(x, y - 6.0, fmt::format("{}", n + 1),
                  {.size = 11.0, .bold = true, .color = color::kWhite, .align = TextStyle::Align::kCenter});
    }
  };
  draw(kMargin, 1, false);                    // from the front: the patient's right at the left
  draw(2.0 * kMargin + extent.x(), 0, true);  // from the left: the front at the left
  return canvas.finish();
}

}  // namespace isoshift
