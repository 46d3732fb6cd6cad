"""The tables of docs/python.md."""

from markdown import json_of, table, words


def batches():
    return table(["poses at once", "C++, ms", "Python, ms", "Python / C++"],
                 [[batch["poses"], f"{1e3 * batch['cpp_s']:.1f}", f"{1e3 * batch['python_s']:.1f}", f"{batch['ratio']:.3f}"]
                  for batch in json_of("python-batches-2-cores.json")["batches"]])


TABLES = [("isoshift in Python", words("| what | how |")), ("Speed", batches)]
