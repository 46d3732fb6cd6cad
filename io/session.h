#pragma once
// Whether files belong together: one patient, one session on one table.

#include <span>
#include <string>
#include <vector>

#include "io/identity.h"
#include "io/notes.h"
#include "io/rt_image.h"

namespace isoshift {

constexpr double kMaxTimeSpanS = 600.0;  // between the views of one session
constexpr double kMaxTableTurnDeg = 0.1;

// One patient: an ID is there and the same, and so are issuer, name and birth date where both files have them. Messages
// call the two files `where` and `reference_name`.
std::vector<Finding> patient_findings(const Identity& reference, const Identity& other, const std::string& where,
                                      const std::string& reference_name = "the CT");

// The views must be of one moment and one table position. Each is compared with the first view that says; one that does
// not say is warned of where others do.
std::vector<Finding> session_findings(std::span<const RtImage> images, Notes& notes);

// Where the table stood otherwise than at `reference`, as far as both say.
std::vector<Finding> table_findings(const RtImage& image, const RtImage& reference);

}  // namespace isoshift
