"""The tables of docs/stereoscopic.md, by arithmetic alone: a floor/ceiling system of two imagers, and its matrices."""

from markdown import table, words

PIXELS, PIXEL_MM = 512, 0.4  # along each edge of a panel


class Imager:
    """What a survey of the room says (IEC 61217 fixed, mm): where source and panel are, how the panel is turned."""

    def __init__(self, name, source_mm, center_mm, along_row, along_column):
        self.name, self.source_mm, self.center_mm = name, source_mm, center_mm
        self.along_row, self.along_column = along_row, along_column
        (a, b, c), (d, e, f) = along_row, along_column
        self.normal = (b * f - c * e, c * d - a * f, a * e - b * d)
        middle = [dot(axis, minus(center_mm, source_mm)) for axis in (along_row, along_column, self.normal)]
        self.sid_mm = middle[2]
        self.foot_px = [(PIXELS - 1) / 2 - mm / PIXEL_MM for mm in middle[:2]]  # of the normal through the source
        self.focal_px = self.sid_mm / PIXEL_MM

    def matrix(self):
        """K [R | -R S], four numbers a row."""
        inner = [[self.focal_px, 0, self.foot_px[0]], [0, self.focal_px, self.foot_px[1]], [0, 0, 1]]
        axes = [self.along_row, self.along_column, self.normal]
        return product(inner, [[*axis, -dot(axis, self.source_mm)] for axis in axes])


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def product(a, b):
    return [[dot(row, column) for column in zip(*b)] for row in a]


def minus(a, b):
    return [x - y for x, y in zip(a, b)]


def pixel_of(matrix, point_mm):
    h = [dot(row, [*point_mm, 1]) for row in matrix]
    return h[0] / h[2], h[1] / h[2]


IMAGERS = [Imager("1", (1213.35, 1213.35, -1439.84), (-747.51, -747.51, 887.05),
                  (-0.70711, 0.70711, 0.0), (-0.45452, -0.45452, -0.76604)),
           Imager("2", (-1213.35, 1213.35, -1439.84), (743.77, -749.43, 888.58),
                  (-0.70711, -0.70711, 0.0), (0.45452, -0.45452, -0.76604))]
POINTS_MM = {"the isocenter": (0, 0, 0), "50 mm to the right": (50, 0, 0), "50 mm toward the gantry": (0, 50, 0),
             "50 mm up": (0, 0, 50), "a point elsewhere": (-30, 40, 20)}

# The vendor of the last example: x to the right, y up, z away from the gantry; columns and rows count from the corner
# of the lowest pixel at the left, upward; the last number is 1.
ROOM_FROM_VENDOR = [[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]]
VENDOR_FROM_PIXEL = [[1, 0, 0.5], [0, -1, PIXELS - 0.5], [0, 0, 1]]


def vector(values, digits):
    return "({})".format(", ".join(f"{value:.{digits}f}" for value in values))


def surveyed():
    return table(["imager", "source, mm", "center of the panel, mm", "u, along a row", "v, along a column"],
                 [[imager.name, vector(imager.source_mm, 2), vector(imager.center_mm, 2), vector(imager.along_row, 5),
                   vector(imager.along_column, 5)] for imager in IMAGERS])


def inner_numbers():
    return table(["imager", "n, normal of the panel", "C - S, mm", "SID, mm", "f, pixels", "c0, column", "r0, row"],
                 [[imager.name, vector(imager.normal, 5), vector(minus(imager.center_mm, imager.source_mm), 2),
                   f"{imager.sid_mm:.2f}", f"{imager.focal_px:.2f}",
                   *(f"{px:.2f}" for px in imager.foot_px)] for imager in IMAGERS])


def matrix_cells(imager):
    """As in the profile: so many digits that no pixel moves by 0.001."""
    return [[f"{value:.{digits}f}" for value, digits in zip(row, (6, 6, 6, 3) if is_last else (4, 4, 4, 1))]
            for row, is_last in zip(imager.matrix(), (False, False, True))]


def matrices():
    return table(["imager", "row of the matrix", "x", "y", "z", "1"],
                 [[imager.name, name, *cells] for imager in IMAGERS
                  for name, cells in zip(("first", "second", "third"), matrix_cells(imager))])


def projected():
    return table(["point of the room", "x, y, z, mm", "imager 1: column", "row", "imager 2: column", "row"],
                 [[name, "({}, {}, {})".format(*(f"{value:g}" for value in point_mm)),
                   *(f"{px:.2f}" for imager in IMAGERS for px in pixel_of(imager.matrix(), point_mm))]
                  for name, point_mm in POINTS_MM.items()])


def of_the_vendor():
    matrix = product(product(VENDOR_FROM_PIXEL, IMAGERS[0].matrix()), ROOM_FROM_VENDOR)
    return table(["vendor's matrix", "x", "y", "z", "1"],
                 [[name, *(f"{value / matrix[2][3]:.9f}" for value in row)]
                  for name, row in zip(("first row", "second row", "third row"), matrix)])


TABLES = [("The example", surveyed), ("From the positions to the matrix", inner_numbers),
          ("From the positions to the matrix", matrices), ("The matrix by hand", projected),
          ("The profile", words("| what differs between the files | keyword |")),
          ("A vendor's matrix with other axes or pixels", words("| the vendor | what to do |")),
          ("A vendor's matrix with other axes or pixels", of_the_vendor),
          ("What a wrong matrix looks like", words("| mistake | what isoshift says |"))]
