#pragma once
// A digital phantom as an exported study: CT, RT Plan, RT Images and the truth.

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "io/dicom/ct_series.h"
#include "phantom/bends.h"
#include "phantom/breathing.h"
#include "phantom/xray_simulation.h"

namespace isoshift {

struct PhantomOptions {
  enum class Anatomy { kHead, kSpine, kThorax, kBalls };
  Anatomy anatomy = Anatomy::kHead;
  Placement placement;                                  // how the patient lies, set-up error included
  std::vector<double> gantry_angles_deg = {0.0, 90.0};  // one X-ray each
  double receptor_angle_deg = 0.0;                      // of the imager's panel, about the central ray
  PanelFault panel_fault;                               // of which the X-rays' files do not know
  double ct_tilt_deg = 0.0;                             // of the CT's slices about the patient's x axis
  double voxel_mm = 1.0;                                // of the CT, in plane; slices are 1.5 times as thick
  int image_pixels = 512;                               // along each edge; the panel is 410 mm wide
  double photons = 20000.0;                             // per open pixel; fewer mean more noise
  std::vector<double> megavoltage_angles_deg;           // of those gantry angles, the ones taken with 6 MV
  BreathingOptions breathing;                           // of a thorax
  std::vector<Bend> bends;                              // of the patient in the room; none: as in the CT
  int fractions = 1;                                    // days of treatment, one session of X-rays on each
  std::uint64_t seed = 1;                               // of anatomy, noise and UIDs

  // Throws UsageError naming the field and its value.
  void check() const;
};

// As the command line names it.
std::string_view anatomy_name(PhantomOptions::Anatomy anatomy);

// With bends every vertebra has a size and processes of its own; without, the CT and the X-rays show the same shapes.
BentPhantom phantom_of(const PhantomOptions& options,
                       const Eigen::Vector3d& target_displacement_mm = Eigen::Vector3d::Zero());

// A target is drawn in RTSTRUCT.dcm and named by the plan.
bool has_target(const PhantomOptions& options);

// Fills an existing folder: CT/, RTIMAGE/, RTPLAN.dcm, truth.json; of a thorax and of a bent patient also RTSTRUCT.dcm
// with the target, which lies at the isocenter. truth.json of a bent patient has the motion of every rigid body, too.
// One that breathes has PHASES/00/, 01/, ..., RT Images of every imager at every moment, and truth.csv: where the
// target was, mm from where it was planned, IEC 61217 fixed. Every later fraction has RTIMAGE/F02/, ... and
// truth_F02.json,
// ...: its setup error is that of the first and a random one of 2 mm and 0.7 degrees (one standard deviation) per axis.
void write_phantom_study(const PhantomOptions& options, const std::filesystem::path& folder, const Progress& progress);

}  // namespace isoshift
