"""The Python module against the program, and against numbers by hand."""

import ast
import json
import os
import pathlib
import subprocess
import sys
import threading

import numpy as np
import pydicom
import pytest

import isoshift

SOURCE = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = os.environ["ISOSHIFT_PROGRAM"]


def copied(study, folder):
    """A study of testdata/ with its first session alone."""
    subprocess.run(["cp", "-r", SOURCE / "testdata" / study, folder], check=True)
    subprocess.run(["rm", "-rf", folder / "RTIMAGE" / "F02"], check=True)
    return folder


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    return copied("small/1", tmp_path_factory.mktemp("small") / "study")


@pytest.fixture(scope="session")
def study(folder):
    return isoshift.load_study(folder)


@pytest.fixture(scope="session")
def renderer(study):
    return isoshift.Renderer(study.ct)


def moved(study, translation_mm):
    pose = np.array(study.planned_room_from_patient)
    pose[:3, 3] += translation_mm
    return pose


def line_integrals(path):
    """A MetaImage of floats, as isoshift drr writes it."""
    content = path.read_bytes()
    header, _, rest = content.partition(b"ElementDataFile = LOCAL\n")
    columns, rows = map(int, header.split(b"DimSize = ")[1].split(b"\n")[0].split())
    return np.frombuffer(rest, dtype="<f4").reshape(rows, columns)


@pytest.mark.parametrize("name", ["small/1", "head"])
def test_drrs_are_those_of_the_program_bit_by_bit(name, tmp_path):
    folder = copied(name, tmp_path / "study")
    subprocess.run([PROGRAM, "drr", folder, "-o", tmp_path / "drr", "--renderer", "cpu"], check=True, capture_output=True)
    study = isoshift.load_study(folder)
    images = isoshift.Renderer(study.ct).render(study.views, study.planned_room_from_patient)
    assert len(images) == len(study.xrays) >= 2
    for number, image in enumerate(images, start=1):
        expected = line_integrals(tmp_path / "drr" / f"drr{number}.mha")
        assert image.dtype == np.float32 and image.shape == (1, *expected.shape)
        assert np.array_equal(image[0], expected) and expected.max() > 1


def test_a_batch_is_the_same_as_its_poses_one_by_one(study, renderer):
    poses = np.array([moved(study, (x, 0, 2 * x)) for x in (0.0, 3.0, -4.0)])
    batch = renderer.render(study.views, poses)
    for n, pose in enumerate(poses):
        for view, image in enumerate(renderer.render(study.views, pose)):
            assert np.array_equal(batch[view][n], image[0])
    listed = renderer.render(study.views, poses, pixels=[[5, 4000], [96 * 48 + 48]])
    assert listed[0].shape == (3, 2) and listed[1].shape == (3, 1)
    assert np.array_equal(listed[1][:, 0], batch[1][:, 48, 48])


def test_derivatives_are_those_of_differences(study, renderer):
    step = 0.05
    images, derivatives = renderer.render_with_derivatives(study.views, study.planned_room_from_patient)
    for axis in range(3):
        offset = np.eye(3)[axis] * step
        ahead, behind = (renderer.render(study.views, moved(study, sign * offset)) for sign in (1, -1))
        for view, of_view in enumerate(derivatives):
            assert of_view.shape == (1, *images[view].shape[1:], 6)
            difference = (ahead[view] - behind[view])[0] / (2 * step)
            assert np.abs(difference - of_view[0, ..., axis]).mean() < 0.05 * np.abs(difference).mean()


def test_what_was_read_cannot_be_written(study):
    for array in (study.ct.hu, study.xrays[0].values):
        assert not array.flags.writeable and array.base is not None
    assert study.ct.hu.shape == (36, 58, 48) and study.ct.hu.min() >= -1024


def test_images_outlive_what_made_them(study):
    renderer = isoshift.Renderer(study.ct)
    images = renderer.render(study.views, study.planned_room_from_patient)
    kept = images[0][0, 10:20].copy(), images[0][0, 10:20]
    del renderer, images
    assert np.array_equal(*kept)


def test_a_registration_is_that_of_the_program(folder, study, tmp_path):
    subprocess.run([PROGRAM, "register", folder, "-o", tmp_path / "out"], check=True, capture_output=True)
    expected = json.loads((tmp_path / "out" / "result.json").read_text())
    result = isoshift.register(study)
    assert result.verdict == expected["verdict"]
    found = result.as_dict()
    assert found["setup_error"] == expected["setup_error"] and found["couch_shift"] == expected["couch_shift"]
    assert np.allclose(result.setup_error[:3, 3], expected["setup_error"]["translation_mm"], atol=1e-12)
    assert result.covariance.shape == (6, 6)
    assert "PATIENT SETUP SHIFT" in str(result)
    again = isoshift.register(study, start_setup_error=result.setup_error, search=False)
    assert again.verdict == "review" and np.allclose(again.setup_error, result.setup_error, atol=1e-9)
    uid, warnings = isoshift.write_spatial_registration(study, result, tmp_path / "object.dcm")
    assert uid.startswith("2.25.") and warnings == []
    with pytest.raises(isoshift.Error, match="only on request"):
        isoshift.write_spatial_registration(study, again, tmp_path / "again.dcm")
    isoshift.write_spatial_registration(study, again, tmp_path / "again.dcm", for_review=True)
    assert pydicom.dcmread(tmp_path / "again.dcm").ContentLabel == "SETUP_BY_HAND"
    checked = subprocess.run([PROGRAM, "check", tmp_path / "object.dcm", "--plan", folder / "RTPLAN.dcm", "--json"],
                             capture_output=True, check=True)
    shift = json.loads(checked.stdout)["registrations"][0]["couch_shift"]
    assert abs(shift["lateral_mm"] - expected["couch_shift"]["lateral_mm"]) < 1e-6


def test_the_objective_is_best_where_the_patient_lies(study, renderer):
    result = isoshift.register(study)
    images = [isoshift.prepare(xray) for xray in study.xrays]
    assert images[0].line_integral.shape == images[0].field.shape == study.xrays[0].values.shape
    for similarity in ("src", "ncc", "mi", "gradient-correlation"):
        objective = isoshift.Objective(renderer, images, result.actual_room_from_patient, similarity=similarity)
        poses = np.array([result.actual_room_from_patient] * 4)
        poses[1:, :3, 3] += 5 * np.eye(3)
        values = objective.values(poses)
        assert values.shape == (4,) and values.argmax() == 0
        assert np.allclose(np.mean(objective.per_view(poses), axis=1), values)
    value, gradient, curvature = objective.models(poses[1])[0]
    assert np.isclose(value, values[1]) and gradient.shape == (6,) and curvature.shape == (6, 6)
    assert gradient[0] < 0  # 5 mm too far along x


def test_similarities_of_lists_are_those_by_hand():
    pixels = np.arange(1000, dtype=np.float32)
    assert isoshift.similarity("ncc", pixels, 3 * pixels + 1) == pytest.approx(1)
    assert isoshift.similarity("src", pixels, -np.sqrt(pixels)) == pytest.approx(-1, abs=0.01)
    # 32 bins, equally full. A pixel of the DRR counts in the two bins whose middles it lies between: of those in one bin
    # three quarters stay there, and an eighth each counts in its neighbors.
    spread = -(0.75 * np.log(0.75) + 0.25 * np.log(0.125))
    assert isoshift.similarity("mi", pixels, pixels) == pytest.approx(np.log(32) - spread, abs=0.03)
    assert isoshift.similarity("nmi", pixels, -pixels) == pytest.approx(2 * np.log(32) / (np.log(32) + spread), abs=0.03)
    with pytest.raises(ValueError, match="no pixel"):
        isoshift.similarity("ncc", [], [])
    assert isoshift.similarity("ncc", pixels, (pixels - 499.5) ** 2) == pytest.approx(0, abs=1e-6)
    with pytest.raises(isoshift.UsageError, match="there is no similarity nccc"):
        isoshift.similarity("nccc", pixels, pixels)


def test_views_project_as_by_hand():
    view = isoshift.carm_view(90.0, columns=101, rows=101, pixel_mm=1.5)
    assert np.allclose(view.source_room_mm, (1000, 0, 0))
    assert np.allclose(view.project((0, 0, 0)), (50, 50))
    # A point 10 mm toward the gantry lies 10 pixels higher: 15 mm on the receptor.
    assert np.allclose(view.project((0, 10, 0)), (50, 40))
    assert view.project((1001, 0, 0)) is None
    other = isoshift.view_from_matrix(view.pixel_from_room, sid_mm=1500, columns=101, rows=101)
    assert np.allclose(other.project((3, -20, 7)), view.project((3, -20, 7)))


def test_what_cannot_be_is_an_error(folder, study, renderer, tmp_path):
    with pytest.raises(isoshift.Error, match="no such file or folder"):
        isoshift.load_study(tmp_path / "nowhere")
    with pytest.raises(isoshift.UsageError, match="no check has this key"):
        isoshift.load_study(folder, allow={"nonsense": "because"})
    for shape in ((3, 4), (4,), (2, 4, 3)):
        with pytest.raises(ValueError, match="shape"):
            renderer.render(study.views, np.zeros(shape))
    with pytest.raises(ValueError, match="pose 0 is not a rigid motion"):
        renderer.render(study.views, 2 * np.eye(4))
    for poses in (np.eye(4) * (1 + 1j), np.eye(4).astype(str), np.eye(4).astype(object)):
        with pytest.raises(TypeError):
            renderer.render(study.views, poses)
    with pytest.raises(isoshift.Error, match="is no program"):
        isoshift.use_decoder(str(tmp_path))
    with pytest.raises(isoshift.UsageError, match="renderer=gpu: there is no such renderer"):
        isoshift.Renderer(study.ct, renderer="gpu")
    for nonsense in ({"preset": "best"}, {"dof": "Rigid"}, {"renderer": "gpu"}):
        with pytest.raises(isoshift.UsageError):
            isoshift.register(study, **nonsense)
    for nonsense in ({"isocenter": [1, 2]}, {"rt_image_position": [1]}, {"patient_position": "hfs"}, {"intensity": "x"}):
        with pytest.raises(isoshift.UsageError, match=next(iter(nonsense))):
            isoshift.load_study(folder, **nonsense)


def test_numbers_that_mean_nothing_are_errors(study):
    view = study.views[0]
    image = isoshift.prepare(study.xrays[0])
    nan, numbers = [float("nan")] * 100, list(range(100))
    for nonsense in (lambda: view.downscaled(0), lambda: view.downscaled(-2), lambda: view.downscaled(10**6),
                     lambda: image.reduced(0), lambda: image.reduced(view.rows + 1),
                     lambda: isoshift.carm_view(float("nan")), lambda: isoshift.carm_view(0, pixel_mm=-1),
                     lambda: isoshift.carm_view(0, columns=0), lambda: isoshift.carm_view(0, rows=10**6),
                     lambda: isoshift.carm_view(0, sad_mm=2000),
                     lambda: isoshift.view_from_matrix(view.pixel_from_room, sid_mm=1500, columns=-1, rows=96),
                     lambda: isoshift.png(np.zeros((0, 0))), lambda: isoshift.png(np.full((4, 4), np.inf)),
                     *(lambda kind=kind: isoshift.similarity(kind, nan, numbers) for kind in ("ncc", "src", "mi", "nmi")),
                     *(lambda kind=kind: isoshift.similarity(kind, numbers, nan) for kind in ("ncc", "src", "mi", "nmi"))):
        with pytest.raises(ValueError):
            nonsense()


def test_views_and_comparisons_that_cannot_be_are_errors(study, renderer):
    pose, images = study.planned_room_from_patient, [isoshift.prepare(xray) for xray in study.xrays]
    with pytest.raises(isoshift.UsageError, match="images: expected at least one"):
        isoshift.Objective(renderer, [], pose)
    for share in (-1, 0, 2, float("nan"), float("inf")):
        with pytest.raises(isoshift.UsageError, match="pixel_fraction is"):
            isoshift.Objective(renderer, images, pose, pixel_fraction=share)
    away = np.array(pose)
    away[0, 3] += 1e5
    with pytest.raises(isoshift.Error, match="KV_G000: the DRR is empty"):
        isoshift.Objective(renderer, images, away)
    siddon = isoshift.Renderer(study.ct, renderer="siddon")
    with pytest.raises(isoshift.UsageError, match="the renderer siddon has no derivatives"):
        siddon.render_with_derivatives(study.views, pose)
    with pytest.raises(isoshift.UsageError, match="a view is megavoltage"):
        renderer.render([isoshift.carm_view(0, is_megavoltage=True, columns=16, rows=16)], pose)
    for nonsense, name in (({"pixel_mm": 1e-300}, "pixel_mm"), ({"sad_mm": 1e-300}, "sad_mm"), ({"sid_mm": 900}, "sid_mm")):
        with pytest.raises(ValueError, match=f"{name} is"):
            isoshift.carm_view(0, **nonsense)
    with pytest.raises(ValueError, match="gantry_deg is nan"):
        isoshift.carm_view(float("nan"))


def test_pixels_of_ones_own_are_compared(study, renderer):
    pose = study.planned_room_from_patient
    images = []
    for view, drr in zip(study.views, renderer.render(study.views, pose)):
        images.append(isoshift.prepare(isoshift.XrayImage(view, 1e4 * np.exp(-drr[0]), label="own")))
    assert images[0].label == "own" and not isoshift.XrayImage(study.views[0], drr[0]).is_line_integral
    poses = np.array([pose, moved(study, (3, 0, 0)), moved(study, (0, 0, -3))])
    values = isoshift.Objective(renderer, images, pose, similarity="ncc").values(poses)
    assert values.argmax() == 0 and values[0] > 0.99
    for nonsense in (drr[0][1:], np.full_like(drr[0], np.nan), -1 - drr[0]):
        with pytest.raises(ValueError, match="values: expected"):
            isoshift.XrayImage(study.views[0], nonsense)


def test_names_of_files_need_not_be_utf_8(folder, tmp_path):
    with pytest.raises(isoshift.Error, match=r"st\\xff: no such file"):
        isoshift.load_study(os.fsdecode(os.fsencode(tmp_path) + b"/st\xff"))
    copy = tmp_path / "study"
    subprocess.run(["cp", "-r", folder, copy], check=True)
    with open(os.fsencode(copy) + b"/not\xffes.txt", "w", encoding="ascii") as file:
        file.write("no DICOM")
    assert any("not\\xffes.txt" in text for text in isoshift.load_study(copy).left_aside)
    # A review whose reason names files.
    strange = os.fsencode(tmp_path) + b"/stud\xff"
    os.rename(os.fsencode(copy), strange)
    images = sorted(pathlib.Path(os.fsdecode(strange)).glob("RTIMAGE/*.dcm"))
    first, second = (pydicom.dcmread(image) for image in images)
    second.GantryAngle, second.RTImageLabel = first.GantryAngle, first.RTImageLabel
    for name in ("TableTopVerticalPosition", "TableTopLongitudinalPosition", "TableTopLateralPosition"):
        for image in (first, second):
            if name in image:
                del image[name]
    for path, image in zip(images, (first, second)):
        image.save_as(path)
    reasons = isoshift.register(isoshift.load_study(os.fsdecode(strange)), search=False).reasons
    assert any("stud\\xff" in reason for reason in reasons), reasons


def test_a_site_decides_and_times_are_told(folder, study):
    site = SOURCE / "testdata" / "config" / "site" / "linac.json"
    result = isoshift.register(isoshift.load_study(folder, site=site), site=site).as_dict()
    assert result["site"] is not None and isoshift.register(study).as_dict()["site"] is None
    seconds = result["seconds"]
    assert 0 < seconds["load"] < seconds["total"] and seconds["register"] < seconds["total"]


def test_the_span_of_a_site_counts(folder, study, tmp_path):
    site = tmp_path / "site.json"
    text = (SOURCE / "testdata" / "config" / "site" / "linac.json").read_text()
    assert '"max_span_s": 120' in text
    site.write_text(text.replace('"max_span_s": 120', '"max_span_s": 5'))
    with pytest.raises(isoshift.Error, match=r"allows 5 s between X-rays .* name the site file in load_study\(\), too"):
        isoshift.register(study, site=site)
    result = isoshift.register(isoshift.load_study(folder, site=site), site=site)
    assert result.verdict == "review" and any("more than 5 s" in reason for reason in result.reasons)


def test_an_object_is_of_the_study_of_its_result(study, tmp_path):
    result = isoshift.register(study)
    other = isoshift.load_study(SOURCE / "testdata" / "small" / "2", latest=True)
    with pytest.raises(isoshift.Error, match="the result is of another study"):
        isoshift.write_spatial_registration(other, result, tmp_path / "other.dcm")
    for change in ({"isocenter": [-2.5, 38.0, -410.0]}, {"couch_angle_deg": 5.0}):
        other = isoshift.load_study(SOURCE / "testdata" / "small" / "1", latest=True, **change)
        same = isoshift.register(isoshift.load_study(SOURCE / "testdata" / "small" / "1", latest=True))
        with pytest.raises(isoshift.Error, match="the result is about another planned pose"):
            isoshift.write_spatial_registration(other, same, tmp_path / "other.dcm")
    assert not (tmp_path / "other.dcm").exists()


def test_messages_name_arguments_and_not_flags(folder, tmp_path):
    broken = tmp_path / "broken"
    subprocess.run(["cp", "-r", folder, broken], check=True)
    for path in (broken / "RTIMAGE").glob("*.dcm"):
        dataset = pydicom.dcmread(path)
        del dataset.RTImageSID
        dataset.save_as(path)
    with pytest.raises(isoshift.Error, match=r"RTImageSID \(3002,0026\) is missing.\n +Supply it: sid_mm"):
        isoshift.load_study(broken)
    assert len(isoshift.load_study(broken, sid_mm=1500.0).xrays) == 2


def test_other_threads_run_while_a_registration_does(study):
    done = threading.Event()
    worker = threading.Thread(target=lambda: (isoshift.register(study), done.set()))
    worker.start()
    turns = 0
    while not done.wait(0.001):
        turns += 1
    worker.join()
    assert turns > 50


def test_stubs_and_docstrings_are_there_for_all_names():
    stubs = ast.parse((SOURCE / "python" / "isoshift" / "__init__.pyi").read_text())
    named = {node.name: node for node in stubs.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    public = set(isoshift.__all__) - {"__version__"}
    assert set(named) == public
    for name in public:
        thing = getattr(isoshift, name)
        assert thing.__doc__, name
        if isinstance(named[name], ast.ClassDef) and not issubclass(thing, Exception):
            in_stub = {member.name for member in named[name].body if isinstance(member, ast.FunctionDef)}
            in_module = {member for member in vars(thing) if not member.startswith("_")}
            assert in_stub - {"__init__"} == in_module, name


@pytest.mark.parametrize("example", ["drr.py", "register.py", "own_optimizer.py"])
def test_examples_run(example, folder, tmp_path):
    picture = tmp_path / "picture.png"
    outcome = subprocess.run([sys.executable, SOURCE / "python" / "examples" / example, folder, picture],
                             capture_output=True, text=True)
    assert outcome.returncode == 0, outcome.stderr
    assert picture.read_bytes().startswith(b"\x89PNG")
