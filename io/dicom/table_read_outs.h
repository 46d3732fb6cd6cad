#pragma once
// Where the treatment table stood when an X-ray was taken, as its file says, and whether it moved between two X-rays.

#include <algorithm>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "io/dicom/dicom_dataset.h"
#include "io/dicom/notes.h"

namespace isoshift {

constexpr double kMaxTableMoveMm = 0.5;
constexpr double kMaxTableTurnDeg = 0.1;
constexpr double kMaxTableTiltDeg = 45.0;  // of any table top, by pitch or roll

// IEC 61217 read-outs; an optional without value is absent or empty in the file.
struct TableReadOuts {
  std::optional<double> lateral_mm, longitudinal_mm, vertical_mm;
  std::optional<double> support_angle_deg, eccentric_angle_deg, pitch_deg, roll_deg;
  bool are_measured = false;  // ReportedValuesOrigin is ACTUAL: they were neither planned nor typed in

  // Whether the file says where the table stood. Two zeros, or numbers that no table reaches, do not: programs write
  // them where they know no position.
  bool has_position() const;
  // Whether they tell where the table stood.
  bool tell_position() const { return are_measured && has_position(); }
  // Whether both have the same read-outs, so that none is missing in one of them only.
  bool has_same_read_outs(const TableReadOuts& other) const;
  bool operator==(const TableReadOuts&) const = default;
};

// Whether the read-outs of all these X-rays tell where the table stood, each by the same read-outs.
template <class Xrays>
bool all_tell_position(const Xrays& xrays) {
  return std::ranges::all_of(xrays, [&](const auto& xray) {
    return xray.table.tell_position() && xray.table.has_same_read_outs(xrays.front().table);
  });
}

// A read-out with its attribute, for loops over all read-outs.
struct TableReadOut {
  std::optional<double> TableReadOuts::* value;
  DcmTagKey tag;
  bool is_angle;
};
const std::vector<TableReadOut>& table_read_outs();

// `value_of` gives what the X-ray says, and `origin` is its ReportedValuesOrigin.
TableReadOuts read_table_read_outs(const std::function<std::optional<double>(const TableReadOut&)>& value_of,
                                   const std::optional<std::string>& origin);

// How a read-out differs between two X-rays, in words ("moved by 3.1 mm"); nothing where it does not, or where one of
// them has no value.
std::optional<std::string> table_change(const TableReadOut& read_out, const TableReadOuts& now,
                                        const TableReadOuts& before);

// Whether any read-out that both have differs.
bool has_table_moved(const TableReadOuts& now, const TableReadOuts& before);

}  // namespace isoshift
