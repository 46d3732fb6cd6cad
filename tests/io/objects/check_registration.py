"""Recovers the setup error from a Spatial Registration with pydicom, a reader that nobody of this project wrote.

Usage: check_registration.py REG.dcm TRUTH.json [MAX_MM]
Checks for patients in HFS at couch 0, where IEC 61217 fixed (x, y, z) is DICOM patient (x, z, -y).
"""
import json
import sys

import numpy as np
import pydicom

registration = pydicom.dcmread(sys.argv[1])
with open(sys.argv[2]) as file:
    truth = json.load(file)
max_mm = float(sys.argv[3]) if len(sys.argv) > 3 else 1e-6

isocenter = np.array(truth["isocenter_patient_mm"])
error = truth["setup_error_room"]
fixed_from_patient = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)

first, second = registration.RegistrationSequence
matrices = [
    np.array(item.MatrixRegistrationSequence[0].MatrixSequence[0].FrameOfReferenceTransformationMatrix, float).reshape(4, 4)
    for item in (first, second)
]
assert np.array_equal(matrices[0], np.eye(4)), "item 1 is not an exact identity"
assert first.FrameOfReferenceUID == registration.FrameOfReferenceUID, "item 1 is not the registered frame"
m = matrices[1]


def off(matrix):
    """Largest difference from the truth of the translation and rotation that this matrix means, in mm at 100 mm."""
    translation_fixed = fixed_from_patient @ (np.linalg.inv(matrix) @ np.append(isocenter, 1.0))[:3]
    rotation_fixed = fixed_from_patient @ matrix[:3, :3].T @ fixed_from_patient.T
    return max(
        np.abs(translation_fixed - error["translation_mm"]).max(),
        100.0 * np.abs(rotation_fixed - np.array(error["rotation_matrix"])).max(),
    )


print(f"off by {off(m):.2e} mm; the inverted matrix by {off(np.linalg.inv(m)):.2e} mm")
assert off(m) <= max_mm, "the matrix does not mean the true setup error"
assert off(np.linalg.inv(m)) > 1.0, "the inverted matrix passes too: this check proves nothing"
