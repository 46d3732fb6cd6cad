#include "io/objects/itk_transform.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>
#include <sstream>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "base/text_file.h"
#include "geometry/rotation.h"

namespace isoshift {
namespace {

constexpr std::string_view kFirstLine = "#Insight Transform File V1.0";

using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// What a file says of its one transform.
struct Written {
  std::string kind;  // without the type and the dimensions
  std::vector<double> parameters, fixed_parameters;
};

std::vector<double> numbers_in(std::string_view text, const std::string& where) {
  std::vector<double> numbers;
  std::istringstream words{std::string(text)};
  for (std::string word; words >> word;) {
    double number = 0.0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
    if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(number))
      throw Error(fmt::format("{}: holds \"{}\", which is not a finite number", where, word));
    numbers.push_back(number);
  }
  return numbers;
}

Written written_in(const std::filesystem::path& path) {
  const std::string name = path.string();
  std::istringstream lines(text_of_file(path));
  std::optional<Written> found;
  for (std::string line; std::getline(lines, line);) {
    const auto value_of = [&](std::string_view key) -> std::optional<std::string> {
      if (!line.starts_with(key)) return std::nullopt;
      std::string value = line.substr(key.size());
      value.erase(0, value.find_first_not_of(' '));
      value.erase(value.find_last_not_of(" \r") + 1);
      return value;
    };
    if (const auto kind = value_of("Transform:")) {
      if (found) throw Error(fmt::format("{}: holds several transforms, expected one", name));
      found = Written{.kind = kind->substr(0, kind->find('_')), .parameters = {}, .fixed_parameters = {}};
    } else if (const auto numbers = value_of("Parameters:"); numbers && found) {
      if (!found->parameters.empty()) throw Error(fmt::format("{}: has two lines of Parameters, expected one", name));
      found->parameters = numbers_in(*numbers, name + ": Parameters");
    } else if (const auto fixed = value_of("FixedParameters:"); fixed && found) {
      if (!found->fixed_parameters.empty())
        throw Error(fmt::format("{}: has two lines of FixedParameters, expected one", name));
      found->fixed_parameters = numbers_in(*fixed, name + ": FixedParameters");
    }
  }
  if (!found) throw Error(fmt::format("{}: holds no transform", name));
  return *found;
}

Eigen::Vector3d three(const std::vector<double>& numbers, std::size_t from) {
  return {numbers.at(from), numbers.at(from + 1), numbers.at(from + 2)};
}

// y = A (x - center) + center + translation, as ITK's MatrixOffsetTransformBase has it.
Eigen::Affine3d about_center(const Eigen::Matrix3d& linear, const Eigen::Vector3d& translation,
                             const std::vector<double>& center) {
  Eigen::Affine3d affine = Eigen::Affine3d::Identity();
  affine.linear() = linear;
  const Eigen::Vector3d c = center.size() < 3 ? Eigen::Vector3d::Zero() : three(center, 0);
  affine.translation() = translation + c - linear * c;
  return affine;
}

// A versor is the vector of a unit quaternion.
Eigen::Matrix3d rotation_from_versor(const Eigen::Vector3d& versor) {
  const double w = std::sqrt(std::max(0.0, 1.0 - versor.squaredNorm()));
  return Eigen::Quaterniond(w, versor.x(), versor.y(), versor.z()).toRotationMatrix();
}

// Rz Rx Ry, or Rz Ry Rx where the fourth fixed parameter says so.
Eigen::Matrix3d rotation_from_euler(const Eigen::Vector3d& angles_rad, const std::vector<double>& fixed_parameters) {
  const Eigen::Matrix3d x = rotation_x(angles_rad.x()), y = rotation_y(angles_rad.y()), z = rotation_z(angles_rad.z());
  const bool is_zyx = fixed_parameters.size() > 3 && fixed_parameters[3] != 0.0;
  return is_zyx ? Eigen::Matrix3d(z * y * x) : Eigen::Matrix3d(z * x * y);
}

}  // namespace

bool is_itk_transform(const std::filesystem::path& path) {
  expect_no_pipe(path);
  std::ifstream file(path, std::ios::binary);
  std::string first(kFirstLine.size(), '\0');
  return file.read(first.data(), static_cast<std::streamsize>(first.size())) && first == kFirstLine;
}

Eigen::Isometry3d read_itk_transform(const std::filesystem::path& path) {
  const std::string name = path.string();
  const Written written = written_in(path);
  const std::vector<double>& numbers = written.parameters;
  if (const std::size_t count = written.fixed_parameters.size(); count == 1 || count == 2)
    throw Error(fmt::format("{}: has {} FixedParameters, expected the 3 of a center", name, count));
  const auto expect = [&](std::size_t count) {
    if (numbers.size() != count)
      throw Error(fmt::format("{}: {} has {} parameters, expected {}", name, written.kind, numbers.size(), count));
  };
  Eigen::Affine3d affine;
  if (written.kind == "AffineTransform" || written.kind == "MatrixOffsetTransformBase" ||
      written.kind == "Rigid3DTransform") {
    expect(12);
    affine = about_center(Eigen::Map<const RowMajor>(numbers.data()), three(numbers, 9), written.fixed_parameters);
  } else if (written.kind == "Euler3DTransform") {
    expect(6);
    affine = about_center(rotation_from_euler(three(numbers, 0), written.fixed_parameters), three(numbers, 3),
                          written.fixed_parameters);
  } else if (written.kind == "VersorRigid3DTransform") {
    expect(6);
    affine = about_center(rotation_from_versor(three(numbers, 0)), three(numbers, 3), written.fixed_parameters);
  } else if (written.kind == "TranslationTransform") {
    expect(3);
    affine = about_center(Eigen::Matrix3d::Identity(), three(numbers, 0), {});
  } else {
    throw Error(
        fmt::format("{}: is a {}, expected a rigid transform (AffineTransform, Euler3DTransform, "
                    "VersorRigid3DTransform, TranslationTransform)",
                    name, written.kind));
  }
  const auto rigid = as_rigid(affine);
  if (!rigid)
    throw Error(fmt::format("{}: is not rigid: its matrix is not a rotation within {:g}", name, kRigidTolerance));
  return *rigid;
}

std::string itk_transform(const Eigen::Isometry3d& moving_from_fixed) {
  const RowMajor rows = moving_from_fixed.linear();
  return fmt::format(
      "{}\n#Transform 0\nTransform: AffineTransform_double_3_3\nParameters: {} {}\nFixedParameters: 0 0 0\n",
      kFirstLine, fmt::join(rows.data(), rows.data() + rows.size(), " "),
      fmt::join(moving_from_fixed.translation(), " "));
}

}  // namespace isoshift
