#pragma once
// Whether files belong together: one patient, one session on one table.

#include <array>
#include <span>
#include <string>
#include <vector>

#include "io/config/site_file.h"
#include "io/dicom/identity.h"
#include "io/dicom/notes.h"
#include "io/dicom/rt_image.h"

namespace isoshift {

constexpr double kSameIsocenterMm = 0.5;  // isocenters that lie no farther apart are the same

// A file with a patient, as messages name it.
struct PatientInput {
  const Identity* identity;
  std::string name;
};

// Checks that all are of one patient: each has the same ID, and issuer, name and birth date agree where they are given.
// Each input is compared with the first that has the attribute: two may differ in what the CT does not say.
std::vector<FailedCheck> patient_findings(std::span<const PatientInput> inputs);
inline std::vector<FailedCheck> patient_findings(const PatientInput& one, const PatientInput& other) {
  return patient_findings(std::array{one, other});
}

// Checks that the views were taken at one time and at one table position. Each view is compared with the first view
// that has the attribute. If only some views have the attribute, a warning names the others.
std::vector<FailedCheck> session_findings(std::span<const RtImage> images, Notes& notes);

// Reasons to doubt that the views show one setup, so that a person must review the result:
// - if not all views have measured read-outs of the table's position: views more than `max_span_s` apart, and a view
//   that was taken twice (by its projection matrix where a machine profile gives it one);
// - in any case: views with unknown times, views of two machines or two fractions, and a table angle that is not 0 in
//   one view and missing in another.
std::vector<FailedCheck> session_doubts(std::span<const RtImage> images, double max_span_s);

// What a person says by switches against what an X-ray says, and what a machine profile says against its table angles.
// `image`: as read; `by_profile`: with the profile; `used`: with the switches, too.
std::vector<FailedCheck> replaced_doubts(const RtImage& image, const RtImage& by_profile, const RtImage& used);

// The differences between the table read-outs of `image` and `reference`, as far as both have them.
std::vector<FailedCheck> table_findings(const RtImage& image, const RtImage& reference);

}  // namespace isoshift
