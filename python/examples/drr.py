"""The DRRs of a study, and one of a gantry angle that no X-ray has: drr.py STUDY_FOLDER OUTPUT_FOLDER"""

import pathlib
import sys

import isoshift

study = isoshift.load_study(sys.argv[1])
output = pathlib.Path(sys.argv[2])
output.mkdir(parents=True, exist_ok=True)

renderer = isoshift.Renderer(study.ct)
views = study.views + [isoshift.carm_view(45.0)]
for number, images in enumerate(renderer.render(views, study.planned_room_from_patient), start=1):
    (output / f"drr{number}.png").write_bytes(isoshift.png(images[0]))
    print(f"drr{number}.png: {images.shape[2]} x {images.shape[1]} pixels, line integrals up to {images.max():.2f}")
