#pragma once
// RT Images (PS3.3 A.17, C.8.8.2): what the file says, what it lacks, and the X-ray view that follows from it. X-rays
// of other classes (DX, CR, XA) say too little; a machine profile supplies their projection matrix (machine_profile.h).

#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "geometry/imager_error.h"
#include "geometry/patient_setup.h"
#include "geometry/xray_image.h"
#include "io/dicom/identity.h"
#include "io/dicom/jaws.h"
#include "io/dicom/notes.h"
#include "io/dicom/table_read_outs.h"

namespace isoshift {

// PixelIntensityRelationship (0028,1040) and its sign (0028,1041), which speaks about stored values: +1, lower stored
// value means less X-ray intensity.
struct PixelIntensity {
  enum class Relationship { kLin, kLog };
  Relationship relationship = Relationship::kLin;
  int sign = 1;
};

// "LIN+", "LIN-", "LOG+", "LOG-"; nothing for any other word.
std::optional<PixelIntensity> pixel_intensity_from(std::string_view word);
std::string to_string(const PixelIntensity& intensity);

// The attributes of one X-ray, a frame of an RT Image, as written; an optional without value is absent or empty in the
// file. Where the frame's item of the Exposure Sequence has a value it wins over the top level. Angles in degrees,
// lengths in mm.
struct RtImage {
  std::filesystem::path path;
  std::string sha256;        // of the file, where it was read whole
  int frame = 0;             // of the file, counted from 0
  bool has_own_time = true;  // false: a later frame of a file that does not say when it was taken
  Identity identity;
  std::string sop_class_uid;
  std::string sop_instance_uid;
  std::string series_instance_uid;
  std::optional<std::string> frame_of_reference_uid;
  std::string label;            // RTImageLabel, else the file's name without extension; of several frames with "#2"
  std::string image_type;       // rt_image_type()
  std::string approval_status;  // ApprovalStatus; may be empty
  std::optional<std::string> reported_values_origin;
  std::optional<double> fraction_number;
  std::optional<std::string> patient_position;
  std::optional<std::string> plan_sop_instance_uid;
  std::optional<int> beam_number;
  std::optional<std::string> acquisition_date;
  std::optional<std::string> acquisition_time;  // of the same attribute as the date
  std::optional<int> utc_offset_min;            // east of Greenwich; unset: the file does not say
  std::string invalid_utc_offset;               // what it says instead, which no zone has
  double frame_offset_s = 0.0;                  // of a later frame, from the first one
  std::optional<double> kvp;

  std::optional<std::string> plane;
  std::optional<double> sad_mm, sid_mm;
  std::optional<Eigen::Vector3d> receptor_translation_mm;
  std::optional<double> receptor_angle_deg;
  std::optional<std::vector<double>> orientation;
  std::optional<Eigen::Vector2d> pixel_spacing_mm;  // row spacing, column spacing
  std::optional<Eigen::Vector2d> position_mm;
  std::optional<double> gantry_angle_deg, gantry_pitch_angle_deg, collimator_angle_deg;
  JawOpenings jaws;  // of the exposure
  TableReadOuts table;
  std::vector<std::string> contradictions;      // of these, between the exposure, which counts, and the top level
  std::optional<Eigen::Vector3d> isocenter_mm;  // IsocenterPosition, in this image's own frame of reference

  std::map<std::string, std::string, std::less<>> equipment;   // what machine profiles tell images apart by, by keyword
  std::optional<Eigen::Matrix<double, 3, 4>> pixel_from_room;  // replaces the geometry of the attributes above
  std::optional<double> gantry_offset_deg;  // what a machine profile has added to GantryAngle; nothing: it does not say
  std::optional<KnownImager> imager;        // what a machine profile knows of its errors

  int columns = 0, rows = 0;
  std::optional<std::string> intensity_relationship;
  std::optional<int> intensity_sign;  // as written; 1 or -1 where it says something
  std::string photometric_interpretation;
  bool has_modality_lut = false;
  bool is_lossy = false;  // compressed with loss

  bool is_rt_image() const;  // and not an X-ray of another class
};

inline constexpr double kMaxAngleNoiseDeg = 0.01;  // read-outs such as 359.998 mean 0

// The attributes that machine profiles may tell images apart by.
extern const std::map<std::string, DcmTagKey, std::less<>> kEquipmentAttributes;

// The frames of a file. If the items of the Exposure Sequence name frames (PS3.3 C.8.8.2.8), a frame that no item names
// has no geometry: it is not used, with a warning.
std::vector<RtImage> read_rt_images(const DicomFile& file, Notes& notes);
// The same for a path: the file is read up to its pixels.
inline std::vector<RtImage> read_rt_images(const std::filesystem::path& path, Notes& notes) {
  return read_rt_images(DicomFile::read(path, DicomFile::Extent::kHeader), notes);
}

// What an RT Image says that it is: the third value of ImageType (PS3.3 C.8.8.2), in capitals; DRR if that or a later
// value is DRR. Empty: it does not say.
std::string rt_image_type(const DicomItem& dataset);

// A date as DICOM writes it, "20260301"; ACR-NEMA wrote dots (PS3.5 6.2). Nothing for what is no date.
std::optional<std::string> date_digits(std::string_view written);

// Date and time of acquisition, else of the content.
void read_acquisition_time(const DicomItem& dataset, RtImage& image);

// Values that a person supplies because the files lack them. They also replace values of the files; this is noted.
struct RtImageSwitches {
  std::map<std::string, double> gantry_angle_deg;  // by label
  std::optional<double> couch_angle_deg, couch_pitch_deg, couch_roll_deg, sad_mm, sid_mm;
  std::optional<Eigen::Vector2d> position_mm;
  bool assume_centered = false;
  std::optional<PixelIntensity> intensity;
  std::optional<Beam> beam;
  std::optional<PatientPosition> patient_position;
};

// The image with the switches applied, each noted as an override; `origin` says where they come from if not from the
// command line.
RtImage with_switches(RtImage image, const RtImageSwitches& switches, Notes& notes, const std::string& origin = "");

// A required attribute without a value of use, and the switch that supplies it (empty: no switch does).
struct MissingAttribute {
  DcmTagKey tag;
  std::string supplied_by;
  std::string found;  // a value that says nothing: "DISP"; empty where there is none

  // "is missing", `is "DISP", which does not tell`.
  std::string problem() const { return found.empty() ? "is missing" : "is \"" + found + "\", which does not tell"; }
};

// Everything that registration needs and `image` lacks, all at once.
std::vector<MissingAttribute> missing_attributes(const RtImage& image);

// Findings about the image type and the origin of the angles. Throws Error for faults that nobody may allow (BLANK,
// FLUENCE, a tilted gantry, values out of range).
std::vector<FailedCheck> rt_image_findings(const RtImage& image);

// The beam quality: KVP above 1000 is MV; without KVP by image type (PORTAL is MV), with a warning.
Beam beam_of(const RtImage& image, Notes& notes);

// When it was taken: seconds since an epoch, with fractions and, of frames of one file, their own times (FrameTime,
// FrameTimeVector); nothing where date or time is absent or malformed.
std::optional<double> acquisition_seconds(const RtImage& image);

// Why there are no such seconds: "AcquisitionTime (0008,0032) is missing".
std::string why_time_is_unknown(const RtImage& image);

// The same for people, "2026-03-01 10:15:00"; empty where it is unknown.
std::string acquired(const RtImage& image);

// The label without the number of its frame.
std::string imager_label(const RtImage& image);

// Table read-outs at imaging, each from the first image that has it. An angle that no image has is taken as 0, with a
// warning that names the switch that supplies it.
TableAngles table_angles(std::span<const RtImage> images, Notes& notes);

// The imager's geometry in IEC terms. Precondition: nothing missing. Throws Error where values contradict each other.
CarmGeometry carm_geometry(const RtImage& image, Notes& notes);

// The camera: from carm_geometry(), or from the projection matrix.
XrayView xray_view(const RtImage& image, Beam beam, Notes& notes);

// The aperture of jaws on the image; nothing where the image has a projection matrix instead of angles.
std::optional<DeclaredAperture> declared_aperture(const RtImage& image, const JawOpenings& jaws, const XrayView& view);

// Turns the pixels of its file, read whole, into intensity or line integrals as the image declares
// (docs/conventions.md).
XrayImage read_xray_image(const DicomFile& file, const RtImage& image, const XrayView& view);

}  // namespace isoshift
