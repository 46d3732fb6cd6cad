#pragma once
// Rigid transforms in ITK's text format (.tfm), as ITK, 3D Slicer and plastimatch read and write them: millimeters in
// the axes of DICOM (LPS), from a point of the fixed image to the point of the moving image that is shown there.

#include <Eigen/Geometry>
#include <filesystem>
#include <string>

namespace isoshift {

bool is_itk_transform(const std::filesystem::path& path);  // as its first line says

// Takes points of the fixed image's frame to that of the moving one. Throws Error naming the file if it holds no
// transform or several, one that is not rigid within 1e-4, or one of a kind other than AffineTransform,
// MatrixOffsetTransformBase, Rigid3DTransform, Euler3DTransform, VersorRigid3DTransform and TranslationTransform.
Eigen::Isometry3d read_itk_transform(const std::filesystem::path& path);

// The text of a file that holds this transform, with all digits.
std::string itk_transform(const Eigen::Isometry3d& moving_from_fixed);

}  // namespace isoshift
