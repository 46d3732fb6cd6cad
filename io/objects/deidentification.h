#pragma once
// Objects that do not tell who the patient is: PS3.15 Annex E, Basic Application Level Confidentiality Profile with the
// option Retain Longitudinal Temporal Information with Modified Dates. The geometry, the pixels and the numbers of a
// plan stay.

#include "io/dicom/dicom_dataset.h"
#include "io/objects/pseudonyms.h"

namespace isoshift {

// Stricter than the profile's Table E.1-1: what is not known to be harmless goes. Removed are private attributes,
// whole groups about patients, visits and procedures, overlays, curves, and all text but that of device models,
// reconstruction kernels and codes; labels, names of machines and of structures become pseudonyms; UIDs but those of
// classes and of well-known frames of reference are replaced, and dates moved.
// The pixels are written anew, too, uncompressed and without what their unused bits or a compressed stream hold beside
// them. Throws Error as decode_frame() does.
DicomFile deidentified(const DicomFile& file, Pseudonyms& pseudonyms);

// Whether text may be burnt into the pixels of an image (BurnedInAnnotation): no pixel is changed here.
enum class BurntIn { kNo, kYes, kUnknown };
BurntIn burnt_in(const DicomItem& dataset);

}  // namespace isoshift
