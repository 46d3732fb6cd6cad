"""2D/3D registration of treatment-room X-rays with the planning CT.

    import isoshift
    study = isoshift.load_study("exported/")
    result = isoshift.register(study)
    print(result.verdict, result.setup_error)

Names, frames and signs are those of the program (docs/conventions.md): poses are matrices of shape (4, 4) that take DICOM
patient coordinates (LPS) to the treatment room (IEC 61217 fixed, origin at the isocenter), in mm. Images are float32
arrays of shape (rows, columns). Work that takes long releases the global interpreter lock.
"""

import os
import shutil

from ._isoshift import (CtSeries, Error, FixedImage, Objective, Renderer, SetupResult, Study, UsageError, XrayImage,
                        XrayView, __version__, carm_view, load_study, png, prepare, register, similarity, use_decoder,
                        view_from_matrix, write_spatial_registration)

__all__ = ["CtSeries", "Error", "FixedImage", "Objective", "Renderer", "SetupResult", "Study", "UsageError", "XrayImage",
           "XrayView", "__version__", "carm_view", "load_study", "png", "prepare", "register", "similarity", "use_decoder",
           "view_from_matrix", "write_spatial_registration"]

Error.__doc__ = "Something that cannot be done with the given input: names file, attribute, what was found and what to do."
UsageError.__doc__ = "An argument that makes no sense."

# Compressed pixels are decoded by the program, in a process of their own.
use_decoder(os.environ.get("ISOSHIFT_PROGRAM") or shutil.which("isoshift") or "")
