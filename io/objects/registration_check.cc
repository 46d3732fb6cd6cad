#include "io/objects/registration_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "base/error.h"
#include "geometry/rotation.h"
#include "io/objects/object_header.h"
#include "io/objects/spatial_registration.h"

namespace isoshift {
namespace {

constexpr double kItkRigid = 1e-5;  // ITK refuses above this

bool are_same_but_for_rounding(const Eigen::Matrix4d& a, const Eigen::Matrix4d& b) {
  constexpr double kRounding = 1e-6;  // of a DS
  return (a - b).cwiseAbs().maxCoeff() <= kRounding;
}

bool is_identity_but_for_rounding(const Eigen::Matrix4d& matrix) {
  return are_same_but_for_rounding(matrix, Eigen::Matrix4d::Identity());
}

// A UID as PS3.5, 9.1 allows: components of digits without leading zeros, 64 characters at most.
bool is_uid(const std::string& text) {
  if (text.empty() || text.size() > 64 || text.back() == '.') return false;
  bool at_start = true;
  for (std::size_t n = 0; n < text.size(); ++n) {
    const char c = text[n];
    if (c == '.') {
      if (at_start) return false;
      at_start = true;
      continue;
    }
    const bool more_digits = n + 1 < text.size() && text[n + 1] != '.';
    if (c < '0' || c > '9' || (at_start && c == '0' && more_digits)) return false;
    at_start = false;
  }
  return true;
}

class Checker {
 public:
  explicit Checker(const DicomItem& dataset) : dataset_(dataset) {}

  CheckedRegistration check() {
    result_.identity = read_identity(dataset_);
    result_.is_by_isoshift = dataset_.text(DCM_Manufacturer) == kManufacturer;
    check_attributes();
    check_items();
    check_references();
    return std::move(result_);
  }

 private:
  void error(std::string text) { result_.error(std::move(text)); }
  void note(std::string text) { result_.note(std::move(text)); }
  // An error that leaves more than one meaning to the object.
  void ambiguous(std::string text) {
    error(std::move(text));
    means_one_matrix_ = false;
  }

  // The value of a UI attribute; a finding where it is missing or malformed.
  std::string uid_of(const DicomItem& item, const DcmTagKey& tag, const std::string& name) {
    std::string uid = item.text(tag).value_or("");
    if (uid.empty())
      error(fmt::format("{}: {} is missing", name, described(tag)));
    else if (!is_uid(uid))
      error(fmt::format("{}: {} is \"{}\", which is not a UID", name, described(tag), uid));
    return uid;
  }

  void check_attributes() {
    for (const DcmTagKey& tag : {DCM_SOPInstanceUID, DCM_StudyInstanceUID, DCM_SeriesInstanceUID})
      uid_of(dataset_, tag, "dataset");
    result_.registered_frame_uid = uid_of(dataset_, DCM_FrameOfReferenceUID, "dataset");
    for (const DcmTagKey& tag : {DCM_ContentDate, DCM_ContentTime, DCM_InstanceNumber, DCM_ContentLabel})
      if (!dataset_.has_value(tag)) error(fmt::format("dataset: {} is missing", described(tag)));
    if (const auto modality = dataset_.text(DCM_Modality); modality != "REG")
      error(fmt::format("dataset: {} is \"{}\", expected REG", described(DCM_Modality), modality.value_or("")));
    const std::string label = dataset_.text(DCM_ContentLabel).value_or("");
    if (const auto description = dataset_.text(DCM_ContentDescription);
        description && description->find("NOT ACCEPTED") != std::string::npos)
      note(fmt::format("{} is \"{}\": a person has to decide", described(DCM_ContentDescription), *description));
    const auto is_code = [](char c) {
      return (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == ' ' || c == '_';
    };
    if (label.size() > 16 || !std::ranges::all_of(label, is_code))
      error(fmt::format("dataset: {} is \"{}\", expected at most 16 capitals, digits, spaces or underscores",
                        described(DCM_ContentLabel), label));
  }

  // PS3.3 C.20.2 asks for no order.
  void check_order(const std::vector<bool>& is_registered_frame) {
    constexpr const char* kWhy =
        "Readers that take the second item for the result, or pair items with series by their order, take the wrong "
        "one";
    const auto found = std::ranges::find(is_registered_frame, true);
    if (found == is_registered_frame.end())
      error(fmt::format("no item is the registered frame with an identity. {}", kWhy));
    else if (found != is_registered_frame.begin())
      note(
          fmt::format("item {}, and not the first, is the registered frame with an identity, as the standard "
                      "allows. {}",
                      found - is_registered_frame.begin() + 1, kWhy));
  }

  void check_items() {
    const std::vector<DicomItem> items = dataset_.items(DCM_RegistrationSequence);
    if (items.empty()) error(fmt::format("dataset: {} has no item", described(DCM_RegistrationSequence)));
    int others = 0;
    bool are_all_read = true;
    std::set<std::string> unmoved;                               // frames
    std::vector<bool> is_registered_frame(items.size(), false);  // with an identity
    for (std::size_t n = 0; n < items.size(); ++n) {
      const std::string name = fmt::format("item {}", n + 1);
      const std::string frame = frame_of(items[n], name);
      const std::optional<Eigen::Affine3d> matrix = matrix_of(items[n], name);
      are_all_read = are_all_read && matrix;
      if (!matrix) continue;
      const bool is_identity = is_identity_but_for_rounding(matrix->matrix());
      if (is_identity && matrix->matrix() != Eigen::Matrix4d::Identity())
        note(
            fmt::format("{}: is the identity but for rounding. Readers that look for the item that is not exactly the "
                        "identity take this one",
                        name));
      is_registered_frame[n] = is_identity && frame == result_.registered_frame_uid;
      if (!is_identity && frame == result_.registered_frame_uid)
        ambiguous(fmt::format("{}: moves the registered frame against itself", name));
      check_places(items[n], name, frame, matrix->matrix());
      const bool is_other_frame = !frame.empty() && frame != result_.registered_frame_uid;
      if (is_identity && is_other_frame) unmoved.insert(frame);
      if (!is_identity) ++others;
      // An identity counts where nothing else moves: the frames coincide.
      if (is_identity && (!is_other_frame || others > 0)) continue;
      result_.registered_from_source = matrix;
      result_.source_frame_uid = frame;
      result_.source_is_that_of_images = !items[n].items(DCM_ReferencedImageSequence).empty();
    }
    if (are_all_read && !items.empty()) check_order(is_registered_frame);
    if (others == 0 && unmoved.size() > 1) result_.registered_from_source.reset();  // which one is meant is not known
    if (others > 1)
      ambiguous(fmt::format("{} items are not the identity. SlicerRT multiplies all matrices of a file", others));
    if (others > 0 && !unmoved.empty() && means_one_matrix_)
      ambiguous(
          "it registers several frames, one of them by an identity: which of them is that of the treatment is not "
          "known");
    if (result_.registered_frame_uid == kIecFixedFrameUid)
      ambiguous(
          "dataset: registers the room (IEC 61217 Fixed), which is not the frame of a CT: the matrix takes the CT to "
          "the room");
    if (!means_one_matrix_) result_.registered_from_source.reset();
    if (result_.source_frame_uid == kIecFixedFrameUid)
      note(
          "begins in the room's axes (IEC 61217 Fixed): to be chained only with registrations of the same patient "
          "position (C.20.2.1.1)");
    if (others == 0 && items.size() > 1)
      note("all matrices are the identity: readers that look for the other one find none");
  }

  // Whether the item contradicts an earlier one: no frame and no image lies in two places.
  void check_places(const DicomItem& item, const std::string& name, const std::string& frame,
                    const Eigen::Matrix4d& matrix) {
    const auto differs_from_earlier = [&](const std::string& uid) {
      return !are_same_but_for_rounding(matrix_of_.try_emplace(uid, matrix).first->second, matrix);
    };
    if (frame == kIecFixedFrameUid && is_identity_but_for_rounding(matrix))
      ambiguous(fmt::format("{}: says that the room (IEC 61217 Fixed) is the registered frame", name));
    if (!frame.empty() && frame != result_.registered_frame_uid && differs_from_earlier(frame))
      ambiguous(fmt::format("{}: gives the frame {} another matrix than an earlier item does", name, frame));
    for (const DicomItem& image : item.items(DCM_ReferencedImageSequence)) {
      const std::string uid = image.text(DCM_ReferencedSOPInstanceUID).value_or("");
      if (uid.empty() || !differs_from_earlier(uid)) continue;
      ambiguous(fmt::format("{}: gives the image {} another matrix than an earlier item does", name, uid));
      break;
    }
  }

  // The frame an item registers.
  std::string frame_of(const DicomItem& item, const std::string& name) {
    const std::string frame = item.text(DCM_FrameOfReferenceUID).value_or("");
    if (!frame.empty()) return uid_of(item, DCM_FrameOfReferenceUID, name);
    if (item.items(DCM_ReferencedImageSequence).empty())
      error(fmt::format("{}: has neither {} nor {}: it is not known what it registers", name,
                        described(DCM_FrameOfReferenceUID), described(DCM_ReferencedImageSequence)));
    else
      note(
          fmt::format("{}: {} is missing. For images without one the matrix takes mm on the image plane (PS3.17 O.1); "
                      "ITK refuses the file",
                      name, described(DCM_FrameOfReferenceUID)));
    return "";
  }

  // Its one matrix; composed, the first one applied first (C.20.2.1.1), where there are more.
  std::optional<Eigen::Affine3d> matrix_of(const DicomItem& item, const std::string& name) {
    const std::vector<DicomItem> registrations = item.items(DCM_MatrixRegistrationSequence);
    means_one_matrix_ = means_one_matrix_ && registrations.size() == 1;
    if (registrations.size() != 1)
      error(fmt::format("{}: {} has {} items, expected 1", name, described(DCM_MatrixRegistrationSequence),
                        registrations.size()));
    if (registrations.empty()) return std::nullopt;
    check_code(registrations.front(), name);
    const std::vector<DicomItem> matrices = registrations.front().items(DCM_MatrixSequence);
    if (matrices.empty()) error(fmt::format("{}: {} has no item", name, described(DCM_MatrixSequence)));
    if (matrices.size() > 1)
      error(fmt::format("{}: {} has {} items. The first one is applied first; SlicerRT multiplies them the other way",
                        name, described(DCM_MatrixSequence), matrices.size()));
    std::optional<Eigen::Affine3d> composed;
    for (const DicomItem& matrix_item : matrices) {
      const std::optional<Eigen::Affine3d> matrix = one_matrix(matrix_item, name);
      if (!matrix) return std::nullopt;
      composed = composed ? *matrix * *composed : *matrix;
    }
    return composed;
  }

  void check_code(const DicomItem& registration, const std::string& name) {
    for (const DicomItem& code : registration.items(DCM_RegistrationTypeCodeSequence)) {
      const std::string value = code.text(DCM_CodeValue).value_or(""),
                        scheme = code.text(DCM_CodingSchemeDesignator).value_or("");
      const bool is_known = scheme == "DCM" && value.size() == 6 && value >= "125021" && value <= "125026";
      if (!is_known)
        note(fmt::format("{}: {} is ({}, {}), none of CID 7100", name, described(DCM_RegistrationTypeCodeSequence),
                         value, scheme));
    }
  }

  std::optional<Eigen::Affine3d> one_matrix(const DicomItem& item, const std::string& name) {
    const std::string tag = described(DCM_FrameOfReferenceTransformationMatrix);
    std::vector<double> values;
    try {
      values = item.required_numbers(DCM_FrameOfReferenceTransformationMatrix, 16);
    } catch (const Error& failure) {
      error(fmt::format("{}: {}", name, std::string_view(failure.what()).substr(item.where().size() + 2)));
      return std::nullopt;
    }
    for (const std::string& text : item.texts(DCM_FrameOfReferenceTransformationMatrix))
      if (text.size() > 16)
        error(fmt::format("{}: {} holds \"{}\", longer than the 16 bytes of a DS", name, tag, text));
    const Eigen::Matrix4d matrix = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data());
    if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
      error(fmt::format("{}: the last row of {} is not 0, 0, 0, 1", name, tag));
    check_rotation(matrix.topLeftCorner<3, 3>(), name);
    const std::string type = item.text(DCM_FrameOfReferenceTransformationMatrixType).value_or("");
    if (type != "RIGID")
      error(fmt::format("{}: {} is \"{}\", expected RIGID for a patient's setup", name,
                        described(DCM_FrameOfReferenceTransformationMatrixType), type));
    return Eigen::Affine3d(matrix);
  }

  void check_rotation(const Eigen::Matrix3d& r, const std::string& name) {
    const double off = (r.transpose() * r - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
    const Eigen::RowVector3d lengths = r.colwise().norm();
    if (!(off < kRigidTolerance))
      error(
          fmt::format("{}: the matrix is not rigid: its columns have the lengths {:.6g}, {:.6g}, {:.6g}, and R'R is "
                      "off the identity by {:.2g}",
                      name, lengths[0], lengths[1], lengths[2], off));
    else if (off > kItkRigid)
      note(fmt::format("{}: R'R is off the identity by {:.2g}: ITK refuses more than 1e-5", name, off));
    if (r.determinant() < 0.0) error(fmt::format("{}: the matrix mirrors (its determinant is negative)", name));
  }

  // Every instance referenced anywhere must be in the Common Instance Reference (C.12.2), under its series.
  void check_references() {
    std::set<std::string> listed;
    const auto list_series = [&](const DicomItem& parent) {
      for (const DicomItem& series : parent.items(DCM_ReferencedSeriesSequence)) {
        uid_of(series, DCM_SeriesInstanceUID, "a referenced series");
        for (const DicomItem& instance : series.items(DCM_ReferencedInstanceSequence))
          listed.insert(uid_of(instance, DCM_ReferencedSOPInstanceUID, "a referenced instance"));
      }
    };
    list_series(dataset_);
    for (const DicomItem& study : dataset_.items(DCM_StudiesContainingOtherReferencedInstancesSequence)) {
      uid_of(study, DCM_StudyInstanceUID, "a referenced study");
      list_series(study);
    }
    result_.referenced_instance_uids = listed;
    const auto check_images_of = [&](const DicomItem& parent, const std::string& name) {
      int missing = 0;
      std::string first;
      for (const DicomItem& image : parent.items(DCM_ReferencedImageSequence)) {
        uid_of(image, DCM_ReferencedSOPClassUID, name);
        const std::string uid = uid_of(image, DCM_ReferencedSOPInstanceUID, name);
        result_.referenced_instance_uids.insert(uid);
        if (uid.empty() || listed.contains(uid)) continue;
        if (missing++ == 0) first = uid;
      }
      if (missing > 0)
        error(fmt::format("{}: {} of its images are missing in {} and {} (C.12.2), the first one {}", name, missing,
                          described(DCM_ReferencedSeriesSequence),
                          described(DCM_StudiesContainingOtherReferencedInstancesSequence), first));
    };
    check_images_of(dataset_, "dataset");
    const std::vector<DicomItem> items = dataset_.items(DCM_RegistrationSequence);
    for (std::size_t n = 0; n < items.size(); ++n) check_images_of(items[n], fmt::format("item {}", n + 1));
    if (listed.empty())
      error(fmt::format("dataset: {} lists no instance: SlicerRT does not know what to move",
                        described(DCM_ReferencedSeriesSequence)));
  }

  DicomItem dataset_;
  CheckedRegistration result_;
  std::map<std::string, Eigen::Matrix4d> matrix_of_;  // by the UID of a frame or an image
  bool means_one_matrix_ = true;                      // else programs disagree about what the object means
};

}  // namespace

bool CheckedRegistration::has_errors() const { return std::ranges::any_of(findings, &RegistrationFinding::is_error); }

CheckedRegistration check_registration(const std::filesystem::path& path) {
  const DicomFile file = open_spatial_registration(path);
  CheckedRegistration checked = Checker(file.dataset()).check();
  checked.path = path;
  return checked;
}

}  // namespace isoshift
