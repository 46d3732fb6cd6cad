#pragma once
// The DICOM objects of a phantom study, one file each.

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include "io/dicom/identity.h"
#include "phantom/study_writer.h"

namespace isoshift {

// The same seed gives the same UIDs, so that a study can be made again byte for byte.
class Uids {
 public:
  explicit Uids(std::uint64_t seed) : random_(seed) {}
  std::string next();

 private:
  std::mt19937_64 random_;
};

struct StudyUids {
  Identity identity;
  std::string ct_series, frame_of_reference, plan, plan_series, image_series, image_frame_of_reference;
  std::string structures;                 // empty where no target is drawn
  std::vector<std::string> ct_instances;  // of the planning CT
};

StudyUids make_uids(const PhantomOptions& options, Uids& uids);

// The moment of an X-ray and what is different then.
struct Moment {
  double time_s = 0.0;  // after 10:15
  int instance = 1;
  Eigen::Vector3d displacement_mm = Eigen::Vector3d::Zero();
  std::uint64_t noise_seed = 0;
  int day = 1;  // of March 2026
};

// Of the X-rays at this gantry angle.
std::string image_label(double gantry_angle_deg);

// Writes a file per slice. Returns the UIDs of the slices.
std::vector<std::string> write_ct(const PhantomOptions& options, const StudyUids& study, const std::string& series_uid,
                                  const Eigen::Vector3d& displacement_mm, Uids& uids,
                                  const std::filesystem::path& folder, const Progress& progress);

void write_plan(const PhantomOptions& options, const StudyUids& study, const std::filesystem::path& path);

// The X-ray at the gantry angle with this number.
void write_xray(const PhantomOptions& options, const StudyUids& study, const std::string& sop_instance_uid,
                std::size_t number, const Moment& moment, const std::filesystem::path& path);

// The target, of a breathing phantom at the end of expiration: a circle per slice.
void write_structures(const PhantomOptions& options, const StudyUids& study, Uids& uids,
                      const std::filesystem::path& path);

}  // namespace isoshift
