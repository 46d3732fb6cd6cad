#pragma once
// To which patient and study a DICOM object belongs: PS3.3 C.7.1.1 and C.7.2.1.

#include "io/dicom/dicom_dataset.h"
#include "setup/identity.h"

namespace isoshift {

Identity read_identity(const DicomItem& dataset);

// Writes all attributes; an unknown attribute of type 2 is written empty.
void put_identity(DicomItem& dataset, const Identity& identity);

}  // namespace isoshift
