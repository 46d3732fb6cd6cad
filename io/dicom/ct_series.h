#pragma once
// A CT series as one volume in HU (PS3.3 C.8.2.1, C.7.6.2; rules CT-1 to CT-14 of docs/dicom.md): CT Images, or one or
// more Enhanced CT Images (A.38), converted ones too.

#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "geometry/volume.h"
#include "io/dicom/identity.h"
#include "io/dicom/notes.h"

namespace isoshift {

struct CtSeries {
  Volume<float> hu;  // slices in order of position along the normal; axes as stored, sheared for a tilted gantry
  Identity identity;
  std::string sop_class_uid;
  std::string series_instance_uid;
  std::string frame_of_reference_uid;
  std::string body_part_examined;
  std::string patient_position;                // of the scan; annotation only (C.7.3.1.1.2)
  std::string acquired_on;                     // AcquisitionDate, else SeriesDate; may be empty
  std::vector<std::string> sop_instance_uids;  // each once, in the order of the slices
  std::vector<std::string> doubts;             // about its voxels: every result needs a person's review
  std::string sha256;  // of the SHA-256 of its files, hexadecimal, one after the other in that order
};

// Called with (slices done, slices in all), possibly from several threads, never at the same time.
using Progress = std::function<void(std::size_t done, std::size_t total)>;

// Reads and decodes the slices on all cores. Throws Error for anything that would put voxels in the wrong place or give
// them a wrong value; a missing slice or uneven spacing is a finding that `allowed` may permit (key gaps): the volume
// is then interpolated linearly onto the smallest spacing.
CtSeries read_ct_series(std::span<const std::filesystem::path> files, const Allowances& allowed, Notes& notes,
                        const Progress& progress);

}  // namespace isoshift
