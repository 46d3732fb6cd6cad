#pragma once
// Whether files belong together: one patient, one session on one table.

#include <span>
#include <string>
#include <vector>

#include "io/config/site_file.h"
#include "io/dicom/identity.h"
#include "io/dicom/notes.h"
#include "io/dicom/rt_image.h"

namespace isoshift {

// One patient: an ID is there and the same, and so are issuer, name and birth date where both files have them. Messages
// call the two files `where` and `reference_name`.
std::vector<Finding> patient_findings(const Identity& reference, const Identity& other, const std::string& where,
                                      const std::string& reference_name = "the CT");

// The views must be of one moment and one table position. Each is compared with the first view that says; one that does
// not say is warned of where others do.
std::vector<Finding> session_findings(std::span<const RtImage> images, Notes& notes);

// Why it is not known that the table stood still between the views, which only read-outs of its position in all of them
// tell: views more than `max_span_s` apart, a view that was taken twice. Results of such views need a person's review.
std::vector<Finding> session_doubts(std::span<const RtImage> images, double max_span_s);

// Where the table stood otherwise than at `reference`, as far as both say.
std::vector<Finding> table_findings(const RtImage& image, const RtImage& reference);

}  // namespace isoshift
