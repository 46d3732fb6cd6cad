#include "io/dicom/rt_image.h"

#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <chrono>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>

#include "base/error.h"
#include "io/dicom/decode.h"
#include "io/dicom/pixel_padding.h"

namespace isoshift {
namespace {

constexpr double kMaxReadOutNoise = 0.01;  // degrees or mm, between exposures of one image

// The items of the Exposure Sequence that speak of one frame: of several frames those that name it.
class Exposures {
 public:
  Exposures(const DicomItem& dataset, int frames) : items_(dataset.items(DCM_ExposureSequence)) {
    frame_numbers_.resize(items_.size());
    std::ranges::transform(items_, frame_numbers_.begin(),
                           [](const DicomItem& item) { return item.number(DCM_ReferencedFrameNumber); });
    tell_frames_apart_ = frames > 1 && name_frames();
  }

  bool name_frames() const {
    return std::ranges::any_of(frame_numbers_, [](const auto& number) { return number.has_value(); });
  }
  // Whether frames differ in what the exposures say. Else the top level says the same.
  bool tell_frames_apart() const { return tell_frames_apart_; }
  std::vector<DicomItem> of(int frame) const {
    std::vector<DicomItem> items;
    for (std::size_t n = 0; n < items_.size(); ++n)
      if (!frame_numbers_[n] || *frame_numbers_[n] == frame + 1) items.push_back(items_[n]);
    return items;
  }

 private:
  std::vector<DicomItem> items_;
  std::vector<std::optional<double>> frame_numbers_;  // which frame each names
  bool tell_frames_apart_;
};

// A dataset as one frame sees it: the exposure's value where it has one, else the top level's. Several exposures must
// agree. If the top level does not, and the exposures do not tell frames apart, that is a contradiction.
class FrameAttributes {
 public:
  FrameAttributes(DicomItem dataset, std::vector<DicomItem> exposures, bool tell_frames_apart)
      : dataset_(std::move(dataset)), exposures_(std::move(exposures)), tell_frames_apart_(tell_frames_apart) {}

  std::optional<double> number(const DcmTagKey& tag) const {
    std::optional<double> agreed;
    for (const DicomItem& exposure : exposures_) {
      const auto value = exposure.number(tag);
      if (!value) continue;
      if (agreed && std::abs(*value - *agreed) > kMaxReadOutNoise)
        throw Error(
            fmt::format("{}: {} is {} in one exposure and {} in another of the same image, or {} is missing, which "
                        "tells their frames",
                        dataset_.where(), described(tag), *agreed, *value, described(DCM_ReferencedFrameNumber)));
      if (!agreed) agreed = value;
    }
    return agreed ? agreed : dataset_.number(tag);
  }

  // A length or, with a turn, an angle.
  std::optional<double> read_out(const DcmTagKey& tag, double turn = std::numeric_limits<double>::infinity()) {
    const std::optional<double> value = number(tag), of_all = dataset_.number(tag);
    if (tell_frames_apart_ || !of_all) return value;
    const double most = std::isfinite(turn) ? kMaxTableTurnDeg : kMaxTableMoveMm;
    if (std::abs(std::remainder(*value - *of_all, turn)) > most)
      contradictions_.push_back(fmt::format("{}: {} is {}, and {} in its {}, which was used", dataset_.where(),
                                            described(tag), *of_all, *value, described(DCM_ExposureSequence)));
    return value;
  }

  // A read-out of more than a turn is no angle.
  std::optional<double> angle_deg(const DcmTagKey& tag) {
    constexpr double kTurnDeg = 360.0;
    const std::optional<double> value_deg = read_out(tag, kTurnDeg);
    if (value_deg && std::abs(*value_deg) > kTurnDeg)
      throw Error(
          fmt::format("{}: {} is {} degrees, expected -360 to 360", dataset_.where(), described(tag), *value_deg));
    return value_deg;
  }

  const std::vector<std::string>& contradictions() const { return contradictions_; }

 private:
  DicomItem dataset_;
  std::vector<DicomItem> exposures_;
  bool tell_frames_apart_;
  std::vector<std::string> contradictions_;  // between exposures and the top level
};

template <int N>
std::optional<Eigen::Matrix<double, N, 1>> vector_of(const DicomItem& dataset, const DcmTagKey& tag) {
  if (!dataset.has_value(tag)) return std::nullopt;
  return Eigen::Matrix<double, N, 1>(dataset.required_numbers(tag, N).data());
}

// Cine module (PS3.3 C.7.6.5): increments in ms, one for all frames or one for each, the first 0. Nothing where the
// file does not say when a later frame was taken; a frame that was taken no later than the one before says nothing.
std::optional<double> frame_offset_s(const DicomItem& d, int frame) {
  const std::vector<double> increments_ms = d.numbers(DCM_FrameTimeVector);
  if (frame == 0) return increments_ms.empty() ? 0.0 : increments_ms.front() / 1000.0;
  if (static_cast<int>(increments_ms.size()) > frame) {
    const auto end = increments_ms.begin() + frame + 1;
    const bool goes_on = std::all_of(increments_ms.begin() + 1, end, [](double ms) { return ms > 0.0; });
    return goes_on ? std::optional(std::accumulate(increments_ms.begin(), end, 0.0) / 1000.0) : std::nullopt;
  }
  const auto increment_ms = d.number(DCM_FrameTime);
  return increment_ms && *increment_ms > 0.0 ? std::optional(frame * *increment_ms / 1000.0) : std::nullopt;
}

// Jaws and leaves of several exposures of one image: what any of them left open was irradiated. Leaves count only if
// there is one exposure.
JawOpenings jaws_of(const std::vector<DicomItem>& exposures) {
  JawOpenings all;
  const auto widen = [](std::optional<JawOpening>& wide, const std::optional<JawOpening>& by) {
    if (by) wide = wide ? JawOpening{std::min(wide->from_mm, by->from_mm), std::max(wide->to_mm, by->to_mm)} : *by;
  };
  for (const DicomItem& exposure : exposures) {
    const std::vector<DicomItem> devices = exposure.items(DCM_BeamLimitingDeviceSequence);
    JawOpenings of_one = read_jaws(devices, devices);
    if (exposures.size() == 1) return of_one;
    widen(all.x, of_one.x);
    widen(all.y, of_one.y);
    std::ranges::move(of_one.problems, std::back_inserter(all.problems));
  }
  return all;
}

RtImage read_frame(const std::filesystem::path& path, const DicomItem& d, const PixelFormat& format, int frame,
                   std::vector<DicomItem> exposures, bool tell_frames_apart) {
  RtImage image;
  image.jaws = jaws_of(exposures);
  FrameAttributes attributes(d, std::move(exposures), tell_frames_apart);
  image.path = path;
  image.identity = read_identity(d);
  image.sop_class_uid = d.required_uid(DCM_SOPClassUID);
  image.sop_instance_uid = d.required_uid(DCM_SOPInstanceUID);
  image.series_instance_uid = d.uid(DCM_SeriesInstanceUID).value_or("");
  image.frame_of_reference_uid = d.uid(DCM_FrameOfReferenceUID);
  image.label = d.text(DCM_RTImageLabel).value_or(path.stem().string());
  image.frame = frame;
  if (format.frames > 1) image.label += fmt::format("#{}", frame + 1);
  image.image_type = rt_image_type(d);
  image.approval_status = d.text(DCM_ApprovalStatus).value_or("");
  image.reported_values_origin = d.text(DCM_ReportedValuesOrigin);
  image.fraction_number = d.number(DCM_FractionNumber);
  image.patient_position = d.text(DCM_PatientPosition);
  // The first counts, as where files are chosen (StudyFiles).
  if (const auto plans = d.items(DCM_ReferencedRTPlanSequence); !plans.empty())
    image.plan_sop_instance_uid = plans.front().uid(DCM_ReferencedSOPInstanceUID);
  image.beam_number = d.integer(DCM_ReferencedBeamNumber);
  read_acquisition_time(d, image);
  const std::optional<double> offset_s = frame_offset_s(d, frame);
  image.frame_offset_s = offset_s.value_or(0.0);
  image.has_own_time = offset_s.has_value();
  image.kvp = attributes.number(DCM_KVP);
  if (image.kvp && *image.kvp <= 0.0) image.kvp.reset();  // of programs that do not know it

  image.plane = d.text(DCM_RTImagePlane);
  image.sad_mm = d.number(DCM_RadiationMachineSAD);
  image.sid_mm = d.number(DCM_RTImageSID);
  image.receptor_translation_mm = vector_of<3>(d, DCM_XRayImageReceptorTranslation);
  image.receptor_angle_deg = attributes.angle_deg(DCM_XRayImageReceptorAngle);
  if (d.has_value(DCM_RTImageOrientation)) image.orientation = d.required_numbers(DCM_RTImageOrientation, 6);
  image.pixel_spacing_mm = vector_of<2>(d, DCM_ImagePlanePixelSpacing);
  image.position_mm = vector_of<2>(d, DCM_RTImagePosition);
  image.gantry_angle_deg = attributes.angle_deg(DCM_GantryAngle);
  image.gantry_pitch_angle_deg = attributes.angle_deg(DCM_GantryPitchAngle);
  image.collimator_angle_deg = attributes.angle_deg(DCM_BeamLimitingDeviceAngle);
  image.table = read_table_read_outs(
      [&](const TableReadOut& read_out) {
        return read_out.is_angle ? attributes.angle_deg(read_out.tag) : attributes.read_out(read_out.tag);
      },
      image.reported_values_origin);
  image.contradictions = attributes.contradictions();
  image.isocenter_mm = vector_of<3>(d, DCM_IsocenterPosition);

  for (const auto& [keyword, tag] : kEquipmentAttributes)
    if (const auto value = d.text(tag)) image.equipment[keyword] = *value;
  image.columns = format.columns;
  image.rows = format.rows;
  image.intensity_relationship = d.text(DCM_PixelIntensityRelationship);
  if (const auto sign = d.number(DCM_PixelIntensityRelationshipSign))
    image.intensity_sign = static_cast<int>(std::clamp(*sign, -1e9, 1e9));
  image.photometric_interpretation = d.text(DCM_PhotometricInterpretation).value_or("");
  image.is_lossy = d.text(DCM_LossyImageCompression) == "01";
  image.has_modality_lut = !d.items(DCM_ModalityLUTSequence).empty();
  return image;
}

// Both angles turn counter-clockwise seen from the source, which is how the image is displayed (PS3.3 C.8.8.2.7). An
// image that is itself turned or mirrored on the receptor shows them turned back.
double collimator_angle_on_image_rad(const RtImage& image) {
  if (image.pixel_from_room) return 0.0;  // the angle is of the linac, not of an imager that a matrix places
  const std::vector<double> orientation = image.orientation.value_or(std::vector{1.0, 0.0, 0.0, 0.0, -1.0, 0.0});
  const Eigen::Vector3d row_direction(orientation.data()), column_direction(orientation.data() + 3);
  const double on_receptor_rad =
      rad_from_deg(image.collimator_angle_deg.value_or(0.0) - image.receptor_angle_deg.value_or(0.0)) -
      std::atan2(row_direction.y(), row_direction.x());
  const bool is_mirrored = row_direction.cross(column_direction).z() > 0.0;
  return is_mirrored ? -on_receptor_rad : on_receptor_rad;
}

// Pixels that the file says are none get the darkest value of the others.
void put_padding(const PixelPadding& padding, const std::vector<std::int32_t>& stored_values, XrayImage& xray) {
  if (!padding.is_given()) return;
  std::vector<float>& values = xray.values.pixels;
  Image<std::uint8_t> mask(xray.values.columns, xray.values.rows);
  std::ranges::transform(stored_values, mask.pixels.begin(),
                         [&](std::int32_t stored) { return padding.holds(stored); });
  if (std::ranges::count(mask.pixels, 1) == 0) return;
  const bool is_intensity = xray.meaning == XrayImage::Meaning::kIntensity;
  std::optional<float> darkest;
  for (std::size_t n = 0; n < values.size(); ++n)
    if (mask.pixels[n] == 0 && (!darkest || (is_intensity ? values[n] < *darkest : values[n] > *darkest)))
      darkest = values[n];
  if (!darkest)
    throw Error(fmt::format("{}: all pixels are padding ({})", xray.label, described(DCM_PixelPaddingValue)));
  for (std::size_t n = 0; n < values.size(); ++n)
    if (mask.pixels[n] != 0) values[n] = *darkest;
  xray.padding = std::move(mask);
}

}  // namespace

std::string rt_image_type(const DicomItem& dataset) {
  constexpr const char* kDrr = "DRR";
  std::vector<std::string> values = dataset.texts(DCM_ImageType);
  if (values.size() < 3) return "";
  values.erase(values.begin(), values.begin() + 2);
  for (std::string& value : values)
    std::ranges::transform(value, value.begin(), [](unsigned char c) { return std::toupper(c); });
  return std::ranges::find(values, kDrr) == values.end() ? values.front() : kDrr;
}

const std::map<std::string, DcmTagKey, std::less<>> kEquipmentAttributes = {
    {"DetectorDescription", DCM_DetectorDescription},
    {"DetectorID", DCM_DetectorID},
    {"DeviceSerialNumber", DCM_DeviceSerialNumber},
    {"Manufacturer", DCM_Manufacturer},
    {"ManufacturerModelName", DCM_ManufacturerModelName},
    {"Modality", DCM_Modality},
    {"ProtocolName", DCM_ProtocolName},
    {"RTImageLabel", DCM_RTImageLabel},
    {"RadiationMachineName", DCM_RadiationMachineName},
    {"SeriesDescription", DCM_SeriesDescription},
    {"StationName", DCM_StationName},
    {"ViewPosition", DCM_ViewPosition},
};

bool RtImage::is_rt_image() const { return sop_class_uid == UID_RTImageStorage; }

std::vector<RtImage> read_rt_images(const DicomFile& file, Notes& notes) {
  const std::filesystem::path& path = file.path();
  const DicomItem dataset = file.dataset();
  if (dataset.uid(DCM_SOPClassUID) == UID_RTImageStorage) expect_modality(dataset, "RTIMAGE");
  const PixelFormat format = pixel_format(dataset);
  const Exposures exposures(dataset, format.frames);
  std::vector<RtImage> images;
  for (int frame = 0; frame < format.frames; ++frame) {
    std::vector<DicomItem> of_frame = exposures.of(frame);
    if (exposures.name_frames() && of_frame.empty())
      notes.warnings.push_back(fmt::format("{}: frame {} was left aside: no item of {} tells its geometry",
                                           path.string(), frame + 1, described(DCM_ExposureSequence)));
    else
      images.push_back(read_frame(path, dataset, format, frame, std::move(of_frame), exposures.tell_frames_apart()));
  }
  for (RtImage& image : images) {
    image.sha256 = file.sha256();
    for (const std::string& problem : image.jaws.problems) notes.warnings.push_back(problem);
  }
  return images;
}

std::optional<DeclaredAperture> declared_aperture(const RtImage& image, const JawOpenings& jaws, const XrayView& view) {
  const std::vector<Eigen::Vector2d> outline_mm = outline_of(jaws);
  if (image.pixel_from_room || !image.gantry_angle_deg || outline_mm.empty()) return std::nullopt;
  const Eigen::Isometry3d fixed_from_collimator(
      Eigen::AngleAxisd(rad_from_deg(*image.gantry_angle_deg), Eigen::Vector3d::UnitY()) *
      Eigen::AngleAxisd(rad_from_deg(image.collimator_angle_deg.value_or(0.0)), Eigen::Vector3d::UnitZ()));
  // Jaws are those of the treatment beam: an X-ray of the kV imager may name them, and does not pass them.
  DeclaredAperture aperture{.corners_px = {}, .is_of_exposure = view.beam == Beam::kMegavoltage};
  for (const Eigen::Vector2d& point_mm : outline_mm) {
    const auto corner_px = view.project(fixed_from_collimator * Eigen::Vector3d(point_mm.x(), point_mm.y(), 0.0));
    if (!corner_px) return std::nullopt;
    aperture.corners_px.push_back(*corner_px);
  }
  return aperture;
}

XrayImage read_xray_image(const DicomFile& file, const RtImage& image, const XrayView& view) {
  const PixelFormat format = pixel_format(file.dataset());
  const std::vector<std::int32_t> stored_values = decode_frame(file, format, image.frame);
  const double slope = file.dataset().number(DCM_RescaleSlope).value_or(1.0);
  const double intercept = file.dataset().number(DCM_RescaleIntercept).value_or(0.0);
  if (slope == 0.0) throw Error(fmt::format("{}: {} is 0", image.path.string(), described(DCM_RescaleSlope)));

  XrayImage xray;
  xray.label = image.label;
  xray.view = view;
  xray.values = Image<float>(format.columns, format.rows);
  xray.collimator_angle_rad = collimator_angle_on_image_rad(image);
  xray.declared_aperture = declared_aperture(image, image.jaws, view);
  const bool is_linear = image.intensity_relationship == "LIN";
  xray.meaning = is_linear ? XrayImage::Meaning::kIntensity : XrayImage::Meaning::kLineIntegral;

  // The sign speaks of stored values (C.8.11.3.1.2). Where rescaled values rise with the intensity they are it (LIN) or
  // its logarithm (LOG). Where they fall, LIN counts from the value that stands for no intensity, the largest or
  // smallest one that can be stored.
  const bool rises = *image.intensity_sign * slope > 0.0;
  const double dark = *image.intensity_sign > 0 ? 0.0 : format.max_stored_value();
  if (is_linear && !rises && *image.intensity_sign > 0 && std::ranges::min(stored_values) < 0)
    throw Error(fmt::format(
        "{}: {} is LIN and its sign 1, {} is {}, and pixels are negative: which of them stands for no intensity is "
        "not known",
        image.path.string(), described(DCM_PixelIntensityRelationship), described(DCM_RescaleSlope), slope));
  std::ranges::transform(stored_values, xray.values.pixels.begin(), [&](std::int32_t stored) {
    const double rescaled = slope * stored + intercept;
    if (!is_linear) return static_cast<float>(rises ? -rescaled : rescaled);
    return static_cast<float>(rises ? rescaled : std::abs(slope) * std::abs(stored - dark));
  });
  put_padding(PixelPadding(file.dataset()), stored_values, xray);
  return xray;
}

}  // namespace isoshift
