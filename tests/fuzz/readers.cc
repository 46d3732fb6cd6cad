#include "tests/fuzz/readers.h"

#include "io/dicom/ct_series.h"
#include "io/dicom/decode.h"
#include "io/dicom/rt_image.h"
#include "io/dicom/rt_plan.h"
#include "io/dicom/rt_structures.h"
#include "io/dicom/structure_mask.h"
#include "io/objects/registration_check.h"
#include "io/objects/spatial_registration.h"
#include "io/study/study_files.h"
#include "tests/support/testdata.h"

namespace isoshift {
namespace {

void read_ct(const std::vector<std::filesystem::path>& files) {
  Notes notes;
  scan_study({files.front()});
  read_ct_series(files, {{"gaps", "hostile"}}, notes, {});
}

// Between two slices of the phantom that testdata/compressed shows: alone it would be no volume.
void read_ct_slice(const std::filesystem::path& path) {
  read_ct({path, testdata("small/1/CT/CT0014.dcm"), testdata("small/1/CT/CT0022.dcm")});
}

void read_rt_image(const std::filesystem::path& path) {
  Notes notes;
  for (const RtImage& image : read_rt_images(path, notes)) {
    if (!missing_attributes(image).empty()) continue;
    rt_image_findings(image);
    read_xray_image(DicomFile::read(path, DicomFile::Extent::kWhole), image,
                    xray_view(image, beam_of(image, notes), notes));
  }
}

void read_structures(const std::filesystem::path& path) {
  const RtStructures structures = read_rt_structures(path);
  Volume<float> ct({40, 40, 30}, Eigen::Affine3d::Identity());
  ct.patient_from_voxel.linear() *= 5.0;
  for (const Structure& structure : structures.structures) mask_of(structure, ct.size, ct.patient_from_voxel);
}

}  // namespace

const std::map<std::string, std::function<void(const std::filesystem::path&)>> kReaders = {
    {"ct", read_ct_slice},
    {"enhanced_ct", [](const std::filesystem::path& path) { read_ct({path}); }},
    {"rt_image", read_rt_image},
    {"rt_plan", [](const std::filesystem::path& path) { read_rt_plan(path); }},
    {"rt_structures", read_structures},
    {"spatial_registration",
     [](const std::filesystem::path& path) {
       check_registration(path);
       read_spatial_registration(path);
     }},
    {"decoder",
     [](const std::filesystem::path& path) {
       decompressed_frame(DicomFile::read(path, DicomFile::Extent::kWhole), 0);
     }},
};

}  // namespace isoshift
