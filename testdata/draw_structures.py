"""Draws the structure set that isoshift phantom gives only to a thorax: draw_structures.py STUDY NAME

STUDY/RTSTRUCT.dcm has two structures on the slices of the study's CT: "Target", a ball of 13 mm radius about the isocenter, and
NAME, an elliptic cylinder through the whole CT. The template is the structure set of the thorax beside the study.
"""
import copy
import hashlib
import math
import pathlib
import sys

import pydicom

# Centers (mm from the isocenter, in patient x and y) and half axes in mm.
CYLINDERS = {"Head": ((0.0, 4.0), (78.0, 98.0)), "Spine": ((0.0, 5.0), (40.0, 45.0))}
BALL_MM = 13.0
POINTS = 36


def uid_from(text):
    """The same UID for the same text, under the root for UIDs made of 128 bits (PS3.5 B.2)."""
    return f"2.25.{int.from_bytes(hashlib.sha256(text.encode()).digest()[:16], 'big')}"


def ellipse(template, center, half_axes, z):
    contour = copy.deepcopy(template)
    contour.NumberOfContourPoints = POINTS
    angles = [2.0 * math.pi * n / POINTS for n in range(POINTS)]
    contour.ContourData = [
        f"{value:.3f}"
        for angle in angles
        for value in (center[0] + half_axes[0] * math.cos(angle), center[1] + half_axes[1] * math.sin(angle), z)
    ]
    return contour


study, name = pathlib.Path(sys.argv[1]), sys.argv[2]
plan = pydicom.dcmread(study / "RTPLAN.dcm")
slices = [pydicom.dcmread(path, stop_before_pixels=True) for path in sorted((study / "CT").iterdir())]
isocenter = [float(value) for value in plan.BeamSequence[0].ControlPointSequence[0].IsocenterPosition]
structures = pydicom.dcmread(study.parent / "thorax" / "RTSTRUCT.dcm")

for keyword in ("PatientName", "PatientID", "StudyInstanceUID", "FrameOfReferenceUID"):
    setattr(structures, keyword, plan[keyword].value)
structures.SOPInstanceUID = uid_from(f"{plan.SOPInstanceUID} structures")
structures.file_meta.MediaStorageSOPInstanceUID = structures.SOPInstanceUID
structures.SeriesInstanceUID = uid_from(f"{plan.SOPInstanceUID} series of structures")
structures.StructureSetLabel = name.upper()

frame = structures.ReferencedFrameOfReferenceSequence[0]
frame.FrameOfReferenceUID = plan.FrameOfReferenceUID
of_study = frame.RTReferencedStudySequence[0]
of_study.ReferencedSOPInstanceUID = plan.StudyInstanceUID
series = of_study.RTReferencedSeriesSequence[0]
series.SeriesInstanceUID = slices[0].SeriesInstanceUID
image_template = series.ContourImageSequence[0]
series.ContourImageSequence = []
for ct in slices:
    image = copy.deepcopy(image_template)
    image.ReferencedSOPInstanceUID = ct.SOPInstanceUID
    series.ContourImageSequence.append(image)

contour_template = structures.ROIContourSequence[0].ContourSequence[0]
heights = [float(ct.ImagePositionPatient[2]) for ct in slices]
drawn = {"Target": ("GTV", []), name: ("ORGAN", [])}
(x, y), half_axes = CYLINDERS[name]
for z in heights:
    above = z - isocenter[2]
    if abs(above) < BALL_MM:
        radius = math.sqrt(BALL_MM**2 - above**2)
        drawn["Target"][1].append(ellipse(contour_template, isocenter[:2], (radius, radius), z))
    drawn[name][1].append(ellipse(contour_template, (isocenter[0] + x, isocenter[1] + y), half_axes, z))

for sequence in ("StructureSetROISequence", "ROIContourSequence", "RTROIObservationsSequence"):
    structures[sequence].value.append(copy.deepcopy(structures[sequence].value[0]))
for number, (roi_name, (interpreted, contours)) in enumerate(drawn.items(), 1):
    roi = structures.StructureSetROISequence[number - 1]
    roi.ROINumber, roi.ROIName, roi.ReferencedFrameOfReferenceUID = number, roi_name, plan.FrameOfReferenceUID
    contour = structures.ROIContourSequence[number - 1]
    contour.ReferencedROINumber, contour.ContourSequence = number, contours
    observation = structures.RTROIObservationsSequence[number - 1]
    observation.ObservationNumber = observation.ReferencedROINumber = number
    observation.RTROIInterpretedType = interpreted
structures.save_as(study / "RTSTRUCT.dcm")
