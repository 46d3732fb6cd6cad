"""An optimizer of one's own on the batched objective: own_optimizer.py STUDY_FOLDER [PICTURE.png]

An evolution strategy: every generation renders a batch of poses at once, keeps the better quarter, and draws the next
generation around their mean.
"""

import pathlib
import sys

import numpy as np

import isoshift


def motion(parameters):
    """The rigid motion of a translation (mm) and a rotation vector (rad), shape (4, 4)."""
    matrix = np.eye(4)
    angle = np.linalg.norm(parameters[3:])
    x, y, z = parameters[3:] / angle if angle > 0 else np.zeros(3)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    matrix[:3, 3] = parameters[:3]
    return matrix


study = isoshift.load_study(sys.argv[1])
planned = study.planned_room_from_patient
images = [isoshift.prepare(xray) for xray in study.xrays]
renderer = isoshift.Renderer(study.ct)

random = np.random.default_rng(1)
mean, spread = np.zeros(6), np.array([6.0, 6.0, 6.0, 0.04, 0.04, 0.04])
for factor in (4, 2):
    objective = isoshift.Objective(renderer, [image.reduced(factor) for image in images], motion(mean) @ planned,
                                   similarity="gradient-correlation")
    for generation in range(25):
        drawn = mean + spread * random.standard_normal((48, 6))
        values = objective.values(np.array([motion(parameters) @ planned for parameters in drawn]))
        best = drawn[np.argsort(values)[-12:]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 1e-4
    print(f"blocks of {factor} x {factor} pixels: similarity {values.max():.4f}, "
          f"translation ({', '.join(f'{value:+.2f}' for value in mean[:3])}) mm")

result = isoshift.register(study)
print(f"isoshift's own: translation ({', '.join(f'{value:+.2f}' for value in result.setup_error[:3, 3])}) mm")
if len(sys.argv) > 2:  # of every view: X-ray, DRR where the strategy began, DRR where it ended
    drrs = renderer.render(study.views, np.array([planned, motion(mean) @ planned]))
    rows = [np.hstack([shown / np.quantile(shown, 0.99) for shown in (image.line_integral, *of_view)])
            for image, of_view in zip(images, drrs)]
    pathlib.Path(sys.argv[2]).write_bytes(isoshift.png(np.vstack(rows)))
