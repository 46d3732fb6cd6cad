"""The tables of docs/renderers.md."""

import re

from markdown import ROOT, json_of, rows_of, table, words


def cpu_variants():
    variants = rows_of("cpu-variants.csv")
    return table(list(variants[0]), [variant.values() for variant in variants])


def precision():
    """Of both views the larger error."""
    found = rows_of("precision-2-cores-llvmpipe.csv")
    columns = [(attenuation, precision) for attenuation in ("physical", "windowed") for precision in ("u8", "u16", "f32")]

    def error(renderer, *column):
        errors = [float(view["rms_error"]) for view in found
                  if (view["renderer"], view["attenuation"], view["precision"]) == (renderer, *column)]
        assert len(errors) == 2, (renderer, column)
        return f"{100 * max(errors):.3f} %"

    return table(["renderer", "physical u8", "u16", "f32", "windowed u8", "u16", "f32"],
                 [[name] + [error(renderer, *column) for column in columns]
                  for renderer, name in (("cpu", "cpu"), ("raycast", "raycast (llvmpipe)"),
                                         ("raycast-box", "raycast-box (llvmpipe)"))])


# What each row of "Before a GPU is trusted" shows, and the tests' names of it.
CHECKED = {"`raycast` on llvmpipe": ["texture_units"],
           "the same with weights of 8 bits, as texture units of GPUs have them": ["eight_bit_weights"],
           "a volume that lies 0.1 voxels beside along one axis": ["moved_along_x", "moved_along_y", "moved_along_z"],
           "no interpolation (`siddon`)": ["siddon"]}


def gpu_check():
    """Figures that the tests GpuCheck record."""
    tests = json_of("gpu-check.json")["testsuites"][0]["testsuite"]
    recorded = {name: value for test in tests for name, value in test.items()}
    limit = re.search(r"kMostOfWaves = ([0-9.]+)", (ROOT / "drr/raycast/rendering_check.cc").read_text())[1]

    def cells(what, names):
        shares = sorted({f"{float(recorded[name]):.3f}".rstrip("0") if float(recorded[name]) > 0.001 else
                         f"{float(recorded[name]):.4f}" for name in names})
        (result,) = {recorded[name + "_result"] for name in names}
        return [what, " to ".join([shares[0], *shares[1:][-1:]]),
                result + (f": expected at most {limit}" if result == "fails" else "")]

    return table(["what renders", "waves, largest difference", "result"], [cells(*row) for row in CHECKED.items()])


def plastimatch():
    cases = json_of("plastimatch-2-cores-2.6GHz.json")["cases"]

    def cells(case):
        hu = case["threshold_hu"]
        return ["no threshold" if hu is None else f"threshold {hu:.0f} HU", f"{case['plastimatch_ms_per_drr']:.0f} ms",
                f"{case['ms_per_drr']:.1f} ms", f"{case['ratio']:.1f}"]

    return table(["plastic head, 2 cores", "plastimatch", "cpu", "ratio"], map(cells, cases))


TABLES = [("Renderers", words("| name | method | runs on | used for |")),
          ("Ray casting", cpu_variants),
          ("Precision", precision),
          ("Before a GPU is trusted", gpu_check),
          ("Compared with another program", plastimatch)]
