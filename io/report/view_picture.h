#pragma once
// Makes the pictures of a view: line integrals as grays and colors, and letters for directions of the patient.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>

#include "setup/view_picture.h"

namespace isoshift {

// A gray for every line integral, made once for many pictures.
class GrayScale {
 public:
  // Black at the 1st and white at the 99.5th percentile of what lies in the field (1 inside; all if it is empty).
  static GrayScale of(const Image<float>& line_integral, const Image<std::uint8_t>& field);
  // DRRs in the grays of their X-ray, of the same size: the share of the field that is darker than a gray is the same
  // in both. So X-rays that are hardened and scattered look as DRRs do, wherever the patient lies.
  static GrayScale like(const Image<float>& drr, const Image<std::uint8_t>& xray, const Image<std::uint8_t>& field);

  Image<std::uint8_t> operator()(const Image<float>& line_integral) const;

 private:
  static constexpr std::size_t kSteps = 1024;
  double low_ = 0.0, high_ = 1.0;
  std::array<std::uint8_t, kSteps> grays_{};  // from low to high
};

// The line integrals of X-ray, DRR as planned and DRR as found, all of one size, as gray values. The DRRs are brought
// to the X-ray's scale by one straight line, fitted in the field (1 inside) at the pose found.
void put_grays(ViewPicture& picture, const Image<float>& xray, const Image<float>& drr_planned,
               const Image<float>& drr_found, const Image<std::uint8_t>& field);

// Line integrals as a radiograph: dense is bright.
Image<std::uint8_t> radiograph(const Image<float>& line_integral);

// The same as colors.
Image<std::array<std::uint8_t, 3>> in_gray(const Image<std::uint8_t>& picture);

// X-ray in magenta and DRR in green, so that matching anatomy is gray, for color-blind eyes, too.
Image<std::array<std::uint8_t, 3>> overlay(const Image<std::uint8_t>& xray, const Image<std::uint8_t>& drr);

// Letters of PS3.3 C.7.6.1.1.1 (Patient Orientation, for people: H and F, R and L, A and P) for a direction in patient
// coordinates (LPS), the strongest first, without weak ones.
std::string orientation_letters(const Eigen::Vector3d& direction_patient);

}  // namespace isoshift
