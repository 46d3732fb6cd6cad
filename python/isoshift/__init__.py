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
import pathlib
import shutil

from ._isoshift import (CtSeries, Error, FixedImage, Objective, Renderer, SetupResult, Study, UsageError, XrayImage,
                        XrayView, __version__, carm_view, load_study, png, prepare, register, similarity, use_decoder,
                        view_from_matrix, write_spatial_registration)

__all__ = ["CtSeries", "Error", "FixedImage", "Objective", "Renderer", "SetupResult", "Study", "UsageError", "XrayImage",
           "XrayView", "__version__", "carm_view", "load_study", "png", "prepare", "register", "similarity", "use_decoder",
           "view_from_matrix", "write_spatial_registration"]

Error.__doc__ = "Something that cannot be done with the given input: names file, attribute, what was found and what to do."
UsageError.__doc__ = "An argument that makes no sense."


def _program() -> str:
    """The program that decodes compressed pixels: of the environment, installed or built beside this module, or in PATH."""
    if named := os.environ.get("ISOSHIFT_PROGRAM"):
        return named
    here = pathlib.Path(__file__).resolve()
    beside = [folder / place for folder in here.parents[1:6] for place in ("bin/isoshift", "cli/isoshift")]
    return next((str(path) for path in beside if os.access(path, os.X_OK) and path.is_file()), shutil.which("isoshift") or "")


use_decoder(_program())
