"""Write the numbers and figures of the verification manual: `python tests/verification/pages.py [topic ...]`.

A topic is a module in this folder. Its test, page and figure use the same `case()`, so they cannot disagree.
The module offers

- `case() -> Result`, the numbers and curves (cached);
- optionally `shown(result)`, further names for the page;
- optionally `draw(result, figure)` and `FIGURE_SIZE` [inch].

Its page is docs/verification/TOPIC.md, its line of the index stands in docs/verification/index.md. There
``{{ expression:format }}`` is a number or a table. Its names are those of the module, `result` and what
`shown` returns (tests/helpers/page_values.py).
"""

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
for folder in (ROOT, HERE.parent / "helpers"):  # the packages, and tests/helpers
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import matplotlib  # noqa: E402
import numpy as np  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter  # noqa: E402
from page_values import made_tables, store  # noqa: E402
from scene import table  # noqa: E402

DOCS = ROOT / "docs" / "verification"
STYLE = ROOT / "kolsky" / "report" / "kolsky.mplstyle"

TOPICS = made_tables.TOPIC.findall((DOCS / "index.md").read_text("utf-8"))
"""Modules of the manual, in its order."""

PAGE_WIDTH = 6.7  # width of a figure [inch]: the text column of the manual
ON_SCREEN = {
    "font.size": 8.5, "axes.labelsize": 8.5, "axes.titlesize": 8.5, "xtick.labelsize": 8,
    "ytick.labelsize": 8, "legend.fontsize": 7.5, "lines.linewidth": 1.1, "lines.markersize": 4,
    "figure.constrained_layout.w_pad": 0.05, "figure.constrained_layout.wspace": 0.04,
}  # fmt: skip
"""The report's style is set for print; a page is read on a screen."""


def tidy(axes: Axes) -> None:
    """Write the ticks of logarithmic axes as plain numbers, unless the topic chose its ticks."""
    for axis, limits in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        chosen = isinstance(axis.get_major_locator(), FixedLocator)
        if axis.get_scale() != "log" or chosen:
            continue
        axis.set_minor_formatter(NullFormatter())
        if limits[1] / limits[0] < 200.0:
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            if limits[0] > 1e-4:
                axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def draw(topic: ModuleType, result: Any, path: Path) -> None:
    """Draw a topic's figure in the manual's style and save it; the same bits for the same result."""
    with matplotlib.rc_context(fname=STYLE):
        matplotlib.rcParams.update(ON_SCREEN)
        figure = Figure(figsize=getattr(topic, "FIGURE_SIZE", (PAGE_WIDTH, 2.9)), layout="constrained")
        topic.draw(result, figure)
        for axes in figure.get_axes():
            if axes.get_title():
                raise ValueError(f"{topic.__name__}.draw: {axes.get_title()!r} belongs in the caption")
            tidy(axes)
        figure.savefig(path, metadata={"Date": None})  # inside: "C0" and the like are looked up when drawn


def write(name: str) -> None:
    """Run a topic, draw its figure and store the numbers of its page and of its line of the index."""
    topic = import_module(f"test_{name}")
    result = topic.case()
    if hasattr(topic, "draw"):
        draw(topic, result, DOCS / "images" / f"{name}.svg")
    names = {"np": np, "table": table, **vars(topic), "result": result}
    names |= topic.shown(result) if hasattr(topic, "shown") else {}
    store(DOCS / f"{name}.md", names)


def main(names: list[str]) -> None:
    """Write the named topics, or all of them."""
    unknown = [name for name in names if name not in TOPICS]
    if unknown:
        raise SystemExit(f"unknown topic {unknown[0]!r}; topics are {', '.join(TOPICS)}")
    for name in names or TOPICS:
        write(name)


if __name__ == "__main__":
    main(sys.argv[1:])
