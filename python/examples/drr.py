"""The DRRs of a study, and one of a gantry angle that no X-ray has: drr.py STUDY_FOLDER PICTURE.png"""

import pathlib
import sys

import numpy as np

import isoshift

study = isoshift.load_study(sys.argv[1])
renderer = isoshift.Renderer(study.ct)
of_study = study.views[0]
oblique = isoshift.carm_view(45.0, columns=of_study.columns, rows=of_study.rows, pixel_mm=2.0)
drrs = [images[0] for images in renderer.render([*study.views, oblique], study.planned_room_from_patient)]
for number, drr in enumerate(drrs, start=1):
    print(f"DRR {number}: {drr.shape[1]} x {drr.shape[0]} pixels, line integrals up to {drr.max():.2f}")
pathlib.Path(sys.argv[2]).write_bytes(isoshift.png(np.hstack(drrs)))
