"""`python -m tests.readme_figures RESULT.h5`: do README's picture and its last line agree with a result?

`.ci/run` calls it with the result of `kolsky identify runs/open-05`, so both are always up to date. Exit 1 if
they differ. `--write` makes a new picture.
"""

import argparse
import re
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "images" / "open-05-force.svg"
LINE = 0.5
"""Largest difference of a curve [pt]: half a line's width; other processors differ in the last digits."""
NAMES = {"m": "stiffness_factor", "ν": "poisson", "β": "damping"}
FACTORS = {"damping": 1e6}
"""Shown number over SI."""


def curves(svg: str) -> list[np.ndarray]:
    """Coordinates of every path [pt], in the order of the file."""
    found = re.findall(r'<path[^>]* d="([^"]*)"', svg)
    return [np.array(re.findall(r"-?\d+\.?\d*", path), dtype=np.float64) for path in found]


def picture_differs(shipped: str, made: str) -> str:
    """How two pictures differ; empty if they show the same."""
    old, new = curves(shipped), curves(made)
    if [len(path) for path in old] != [len(path) for path in new]:
        return f"the pictures have other curves: {len(old)} paths are shipped, {len(new)} made"
    worst = max(float(np.abs(a - b).max()) for a, b in zip(old, new, strict=True) if len(a))
    return f"a curve lies {worst:.2f} pt elsewhere, {LINE} are allowed" if worst > LINE else ""


def numbers_differ(readme: str, intervals: Mapping[str, tuple[float, float]]) -> str:
    """Which numbers of README's line of the shipped test are not those of a result; empty if none."""
    (line,) = (line for line in readme.splitlines() if line.startswith("| the shipped test"))
    for symbol, name in NAMES.items():
        value, half = re.findall(rf"{symbol}\*? (\d+\.\d+) ± (\d+\.\d+)", line)[0]
        factor, (low, high) = FACTORS.get(name, 1.0), intervals[name]
        last = 10.0 ** -len(half.partition(".")[2])  # a step of the last digit shown
        shown = 0.5 * factor * (low + high), 0.5 * factor * (high - low)
        for text, number in zip((value, half), shown, strict=True):
            if abs(float(text) - number) > 1.01 * last:
                return f"{name}: README has {value} ± {half}, the result {shown[0]:.8g} ± {shown[1]:.2g}"
    return ""


def main(words: list[str]) -> int:
    """Compare, or write."""
    from kolsky.report.canvas import save_figures
    from kolsky.report.figures import REGISTRY
    from kolsky.results.hdf5 import read_identification

    parser = argparse.ArgumentParser(prog="python -m tests.readme_figures", description=__doc__)
    parser.add_argument("result", type=Path)
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args(words)
    found = read_identification(options.result)
    with tempfile.TemporaryDirectory() as scratch:
        force = {"force": REGISTRY["force"]}
        (path,) = save_figures(Path(scratch), found, formats=("svg",), registry=force)
        made = path.read_text("utf-8")
    if options.write:
        PICTURE.write_text(made, encoding="utf-8")
    intervals = {name: estimate.interval for name, estimate in found.estimates.items()}
    faults = [
        picture_differs(PICTURE.read_text("utf-8"), made),
        numbers_differ((ROOT / "README.md").read_text("utf-8"), intervals),
    ]
    print("\n".join(filter(None, faults)) or "README's picture and numbers are those of the result")
    return int(any(faults))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
