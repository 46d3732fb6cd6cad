#include "io/objects/encapsulated_pdf.h"

#include <dcmtk/dcmdata/dcuid.h>

#include "io/objects/object_header.h"

namespace isoshift {

void write_encapsulated_pdf(const EncapsulatedPdf& document, const std::string& pdf,
                            const std::filesystem::path& path) {
  DicomFile file;
  DicomItem dataset = file.dataset();
  put_header(dataset, {.identity = document.identity,
                       .sop_class_uid = UID_EncapsulatedPDFStorage,
                       .sop_instance_uid = new_uid(),
                       .modality = "DOC",
                       .series_instance_uid = new_uid(),
                       .series_number = 9003,
                       .series_description = "Setup shift report"});
  dataset.put(DCM_ConversionType, "WSD");
  dataset.put(DCM_AcquisitionDateTime, "");
  dataset.put(DCM_BurnedInAnnotation, "YES");  // it names the patient
  dataset.put(DCM_DocumentTitle, document.title);
  dataset.put_empty_sequence(DCM_ConceptNameCodeSequence);
  dataset.put(DCM_MIMETypeOfEncapsulatedDocument, "application/pdf");
  for (const EncapsulatedPdf::Reference& source : document.sources)
    dataset.append_reference(DCM_SourceInstanceSequence, source.sop_class_uid, source.sop_instance_uid);
  dataset.put(DCM_EncapsulatedDocumentLength, static_cast<double>(pdf.size()));
  dataset.put_bytes(DCM_EncapsulatedDocument, pdf);
  file.write(path);
}

}  // namespace isoshift
