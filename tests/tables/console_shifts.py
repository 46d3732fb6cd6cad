"""The tables of docs/console-shifts.md, by arithmetic alone: a couch shift about several points, and its matrix."""

import math

from markdown import table, words

SHIFT_MM = (2.0, 4.0, -1.0)                # lateral, longitudinal, vertical, about the isocenter
YAW_DEG, PITCH_DEG, ROLL_DEG = 1.2, -0.5, 0.4  # about z, x, y
ISOCENTER_MM = (-12.5, 38.0, -410.0)       # of the plan, patient coordinates
ROOM_FROM_PATIENT = ((1, 0, 0), (0, 0, 1), (0, -1, 0))  # HFS, couch at 0: x = left, y = superior, z = anterior
POINTS_MM = {"the isocenter": ISOCENTER_MM,
             "a point 50 mm superior to it": (-12.5, 38.0, -360.0),
             "the middle of the CT": (0.0, 0.0, -400.0),
             "the center of the CT's first voxel": (-250.0, -250.0, -520.0),
             "the origin of the CT's frame": (0.0, 0.0, 0.0)}


def times(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def applied(a, v):
    return [sum(a[i][k] * v[k] for k in range(3)) for i in range(3)]


def transposed(a):
    return [list(row) for row in zip(*a)]


def turned(axis, deg):
    """The matrix of a turn about an axis of the room."""
    c, s = math.cos(math.radians(deg)), math.sin(math.radians(deg))
    i, j = ((1, 2), (2, 0), (0, 1))[axis]
    matrix = [[float(row == column) for column in range(3)] for row in range(3)]
    matrix[i][i], matrix[i][j], matrix[j][i], matrix[j][j] = c, -s, s, c
    return matrix


COUCH = times(times(turned(2, YAW_DEG), turned(0, PITCH_DEG)), turned(1, ROLL_DEG))
SETUP_ERROR, ERROR_MM = transposed(COUCH), [-shift for shift in SHIFT_MM]  # planned p is found at R p + t


def in_room(point_mm):
    return applied(ROOM_FROM_PATIENT, [point - isocenter for point, isocenter in zip(point_mm, ISOCENTER_MM)])


def shift_about(point_mm):
    """Takes anatomy planned at the point back to where it was planned."""
    planned = in_room(point_mm)
    return [p - (turn + error) for p, turn, error in zip(planned, applied(SETUP_ERROR, planned), ERROR_MM)]


def points():
    def cells(name, point_mm):
        shift_mm = shift_about(point_mm)
        return [name, "({})".format(", ".join(f"{value:g}" for value in point_mm)), *(f"{value:+.1f}" for value in shift_mm),
                f"{math.hypot(*shift_mm):.1f}"]

    return table(["the rotation turns about", "patient coordinates, mm", "lateral, mm", "longitudinal, mm", "vertical, mm",
                  "length, mm"], [cells(*item) for item in POINTS_MM.items()])


def matrix():
    """Of the registration object: from the patient's axes at the machine's isocenter to the CT."""
    patient_from_room = transposed(ROOM_FROM_PATIENT)
    linear = times(times(patient_from_room, COUCH), ROOM_FROM_PATIENT)
    isocenter_now = [isocenter + moved for isocenter, moved in
                     zip(ISOCENTER_MM, applied(patient_from_room, applied(COUCH, SHIFT_MM)))]
    return table(["", "x", "y", "z", ""], [["", *(f"{value:+.6f}" for value in row), f"{moved:.3f}"]
                                           for row, moved in zip(linear, isocenter_now)])


TABLES = [("The example", points), ("From the matrix to the couch", matrix),
          ("The same matrix for ITK, 3D Slicer and plastimatch", words("| program | what M.tfm is there |")),
          ("What else differs between consoles", words("| the console | what to do |"))]
