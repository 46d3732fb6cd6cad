#pragma once
// How the patient in the room differs in shape from the patient in the CT. A deformation is given as the way back: of
// which point of the CT a place in the deformed patient shows the tissue.

#include <Eigen/Geometry>
#include <array>
#include <vector>

namespace isoshift::campaign {

// A part of the body beyond a plane z = start bends; its angle grows along the body, and stays beyond the growth.
struct Bending {
  Eigen::Vector3d start_mm = Eigen::Vector3d::Zero();  // on the line of joints
  double direction = 1.0;                              // +1 toward the head, -1 toward the feet
  double growth_mm = 100.0;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();
  double angle_rad = 0.0;
};

// Organs, diaphragm and front ribs move; what lies behind `still_behind_mm` (patient y) does not.
struct Breath {
  Eigen::Vector3d amplitude_mm = Eigen::Vector3d::Zero();
  double still_behind_mm = 0.0;
  double full_before_mm = 0.0;
};

class Deformation {
 public:
  Deformation(const std::vector<Bending>& bendings, const Breath& breath);

  bool is_identity() const { return bendings_.empty() && breath_.amplitude_mm.isZero(); }
  // The CT's point that is seen at a place of the deformed patient, and the way there (by iteration, to 1e-6 mm).
  Eigen::Vector3d planned_of(const Eigen::Vector3d& deformed_mm) const;
  Eigen::Vector3d deformed_of(const Eigen::Vector3d& planned_mm) const;
  // The rigid motion nearest to what happens within 5 mm of a point of the CT.
  Eigen::Isometry3d motion_near(const Eigen::Vector3d& planned_mm) const;

 private:
  struct Table {
    Bending bending;
    std::vector<Eigen::Isometry3d> planned_from_deformed;  // for every mm from the start
  };
  static Eigen::Vector3d unbent(const Table& table, const Eigen::Vector3d& deformed_mm);

  std::vector<Table> bendings_;
  Breath breath_;
};

// The ways back on a lattice of 4 mm, for many places at once.
class DisplacementField {
 public:
  DisplacementField(const Deformation& deformation, const Eigen::Vector3d& low_mm, const Eigen::Vector3d& high_mm);

  // Nothing beyond the lattice.
  Eigen::Vector3f at(const Eigen::Vector3f& deformed_mm) const;

 private:
  static constexpr float kSpacingMm = 4.0F;
  Eigen::Vector3f low_mm_;
  Eigen::Vector3i size_;
  std::vector<Eigen::Vector3f> displacements_mm_;
};

}  // namespace isoshift::campaign
