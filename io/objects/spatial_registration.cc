#include "io/objects/spatial_registration.h"

#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>

#include "base/error.h"
#include "geometry/rotation.h"
#include "io/objects/object_header.h"

namespace isoshift {
namespace {

// The frame of reference of item 2, and its origin in treatment coordinates (docs/dicom.md, table of 4.4).
struct SourceFrame {
  std::string uid;
  Eigen::Vector3d isocenter_mm = Eigen::Vector3d::Zero();  // the machine's isocenter in that frame
  bool lists_images = false;                               // the RT Images are in it
};

SourceFrame source_frame(const Study& study, RegistrationSource axes, Notes& notes) {
  if (axes == RegistrationSource::kIecFixed) return {.uid = kIecFixedFrameUid};
  const RtImage& first = study.rt_images.front();
  for (const RtImage& image : study.rt_images) {
    if (!image.frame_of_reference_uid || !image.isocenter_mm ||
        image.frame_of_reference_uid != first.frame_of_reference_uid || *image.isocenter_mm != *first.isocenter_mm ||
        image.frame_of_reference_uid == study.ct->frame_of_reference_uid) {
      if (image.frame_of_reference_uid == study.ct->frame_of_reference_uid)
        notes.warnings.push_back(fmt::format(
            "{}: shares the CT's {}, which would claim a perfect setup; the registration object uses a new one",
            image.label, described(DCM_FrameOfReferenceUID)));
      return {.uid = new_uid()};
    }
  }
  return {.uid = *first.frame_of_reference_uid, .isocenter_mm = *first.isocenter_mm, .lists_images = true};
}

void put_matrix(DicomItem item, const Eigen::Isometry3d& matrix, const char* code, const char* meaning,
                const char* comment) {
  DicomItem registration = item.append_item(DCM_MatrixRegistrationSequence);
  registration.put(DCM_FrameOfReferenceTransformationComment, comment);
  put_code(registration.append_item(DCM_RegistrationTypeCodeSequence), code, meaning);
  DicomItem matrix_item = registration.append_item(DCM_MatrixSequence);
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = matrix.matrix();
  matrix_item.put(DCM_FrameOfReferenceTransformationMatrix, std::span(rows.data(), 16));
  matrix_item.put(DCM_FrameOfReferenceTransformationMatrixType, "RIGID");
}

// The files that the views come from: those of several frames once.
std::vector<const RtImage*> image_files(const Study& study) {
  std::vector<const RtImage*> files;
  for (const RtImage& image : study.rt_images)
    if (std::ranges::none_of(files,
                             [&](const RtImage* file) { return file->sop_instance_uid == image.sop_instance_uid; }))
      files.push_back(&image);
  return files;
}

void put_ct_references(DicomItem item, const CtSeries& ct) {
  for (const std::string& uid : ct.sop_instance_uids)
    item.append_reference(DCM_ReferencedImageSequence, ct.sop_class_uid, uid);
}

// Common Instance Reference (C.12.2): every referenced instance, those of the CT's study and those of others.
void put_common_instance_references(DicomItem dataset, const Study& study) {
  DicomItem ct_series = dataset.append_item(DCM_ReferencedSeriesSequence);
  ct_series.put(DCM_SeriesInstanceUID, study.ct->series_instance_uid);
  for (const std::string& uid : study.ct->sop_instance_uids)
    ct_series.append_reference(DCM_ReferencedInstanceSequence, study.ct->sop_class_uid, uid);

  std::map<std::string, std::map<std::string, std::vector<const RtImage*>>> by_study_and_series;
  for (const RtImage* image : image_files(study))
    by_study_and_series[image->identity.study_instance_uid][image->series_instance_uid].push_back(image);
  for (const auto& [study_uid, by_series] : by_study_and_series) {
    std::optional<DicomItem> other_study;
    if (study_uid != study.ct->identity.study_instance_uid) {
      other_study = dataset.append_item(DCM_StudiesContainingOtherReferencedInstancesSequence);
      other_study->put(DCM_StudyInstanceUID, study_uid);
    }
    for (const auto& [series_uid, images] : by_series) {
      DicomItem series = (other_study ? *other_study : dataset).append_item(DCM_ReferencedSeriesSequence);
      series.put(DCM_SeriesInstanceUID, series_uid);
      for (const RtImage* image : images)
        series.append_reference(DCM_ReferencedInstanceSequence, image->sop_class_uid, image->sop_instance_uid);
    }
  }
}

void put_general(DicomItem dataset, const Study& study, const std::string& sop_instance_uid,
                 const SpatialRegistrationOptions& options) {
  put_header(dataset, {.identity = study.ct->identity,
                       .sop_class_uid = UID_SpatialRegistrationStorage,
                       .sop_instance_uid = sop_instance_uid,
                       .modality = "REG",
                       .series_instance_uid = new_uid(),
                       .series_number = 9001,
                       .series_description = "2D/3D setup registration"});
  if (!study.ct->body_part_examined.empty())
    dataset.put(DCM_BodyPartExamined, study.ct->body_part_examined);
  else
    dataset.put(DCM_Laterality, "");  // type 2C: required, possibly empty, where the body part is unknown
  dataset.put(DCM_FrameOfReferenceUID, study.ct->frame_of_reference_uid);
  dataset.put(DCM_PositionReferenceIndicator, "");
  dataset.put(DCM_ContentLabel, options.content_label);
  dataset.put(DCM_ContentDescription, options.content_description);
  dataset.put(DCM_ContentCreatorName, "");
}

DicomFile registration_object(const Study& study, const SourceFrame& source, const Eigen::Isometry3d& ct_from_source,
                              const std::string& sop_instance_uid, const SpatialRegistrationOptions& options) {
  DicomFile file;
  DicomItem dataset = file.dataset();
  put_general(dataset, study, sop_instance_uid, options);

  DicomItem ct_item = dataset.append_item(DCM_RegistrationSequence);
  ct_item.put(DCM_FrameOfReferenceUID, study.ct->frame_of_reference_uid);
  put_ct_references(ct_item, *study.ct);
  put_matrix(ct_item, Eigen::Isometry3d::Identity(), "125021", "Frame of Reference Identity", "planning CT");

  DicomItem treatment_item = dataset.append_item(DCM_RegistrationSequence);
  treatment_item.put(DCM_FrameOfReferenceUID, source.uid);
  if (source.lists_images)
    for (const RtImage* image : image_files(study))
      treatment_item.append_reference(DCM_ReferencedImageSequence, image->sop_class_uid, image->sop_instance_uid);
  put_matrix(treatment_item, ct_from_source, "125024", "Image Content-based Alignment",
             "treatment room to planning CT");

  // General Reference (C.12.4), where the images cannot stand in item 2.
  if (!source.lists_images)
    for (const RtImage* image : image_files(study)) {
      DicomItem reference =
          dataset.append_reference(DCM_ReferencedImageSequence, image->sop_class_uid, image->sop_instance_uid);
      put_code(reference.append_item(DCM_PurposeOfReferenceCodeSequence), "129203", "Image Acquired during Treatment");
    }
  put_common_instance_references(dataset, study);
  return file;
}

// The standard's composition: the first matrix is applied first (C.20.2.1.1).
Eigen::Isometry3d composed_matrix(const DicomItem& item) {
  Eigen::Isometry3d composed = Eigen::Isometry3d::Identity();
  for (const DicomItem& registration : item.items(DCM_MatrixRegistrationSequence))
    for (const DicomItem& matrix_item : registration.items(DCM_MatrixSequence)) {
      const std::vector<double> values = matrix_item.required_numbers(DCM_FrameOfReferenceTransformationMatrix, 16);
      const std::string type = matrix_item.required_text(DCM_FrameOfReferenceTransformationMatrixType);
      const Eigen::Matrix4d written = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data());
      const std::optional<Eigen::Isometry3d> matrix = as_rigid(Eigen::Affine3d(written));
      if (type != "RIGID" || !matrix)
        throw Error(fmt::format("{}: {} is not a rigid motion", matrix_item.where(),
                                described(DCM_FrameOfReferenceTransformationMatrix)));
      composed = *matrix * composed;
    }
  return composed;
}

void check_read_back(const std::filesystem::path& path, const Eigen::Isometry3d& ct_from_source) {
  const SpatialRegistration read = read_spatial_registration(path);
  const auto largest_difference = [&](std::size_t item, const Eigen::Isometry3d& written) {
    return (read.items[item].registered_from_source.matrix() - written.matrix()).cwiseAbs().maxCoeff();
  };
  if (read.items.size() != 2 || largest_difference(0, Eigen::Isometry3d::Identity()) != 0.0 ||
      largest_difference(1, ct_from_source) > 1e-6)
    throw Error(fmt::format("{}: reads back differently from what was written", path.string()));
}

// The treatment frame: at the machine's isocenter, along the axes of the patient as planned.
Eigen::Isometry3d room_from_treatment(const Eigen::Isometry3d& planned_room_from_patient) {
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  result.linear() = planned_room_from_patient.linear();
  return result;
}

}  // namespace

Eigen::Isometry3d ct_from_treatment(const Eigen::Isometry3d& planned_room_from_patient,
                                    const Eigen::Isometry3d& actual_room_from_patient) {
  return actual_room_from_patient.inverse() * room_from_treatment(planned_room_from_patient);
}

Eigen::Isometry3d actual_room_from_patient(const Eigen::Isometry3d& planned_room_from_patient,
                                           const Eigen::Isometry3d& ct_from_treatment) {
  return room_from_treatment(planned_room_from_patient) * ct_from_treatment.inverse();
}

std::string write_spatial_registration(const Study& study, const Eigen::Isometry3d& actual_room_from_patient,
                                       const SpatialRegistrationOptions& options, const std::filesystem::path& path,
                                       Notes& notes) {
  const SourceFrame source = source_frame(study, options.source, notes);
  Eigen::Isometry3d ct_from_source = options.source == RegistrationSource::kIecFixed
                                         ? actual_room_from_patient.inverse()
                                         : ct_from_treatment(study.planned_room_from_patient, actual_room_from_patient);
  ct_from_source.translate(-source.isocenter_mm);
  std::string sop_instance_uid = new_uid();
  DicomFile file = registration_object(study, source, ct_from_source, sop_instance_uid, options);
  file.write(path);
  check_read_back(path, ct_from_source);
  return sop_instance_uid;
}

DicomFile open_spatial_registration(const std::filesystem::path& path) {
  DicomFile file = DicomFile::read(path, DicomFile::Extent::kWhole);
  const std::string sop_class = file.dataset().required_uid(DCM_SOPClassUID);
  if (sop_class == UID_DeformableSpatialRegistrationStorage)
    throw Error(
        fmt::format("{}: is a Deformable Spatial Registration, which maps the other way (PS3.3 C.20.3). Expected "
                    "a Spatial Registration",
                    path.string()));
  if (sop_class != UID_SpatialRegistrationStorage)
    throw Error(fmt::format("{}: {} is {}, expected Spatial Registration Storage", path.string(),
                            described(DCM_SOPClassUID), sop_class));
  return file;
}

SpatialRegistration read_spatial_registration(const std::filesystem::path& path) {
  const DicomFile file = open_spatial_registration(path);
  const DicomItem dataset = file.dataset();
  SpatialRegistration registration;
  registration.sop_instance_uid = dataset.required_uid(DCM_SOPInstanceUID);
  registration.frame_of_reference_uid = dataset.required_uid(DCM_FrameOfReferenceUID);
  for (const DicomItem& item : dataset.items(DCM_RegistrationSequence))
    registration.items.push_back({.frame_of_reference_uid = item.required_uid(DCM_FrameOfReferenceUID),
                                  .registered_from_source = composed_matrix(item)});
  return registration;
}

}  // namespace isoshift
