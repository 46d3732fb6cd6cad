#pragma once
// To which patient and study a DICOM object belongs: PS3.3 C.7.1.1 and C.7.2.1.

#include <string>

#include "io/dicom/dicom_dataset.h"
#include "io/dicom/notes.h"
#include "setup/identity.h"

namespace isoshift {

Identity read_identity(const DicomItem& dataset);

// For an identity that goes into objects that isoshift writes: what DICOM does not allow there (PS3.5 6.2) is left out,
// with a warning. Throws Error for a patient's name or ID that is too long, and where the StudyInstanceUID is missing.
void make_writable(Identity& identity, const std::string& where, Notes& notes);

// Names and birth dates of one patient, however systems write them, are the same in this form: without capital letters,
// empty components at the end of a name (PS3.5 6.2.1.1) and the dots of old dates (PS3.5 6.2).
std::string comparable_name(std::string name);
std::string comparable_date(std::string date);

// Writes all attributes; an unknown attribute of type 2 is written empty.
void put_identity(DicomItem& dataset, const Identity& identity);

}  // namespace isoshift
