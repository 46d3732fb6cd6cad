#!/usr/bin/env python3
"""Draws how the time of DRRs grows, as SVG: with pixels, with random pixels and with the path, and for `cpu` also with
the poses, views, bodies, voxels and threads of a call.

    build/release/bench/isoshift_bench --benchmark_filter='pixels|percent|path|in_a_call|bodies|along|threads' \\
        --benchmark_repetitions=5 --benchmark_out=scaling.json --benchmark_out_format=json
    bench/plot_scaling.py scaling.json cpu docs/pictures/scaling-cpu.svg
"""
import json
import sys

PANELS = [
    ("pixels_along_an_edge", "pixels of the image, 1000", lambda value: value * value / 1000),
    ("percent_of_the_pixels", "random pixels of 512 x 512, 1000", lambda value: value / 100 * 512 * 512 / 1000),
    ("mm_of_path", "path through water, voxels of 1 mm", lambda value: value),
]
# Of `cpu` alone; 5 % of 512 x 512 pixels.
GROWTH = [
    ("poses_in_a_call", "poses", lambda value: value),
    ("views_in_a_call", "views", lambda value: value),
    ("bodies_of_a_patient", "bodies, with derivatives", lambda value: value),
    ("voxels_along_an_edge", "voxels along an edge of a cube of 192 mm", lambda value: value),
    ("threads", "1 / threads (2 views, 16 poses)", lambda value: 1 / value),
]
PER_ROW = 4
WIDTH, HEIGHT, LEFT, TOP, GAP = 260, 200, 60, 30, 80
ROW = HEIGHT + 60


def points(report, family, renderer, scale):
    """(x, ms) of one family, in rising order; of repetitions the fastest, because others use the machine too."""
    found = {}
    for run in report["benchmarks"]:
        name = run["name"].split("/")
        if name[0] != family or "error_occurred" in run or run.get("run_type") == "aggregate":
            continue
        if name[1] == renderer:
            found.setdefault(scale(float(name[2])), []).append(run["real_time"])
        elif name[1].isdigit():  # a family of `cpu` alone
            found.setdefault(scale(float(name[1])), []).append(run["real_time"])
    return [(x, min(times)) for x, times in sorted(found.items())]


def line_through(data):
    """Slope and offset by least squares, and R^2."""
    mean_x = sum(x for x, _ in data) / len(data)
    mean_y = sum(y for _, y in data) / len(data)
    slope = sum((x - mean_x) * (y - mean_y) for x, y in data) / sum((x - mean_x) ** 2 for x, _ in data)
    offset = mean_y - slope * mean_x
    residual = sum((y - offset - slope * x) ** 2 for x, y in data)
    return slope, offset, 1 - residual / sum((y - mean_y) ** 2 for _, y in data)


def panel(left, top, data, label):
    top_x, top_y = 1.05 * max(x for x, _ in data), 1.1 * max(y for _, y in data)
    slope, offset, r2 = line_through(data)
    place = lambda x, y: (left + x / top_x * WIDTH, top + HEIGHT - y / top_y * HEIGHT)
    svg = [f'<rect x="{left}" y="{top}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#888"/>']
    for n in range(5):
        x, y = place(top_x * n / 4, top_y * n / 4)
        svg.append(f'<text x="{x:.0f}" y="{top + HEIGHT + 16}" text-anchor="middle">{top_x * n / 4:.4g}</text>')
        svg.append(f'<text x="{left - 6}" y="{y + 4:.0f}" text-anchor="end">{top_y * n / 4:.1f}</text>')
    (x0, y0), (x1, y1) = place(max(0, -offset / slope), max(0, offset)), place(top_x, offset + slope * top_x)
    svg.append(f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{max(y1, top):.1f}" stroke="#c60" stroke-dasharray="4 3"/>')
    for x, y in data:
        px, py = place(x, y)
        svg.append(f'<circle cx="{px:.1f}" cy="{py:.1f}" r="3.5" fill="#246"/>')
    svg.append(f'<text x="{left + WIDTH / 2}" y="{top + HEIGHT + 34}" text-anchor="middle">{label}</text>')
    if len(data) > 2:
        svg.append(f'<text x="{left + 8}" y="{top + 16}">line: R&#178; = {r2:.4f}</text>')
    return svg


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    report = json.load(open(sys.argv[1], encoding="utf-8"))
    svg = []
    panels = PANELS + (GROWTH if sys.argv[2] == "cpu" else [])
    for n, (family, label, scale) in enumerate(panels):
        data = points(report, family, sys.argv[2], scale)
        if len(data) < 2:
            sys.exit(f"error: {sys.argv[1]} holds {len(data)} runs of {family}/{sys.argv[2]}; at least 2 are needed")
        svg += panel(LEFT + n % PER_ROW * (WIDTH + GAP), TOP + n // PER_ROW * ROW, data, label)
    width = LEFT + min(len(panels), PER_ROW) * (WIDTH + GAP) - GAP + 20
    height = TOP + ((len(panels) - 1) // PER_ROW) * ROW + HEIGHT + 50
    with open(sys.argv[3], "w", encoding="utf-8") as out:
        out.write(f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
                  f'font-family="sans-serif" font-size="12">\n<rect width="100%" height="100%" fill="white"/>\n'
                  f'<text x="{LEFT}" y="18">{sys.argv[2]}: ms per call</text>\n' + "\n".join(svg) + "\n</svg>\n")


if __name__ == "__main__":
    main()
