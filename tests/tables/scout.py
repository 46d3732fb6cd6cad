"""The table of docs/commands/scout.md."""

from markdown import json_of, table


def measured():
    axes = json_of("scout/head.json")["axes"]

    def cells(name, unit):
        axis = axes[name.replace(" ", "_").replace("_the_", "_")]
        return [name, f"{axis['offset_' + unit]:+.2f} {unit}", f"{2 * axis['sigma_' + unit]:.2f} {unit}",
                f"{axis['repeatability_' + unit]:.3f} {unit}"]

    return table(["axis", "offset", "two sigma", "repeatability"],
                 [cells("posterior", "mm"), cells("superior", "mm"), cells("about the left", "deg")])


TABLES = [("What was measured", measured)]
