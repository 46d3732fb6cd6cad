#pragma once
// A report as a DICOM object: Encapsulated PDF (PS3.3 A.45.1, C.24).

#include <filesystem>
#include <string>
#include <vector>

#include "io/dicom/identity.h"

namespace isoshift {

struct EncapsulatedPdf {
  Identity identity;  // whose it is, and in which study it is stored
  std::string title;
  struct Reference {
    std::string sop_class_uid, sop_instance_uid;
  };
  std::vector<Reference> sources;  // what the report is about: plan, images, registration object
};

// Writes the object whole or not at all.
void write_encapsulated_pdf(const EncapsulatedPdf& document, const std::string& pdf, const std::filesystem::path& path);

}  // namespace isoshift
