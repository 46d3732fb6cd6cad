#pragma once
// How vendors' displays count what IEC 61217 calls the table's position and angle (docs/dicom.md 5.2).

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string_view>

namespace isoshift {

enum class CouchScale { kIec61217, kVarianIec, kVarianStandard };

inline constexpr std::array kCouchScales = {CouchScale::kIec61217, CouchScale::kVarianIec, CouchScale::kVarianStandard};

// "IEC 61217", "Varian IEC", "Varian Standard".
std::string_view to_string(CouchScale scale);
std::optional<CouchScale> couch_scale_from(std::string_view name);

// Absolute read-outs of a table top.
struct CouchReadOut {
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();  // lateral, longitudinal, vertical
  double angle_deg = 0.0;                                 // of the support, in [0, 360)
};

// From IEC 61217 to another scale. Sources disagree about vendors' scales: a site validates its own before use.
CouchReadOut on_scale(CouchScale scale, const CouchReadOut& iec);

// The signs of a change on that scale per axis: lateral, longitudinal, vertical, angle.
std::array<int, 4> signs_on_scale(CouchScale scale);

}  // namespace isoshift
