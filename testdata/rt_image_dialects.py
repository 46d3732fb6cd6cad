"""Writes RT Images as the products of different vendors write them (docs/dicom.md, 2.8): rt_image_dialects.py XRAYS FOLDER

XRAYS holds the phantom's KV_G000.dcm and KV_G090.dcm. Every dialect shows the same patient in the same place: what a dialect
writes in other words (its own frame of reference, inverted pixels) changes with the words, and what it lacks is left out.
"""
import pathlib
import sys

import numpy as np
import pydicom

TIMES = ("AcquisitionDate", "AcquisitionTime")
POSITION, GANTRY, COUCH = "RTImagePosition", "GantryAngle", "PatientSupportAngle"


def without(image, *keywords):
    for keyword in keywords:
        if keyword in image:
            delattr(image, keyword)


def made_by(image, manufacturer, model):
    image.Manufacturer, image.ManufacturerModelName = manufacturer, model


def own_frame(image, uid, isocenter):
    image.FrameOfReferenceUID = uid
    image.IsocenterPosition = isocenter


def put_pixels(image, values):
    image.PixelData = np.asarray(values).round().clip(0, 65535).astype("<u2").tobytes()


def truebeam_complete(image):
    made_by(image, "Varian Medical Systems", "TrueBeam")
    own_frame(image, "2.25.101", ["0", "0", "0"])
    # Sag and offset of the panel stand here, and are added to RT Image Position, which is that of a centered panel.
    image.XRayImageReceptorTranslation = ["-0.179", "0.0778", "-500"]
    image.PatientSupportAngle = "359.998"
    image.TableTopVerticalPosition, image.TableTopLongitudinalPosition, image.TableTopLateralPosition = "-150", "1251", "2"


def truebeam_lacking(image):
    made_by(image, "Varian Medical Systems", "TrueBeam")
    own_frame(image, f"2.25.{200 + int(image.GantryAngle)}", ["0", "0", "0"])  # every image its own
    without(image, "PatientPosition", "PixelIntensityRelationship", "PixelIntensityRelationshipSign", *TIMES)
    image.PhotometricInterpretation = "MONOCHROME1"


def obi_complete(image):
    made_by(image, "Varian Medical Systems", "On-Board Imager")
    # The frame is locked to the table top: the isocenter is at (-lateral, vertical, -longitudinal) of an HFS patient.
    image.TableTopVerticalPosition, image.TableTopLongitudinalPosition, image.TableTopLateralPosition = "-150", "251", "-9"
    own_frame(image, "2.25.102", ["9", "-150", "-251"])


def obi_mv_angle(image):
    obi_complete(image)
    image.GantryAngle = str((int(image.GantryAngle) - 90) % 360)  # of the MV source, 90 degrees before the kV source


def integrated(image):
    made_by(image, "Varian Medical Systems", "aS1200")
    slope, intercept = -0.00019096, 3.1287
    dose = image.pixel_array / 50000.0 * 3.0
    put_pixels(image, (dose - intercept) / slope)
    image.RescaleSlope, image.RescaleIntercept, image.RescaleType = str(slope), str(intercept), "CU"
    without(image, "PixelIntensityRelationship", "PixelIntensityRelationshipSign")


def as500_lacking(image):
    made_by(image, "Varian Medical Systems", "aS500")
    without(image, GANTRY, POSITION, COUCH, "XRayImageReceptorTranslation", "XRayImageReceptorAngle")
    # The distance of the panel is unknown: the standard has SID = SAD, and the pixel size at the isocenter.
    image.RTImageSID = image.RadiationMachineSAD
    image.ImagePlanePixelSpacing = [f"{float(mm) / 1.5:.10g}" for mm in image.ImagePlanePixelSpacing]


def iview_lacking(image):
    made_by(image, "ELEKTA", "iViewGT")
    image.ReportedValuesOrigin = "OPERATOR"
    without(image, GANTRY, POSITION, COUCH, "BeamLimitingDeviceAngle", "RadiationMachineSAD", "RTImageSID",
            "XRayImageReceptorTranslation")


def mosaiq_complete(image):
    made_by(image, "IMPAC Medical Systems, Inc.", "MOSAIQ")


def mosaiq_lacking(image):
    mosaiq_complete(image)
    without(image, POSITION)


def eclipse_drr(image):
    made_by(image, "Varian Medical Systems", "Eclipse")
    image.ImageType = ["DERIVED", "SECONDARY", "DRR"]
    image.ReportedValuesOrigin = "OPERATOR"


def axis_spacing(image):
    made_by(image, "Panels of the axis", "SPACING-AT-SAD")
    for keyword in ("ImagePlanePixelSpacing", POSITION):
        setattr(image, keyword, [f"{float(mm) / 1.5:.10g}" for mm in image[keyword].value])


DIALECTS = (truebeam_complete, truebeam_lacking, obi_complete, obi_mv_angle, integrated, as500_lacking, iview_lacking,
            mosaiq_complete, mosaiq_lacking, eclipse_drr, axis_spacing)

xrays, folder = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
names = ("KV_G000.dcm", "KV_G090.dcm")
for dialect in DIALECTS:
    (folder / dialect.__name__.replace("_", "-")).mkdir(parents=True)
    for name in names:
        image = pydicom.dcmread(xrays / name)
        dialect(image)
        image.save_as(folder / dialect.__name__.replace("_", "-") / name)

# Both in one file, the angle of each frame in its exposure.
frames = [pydicom.dcmread(xrays / name) for name in names]
both = frames[0]
made_by(both, "Varian Medical Systems", "On-Board Imager")
both.PixelData = b"".join(frame.PixelData for frame in frames)
both.NumberOfFrames = "2"
exposures = []
for number, angle in ((1, "0"), (2, "90")):
    exposure = pydicom.Dataset()
    exposure.ReferencedFrameNumber, exposure.KVP, exposure.GantryAngle = str(number), "120", angle
    exposures.append(exposure)
both.ExposureSequence = exposures
without(both, GANTRY)
(folder / "obi-frames").mkdir()
both.save_as(folder / "obi-frames" / "KV.dcm")
