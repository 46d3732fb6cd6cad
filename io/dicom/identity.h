#pragma once
// Whom and which study a DICOM object belongs to: PS3.3 C.7.1.1 and C.7.2.1.

#include "io/dicom/dicom_dataset.h"
#include "setup/identity.h"

namespace isoshift {

Identity read_identity(const DicomItem& dataset);

// Writes all of it (type 2 attributes empty where unknown).
void put_identity(DicomItem& dataset, const Identity& identity);

}  // namespace isoshift
