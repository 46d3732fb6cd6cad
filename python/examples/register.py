"""A registration in six lines, and a picture of it: register.py STUDY_FOLDER [PICTURE.png]"""

import pathlib
import sys

import numpy as np

import isoshift

study = isoshift.load_study(sys.argv[1])
result = isoshift.register(study)
print(result.verdict, *result.reasons, sep="\n  ")
print(result.setup_error.round(3))

if len(sys.argv) > 2:  # of every view: X-ray, DRR as planned, DRR as found
    poses = np.array([study.planned_room_from_patient, result.actual_room_from_patient])
    drrs = isoshift.Renderer(study.ct).render(study.views, poses)
    rows = [np.hstack([image / np.quantile(image, 0.99) for image in (isoshift.prepare(xray).line_integral, *of_view)])
            for xray, of_view in zip(study.xrays, drrs)]
    pathlib.Path(sys.argv[2]).write_bytes(isoshift.png(np.vstack(rows)))
