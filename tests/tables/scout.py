"""The table of docs/commands/scout.md."""

from markdown import json_of, table


def measured():
    """A row of every axis that is seen."""

    def cells(key, axis):
        unit = "mm" if "offset_mm" in axis else "deg"
        name = key.replace("_", " ").replace("about left", "about the left")
        return [name, f"{axis['offset_' + unit]:+.2f} {unit}", f"{2 * axis['sigma_' + unit]:.2f} {unit}",
                f"{axis['repeatability_' + unit]:.3f} {unit}"]

    axes = json_of("scout/head.json")["axes"]
    return table(["axis", "offset", "two sigma", "repeatability"],
                 [cells(key, axis) for key, axis in axes.items() if axis["is_seen"]])


TABLES = [("What was measured", measured)]
