#!/usr/bin/env python3
"""Fails if docs/evaluation.md lacks a row of `isoshift evaluate` as bench/results/evaluation.json has it."""

import json
import sys

import documented_rows


def share(of, runs):
    return f"{of}/{runs}"


def errors(summary):
    if summary["successes"] == 0:
        return "- | - | - | -"
    mtre = summary["mtre_mm"]
    return f"{mtre['mean']:.2f} +/- {mtre['sd']:.2f} | {mtre['median']:.2f} | {summary['mpd_mm']:.2f} | {summary['mrpd_mm']:.2f}"


def row(case, summary):
    """A row of "Baseline" and "Preset setup"."""
    has_failures = summary["successes"] < summary["runs"]
    near, far = summary["within_1_mm"], summary["beyond_2_mm"]
    return (f"| {case} | {share(summary['successes'], summary['runs'])} | {errors(summary)} | {summary['capture_range_mm']} "
            f"| {format(100 * summary['rotation_share_of_failures'], '.0f') + ' %' if has_failures else '-'} "
            f"| {share(near['accepted'], near['runs'])} | {share(far['accepted'], far['runs'])} | {summary['mean_evaluations']:.0f} |")


def row_of_target(case, summary):
    """A row of the studies in which bodies answer."""
    target = summary["target"]
    return (f"| {case} | {summary['runs']} | {target['median_mm']:.2f} | {share(target['within_1_mm'], summary['runs'])} "
            f"| {share(target['within_1_mm_accepted'], target['within_1_mm'])} | {target['beyond_2_mm_accepted']} |")


def row_of_sigmas(words, key, summaries):
    """A row of "Uncertainty": the share of axes, of all successes together. The shares of a summary are of its runs with
    a sigma, which are all of them here."""
    runs = sum(summary["runs"] for summary in summaries)
    axes = [sum(summary[key][axis] * summary["runs"] for summary in summaries) / runs for axis in range(6)]
    return f"| {words} | " + " | ".join(f"{100 * value:.0f} %" for value in axes + [sum(axes) / 6]) + " |"


def main():
    results = json.loads((documented_rows.ROOT / "bench/results/evaluation.json").read_text())
    rows = [row(case, summary) for part in ("baseline", "setup", "gpu") for case, summary in results[part].items()]
    rows += [row_of_target(case, summary) for case, summary in results["targets"].items()]
    rows += [row_of_sigmas(f"within {number} sigma", f"share_within_{number}_sigma", results["setup"].values())
             for number in ("one", "two")]
    return documented_rows.compare("docs/evaluation.md", rows)


if __name__ == "__main__":
    sys.exit(main())
