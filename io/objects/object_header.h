#pragma once
// The attributes of every object that isoshift writes: patient, study, series, equipment, and when it was made.

#include <string>

#include "io/dicom/identity.h"

namespace isoshift {

inline constexpr const char* kManufacturer = "isoshift";  // in every object that isoshift writes

struct ObjectHeader {
  Identity identity;
  std::string sop_class_uid;
  std::string sop_instance_uid;
  std::string modality;
  std::string series_instance_uid;
  int series_number = 0;
  std::string series_description;
  int instance_number = 1;
};

// Patient, General Study, General Series, General Equipment and SOP Common (PS3.3 C.7.1.1, C.7.2.1, C.7.3.1, C.7.5.1,
// C.12.1), Instance Number, and Content Date and Time: now, local.
void put_header(DicomItem& dataset, const ObjectHeader& header);

// A code of DICOM's own terminology (PS3.16) in an item of a code sequence.
void put_code(DicomItem item, const char* value, const char* meaning);

}  // namespace isoshift
