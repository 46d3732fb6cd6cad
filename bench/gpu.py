#!/usr/bin/python3
"""Tests and measures all of isoshift that needs a GPU, and writes one JSON file.

    bench/gpu.py RELEASE_BUILD UNIT_TESTS OUTPUT.json [--software]

The exit status is 1 if a test failed, or was skipped for want of a GPU; the file is written all the same, with what was
measured until then.
"""
import argparse
import json
import os
import pathlib
import platform
import subprocess
import sys
import tempfile
import time

LIMIT_S = 300  # of one step: what hangs shall not take the others' time


def output_of(command, **more):
    return subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=True, **more).stdout


def machine(devices):
    """What this machine is, as far as it tells."""
    with open("/proc/cpuinfo", encoding="utf-8") as lines:
        models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    found = {"processor": models[0] if models else platform.machine(), "threads": os.cpu_count(),
             "system": platform.platform(), "devices": devices}
    try:
        query = ["nvidia-smi", "--query-gpu=name,driver_version,memory.total", "--format=csv,noheader"]
        found["nvidia_smi"] = output_of(query).splitlines()
    except (OSError, subprocess.SubprocessError):
        found["nvidia_smi"] = None
    return found


def tests(program, kind):
    """Every test of that kind of OpenGL, without its cases that no device could run."""
    wanted = "*_hardware*" if kind == "hardware" else "*_software*:Gl.*:GpuCheck.*:SpotCheckTest.*:RaycastGl.*"
    with tempfile.TemporaryDirectory() as folder:
        report = pathlib.Path(folder) / "tests.json"
        subprocess.run([program, f"--gtest_filter={wanted}", f"--gtest_output=json:{report}"], stdout=sys.stderr, timeout=LIMIT_S, check=False,
                       env={**os.environ, **({"ISOSHIFT_REQUIRE_GPU": "1"} if kind == "hardware" else {})})
        suites = json.loads(report.read_text(encoding="utf-8"))["testsuites"]
    all_tests = [(f"{suite['name']}.{test['name']}", test) for suite in suites for test in suite["testsuite"]]
    return {"run": len(all_tests), "failed": [name for name, test in all_tests if test.get("failures")],
            "skipped": [name for name, test in all_tests if test["result"] == "SKIPPED"]}


def table1(isoshift, kind):
    """The founding paper's protocol: all of its 27,000 poses where a pose takes well below a millisecond."""
    fast = ["--renderer", "raycast", "--every", "1" if kind == "hardware" else "4999"]
    rest = ["--every", "999" if kind == "hardware" else "13499"]
    for renderer in ("cpu", "raycast-box", "raycast-cuberille", "splat", "splat-texture", "splat-buffers"):
        rest += ["--renderer", renderer]
    return [json.loads(output_of([isoshift, "bench", "drr", "--gl", kind, "--json", *part])) for part in (fast, rest)]


def benchmarks(program, kind):
    wanted = f"(every_renderer|batch|percent_of_the_pixels|pixels_along_an_edge)/.*(cpu|_{kind})|similarity/" + \
             f"|register_two_views/[a-z]+(/raycast_{kind}|/iterations)"
    found = json.loads(output_of([program, f"--benchmark_filter={wanted}", "--benchmark_min_time=0.1",
                                  "--benchmark_format=json"]))
    found["context"]["executable"] = program.name  # where it lay is nobody's business
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("release", type=pathlib.Path)
    parser.add_argument("unit_tests", type=pathlib.Path)
    parser.add_argument("output", type=pathlib.Path)
    parser.add_argument("--software", action="store_true", help="on the CPU, by Mesa's llvmpipe or zink")
    options = parser.parse_args()
    kind = "software" if options.software else "hardware"
    isoshift = options.release / "cli" / "isoshift"
    devices = output_of([isoshift, "inspect", "--devices"]).splitlines()
    line = next(line for line in devices if line.startswith(f"OpenGL, {kind}: "))
    if ": none; " in line:
        sys.exit(f"error: {line}\n       ./dev gpu OUTPUT.json --software measures Mesa on the CPU instead")
    result = {"is_gpu": not options.software, "device": line.split(": ", 1)[1],
              "program": output_of([isoshift, "--version"]).strip(),
              "made": time.strftime("%Y-%m-%dT%H:%M:%S%z"), "machine": machine(devices), "seconds": {}}
    steps = {"tests": lambda: tests(options.unit_tests, kind), "table1": lambda: table1(isoshift, kind),
             "benchmarks": lambda: benchmarks(options.release / "bench" / "isoshift_bench", kind)}
    status = 0
    for name, step in steps.items():
        print(f"{time.strftime('%T')} {name}", file=sys.stderr, flush=True)
        begin = time.monotonic()
        try:
            result[name] = step()
        except (OSError, subprocess.SubprocessError) as error:
            result[name] = {"error": str(error)}
            status = 1
        result["seconds"][name] = round(time.monotonic() - begin, 1)
        partial = options.output.with_suffix(".partial")
        partial.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        partial.replace(options.output)
    if result["tests"].get("failed"):
        print("failed: " + ", ".join(result["tests"]["failed"]), file=sys.stderr)
        status = 1
    print(f"{options.output}: {result['device']}", file=sys.stderr)
    sys.exit(status)


if __name__ == "__main__":
    main()
