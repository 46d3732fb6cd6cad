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

// Checks that two files are of one patient: both have the same ID, and issuer, name and birth date agree if both files
// have them. Messages call the two files `where` and `reference_name`.
std::vector<Finding> patient_findings(const Identity& reference, const Identity& other, const std::string& where,
                                      const std::string& reference_name = "the CT");

// Checks that the views were taken at one time and at one table position. Each view is compared with the first view
// that has the attribute. If only some views have the attribute, a warning names the others.
std::vector<Finding> session_findings(std::span<const RtImage> images, Notes& notes);

// Why it is not known that the views show one setup. Read-outs of the table's position in all views tell that it stood
// still; without them, views more than `max_span_s` apart or of unknown times, and a view that was taken twice, are in
// doubt. So are, in any case, views of two machines, and a table angle that only some views have. Results of such views
// need a person's review.
std::vector<Finding> session_doubts(std::span<const RtImage> images, double max_span_s);

// The differences between the table read-outs of `image` and `reference`, as far as both have them.
std::vector<Finding> table_findings(const RtImage& image, const RtImage& reference);

}  // namespace isoshift
