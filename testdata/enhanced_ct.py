"""Writes CT slices of one series as an Enhanced CT (PS3.3 A.38): enhanced_ct.py OUTPUT SLICE...

What differs from frame to frame stands in functional groups of its frame, the rest in shared ones.
"""
import sys

import pydicom
from pydicom.dataset import Dataset
from pydicom.sequence import Sequence
from pydicom.uid import EnhancedCTImageStorage

# What the functional groups hold instead of the dataset.
PER_SLICE = ("ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing", "SliceThickness", "RescaleIntercept",
             "RescaleSlope", "RescaleType", "InstanceNumber")


def item(source, *keywords, **values):
    dataset = Dataset()
    for keyword in keywords:
        setattr(dataset, keyword, getattr(source, keyword))
    for keyword, value in values.items():
        setattr(dataset, keyword, value)
    return Sequence([dataset])


def frame(number, one):
    groups = Dataset()
    groups.FrameContentSequence = item(one, StackID="1", InStackPositionNumber=number)
    groups.PlanePositionSequence = item(one, "ImagePositionPatient")
    return groups


def main(output, paths):
    slices = sorted((pydicom.dcmread(path) for path in paths), key=lambda one: one.ImagePositionPatient[2])
    whole = pydicom.dcmread(paths[0])
    first = slices[0]
    for keyword in PER_SLICE:
        if keyword in whole:
            delattr(whole, keyword)
    whole.SOPClassUID = whole.file_meta.MediaStorageSOPClassUID = EnhancedCTImageStorage
    whole.SOPInstanceUID = whole.file_meta.MediaStorageSOPInstanceUID = first.SeriesInstanceUID + ".1"
    whole.NumberOfFrames = len(slices)
    shared = Dataset()
    shared.PlaneOrientationSequence = item(first, "ImageOrientationPatient")
    shared.PixelMeasuresSequence = item(first, "PixelSpacing", "SliceThickness")
    shared.PixelValueTransformationSequence = item(first, "RescaleIntercept", "RescaleSlope", "RescaleType")
    shared.CTImageFrameTypeSequence = item(first, FrameType=first.ImageType)
    whole.SharedFunctionalGroupsSequence = Sequence([shared])
    whole.PerFrameFunctionalGroupsSequence = Sequence(
        [frame(number, one) for number, one in enumerate(slices, start=1)])
    whole.PixelData = b"".join(one.PixelData for one in slices)
    whole.save_as(output)


main(sys.argv[1], sys.argv[2:])
