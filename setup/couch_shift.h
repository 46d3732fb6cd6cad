#pragma once
// From the setup error to the couch motion that undoes it. One sign rule: docs/conventions.md.

#include <Eigen/Geometry>

#include "geometry/patient_setup.h"
#include "geometry/rotation.h"

namespace isoshift {

// Where the patient is: anatomy planned at x (mm from the isocenter, IEC 61217 fixed) is found at setup_error * x.
Eigen::Isometry3d setup_error_from_poses(const Eigen::Isometry3d& planned_room_from_patient,
                                         const Eigen::Isometry3d& actual_room_from_patient);

// The motion of the couch that undoes it: a translation, then a rotation about the isocenter. IEC 61217 table-top axes
// at imaging: lateral + to the viewer's right facing the gantry, longitudinal + toward the gantry, vertical + up.
struct CouchShift {
  Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();  // lateral, longitudinal, vertical
  ZxyAngles change;  // yaw (z), pitch (x), roll (y): target angles minus the read-outs at imaging
  ZxyAngles target;  // the resulting IEC table angles, each within (-pi, pi]
};

// The shift that undoes `setup_error` for a table standing at `table` at imaging. The target angles come from
// R_new = R^T Rz Rx Ry: negated angles would leave an error of second order, since rotations do not commute.
// `about_mm` (from the isocenter, IEC 61217 fixed): the point about which the rotation turns. The angles do not depend
// on it; the translation is the one that brings anatomy planned there to where it was planned.
CouchShift couch_shift_for(const Eigen::Isometry3d& setup_error, const TableAngles& table,
                           const Eigen::Vector3d& about_mm = Eigen::Vector3d::Zero());

// The translation of a couch that makes the same rotation first, about the isocenter, and translates then: along the
// same axes.
Eigen::Vector3d translation_after_rotation_mm(const Eigen::Isometry3d& setup_error, const TableAngles& table);

// Which of its six motions a couch can make: all; translations and yaw; translations.
enum class CouchDof { kThree = 3, kFour = 4, kSix = 6 };

// The shift that such a couch can apply to undo `setup_error`. The angles it cannot change stay as at imaging; its
// translation then brings anatomy planned at `point_mm` (from the isocenter, IEC 61217 fixed) to where it was planned.
CouchShift applicable_shift(const Eigen::Isometry3d& setup_error, const TableAngles& table, CouchDof dof,
                            const Eigen::Vector3d& point_mm);

// Where anatomy planned at `point_mm` (from the isocenter, IEC 61217 fixed) lies after the couch has applied `shift`,
// minus where it was planned (docs/dicom.md 5.1).
Eigen::Vector3d left_over_mm(const Eigen::Isometry3d& setup_error, const TableAngles& table, const CouchShift& shift,
                             const Eigen::Vector3d& point_mm);

}  // namespace isoshift
