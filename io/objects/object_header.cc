#include "io/objects/object_header.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <chrono>

#include "base/version.h"

namespace isoshift {

void put_header(DicomItem& dataset, const ObjectHeader& header) {
  const std::tm local = fmt::localtime(std::chrono::system_clock::to_time_t(std::chrono::system_clock::now()));
  put_identity(dataset, header.identity);
  dataset.put(DCM_SOPClassUID, header.sop_class_uid);
  dataset.put(DCM_SOPInstanceUID, header.sop_instance_uid);
  dataset.put(DCM_Modality, header.modality);
  dataset.put(DCM_SeriesInstanceUID, header.series_instance_uid);
  dataset.put(DCM_SeriesNumber, fmt::format("{}", header.series_number));
  dataset.put(DCM_SeriesDescription, header.series_description);
  dataset.put(DCM_Manufacturer, kManufacturer);
  dataset.put(DCM_ManufacturerModelName, "isoshift");
  dataset.put(DCM_SoftwareVersions, kVersion);
  dataset.put(DCM_InstanceNumber, fmt::format("{}", header.instance_number));
  dataset.put(DCM_ContentDate, fmt::format("{:%Y%m%d}", local));
  dataset.put(DCM_ContentTime, fmt::format("{:%H%M%S}", local));
  dataset.put(DCM_TimezoneOffsetFromUTC, fmt::format("{:%z}", local));
}

void put_code(DicomItem item, const char* value, const char* meaning) {
  item.put(DCM_CodeValue, value);
  item.put(DCM_CodingSchemeDesignator, "DCM");
  item.put(DCM_CodeMeaning, meaning);
}

}  // namespace isoshift
