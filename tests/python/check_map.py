"""Runs the Python blocks of docs/map.md as they are printed there, and checks their results against map.csv.

The page is named on the command line; the working folder has map.parquet and map.csv of the same map.
"""

import csv
import re
import sys
from collections import Counter
from math import isnan

with open("map.csv") as file:
    cells = list(csv.DictReader(file))
square = [cell for cell in cells if cell["waveform"] == "square" and cell["start"] == "given"]


def number(text):
    return float(text) if text else None


def check_pandas(block):
    exponent = block["exponent"]
    assert exponent.size == len(square)
    for cell in square:
        read = exponent.loc[float(cell["dither_amplitude_v"]), float(cell["wheel_speed_rpm"])]
        assert (None if isnan(read) else read) == number(cell["exponent_per_s"]), cell


def check_polars(block):
    greatest = {}
    for cell in square:
        speed, extent = float(cell["wheel_speed_rpm"]), number(cell["yaw_rate_peak_to_peak_rad_per_s"])
        greatest[speed] = max([known for known in (greatest.get(speed), extent) if known is not None], default=None)
    assert dict(block["greatest"].iter_rows()) == greatest


def check_duckdb(block):
    counted = Counter((cell["waveform"], cell["kind"]) for cell in cells)
    assert {(waveform, kind): count for waveform, kind, count in block["regimes"]} == counted


def check_units(block):
    rows = re.findall(r"^\| `(\w+)` \| ([^ |]*) *\|", page, re.MULTILINE)
    assert [name for name, _ in rows] == list(cells[0])
    assert block["units"] == {name: unit for name, unit in rows if unit}


with open(sys.argv[1]) as file:
    page = file.read()
blocks = re.findall(r"^```python\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
checks = {
    "import pandas": check_pandas,
    "import polars": check_polars,
    "import duckdb": check_duckdb,
    "import pyarrow": check_units,
}
assert len(blocks) == len(checks), f"{len(blocks)} blocks"
for text, (start, check) in zip(blocks, checks.items()):
    assert text.startswith(start), text
    results = {}
    exec(text, results)
    check(results)
