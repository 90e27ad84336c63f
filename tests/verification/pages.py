"""Write the verification manual: `python tests/verification/pages.py [topic ...]`.

A topic is a module in this folder. Its test, page and figure use the same `case()`, so they cannot disagree.
The module offers

- `TITLE`, and optionally `FIGURE_SIZE` [inch];
- `case() -> Result`, the numbers and curves (cached);
- `row(result) -> (compared, measured, allowed)`, its line of the index;
- optionally `draw(result, figure)`, whose docstring is the caption;
- `page(result) -> str`, the MyST text that starts with ``# TITLE``.

Pages and figures are committed; this program overwrites them. The index is written when every topic runs.
"""

import sys
from importlib import import_module
from inspect import cleandoc
from pathlib import Path
from types import ModuleType
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
for folder in (ROOT, HERE.parent / "helpers"):  # the packages, and tests/helpers/order.py
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import matplotlib  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter  # noqa: E402

DOCS = ROOT / "docs" / "verification"
STYLE = ROOT / "kolsky" / "report" / "kolsky.mplstyle"

TOPICS = [
    "patch", "marlow", "frictionless", "static_bonded", "dynamic_bonded", "waves", "bar", "elastic_bar",
    "dispersion", "separation", "impact", "soft_forces", "contact_limits", "friction", "energy", "time_order",
    "space_order", "fbar", "which_element", "incompressible", "equilibrium", "viscoelastic", "batch",
    "failure", "dic_correlation", "dic_tracking", "renderer", "dic_stereo", "uncertainty",
]  # fmt: skip
"""Modules of the manual, in its order."""

PAGE_WIDTH = 6.7
"""Width of a figure [inch]: the text column of the manual."""
ON_SCREEN = {
    "font.size": 8.5, "axes.labelsize": 8.5, "axes.titlesize": 8.5, "xtick.labelsize": 8,
    "ytick.labelsize": 8, "legend.fontsize": 7.5, "lines.linewidth": 1.1, "lines.markersize": 4,
    "figure.constrained_layout.w_pad": 0.05, "figure.constrained_layout.wspace": 0.04,
}  # fmt: skip
"""The report's style is set for print; a page is read on a screen."""

INDEX = """# Verification manual

Does the solver solve its equations? Each topic compares it with an independent source: a closed form, a
conservation law, the theoretical order of convergence, or another program. Every figure in the table is
asserted by the test of the same name in `tests/verification`, which calls the same function as the page.

| topic | what is compared | measured | tolerance |
| --- | --- | --- | --- |
{rows}

`python tests/verification/pages.py` runs every case again and rewrites these pages (a few minutes on two
cores). `pytest -m verification` tests all of them, the slow ones too, in less than ten minutes;
`pytest tests/verification` runs the quick ones.
"""


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


def text(topic: ModuleType, result: Any) -> str:
    """A topic's page: its text, its figure, and where it comes from."""
    name = topic.__name__.removeprefix("test_")
    body = topic.page(result).strip()
    if not body.startswith(f"# {topic.TITLE}\n"):
        raise ValueError(f"{name}.page must start with '# {topic.TITLE}', got {body.splitlines()[0]!r}")
    figure = ""
    if hasattr(topic, "draw"):
        caption = " ".join(cleandoc(topic.draw.__doc__ or "").split())
        if not caption:
            raise ValueError(f"{name}.draw needs a docstring: it is the figure's caption")
        head = f"```{{figure}} images/{name}.svg\n:width: 100%\n:alt: {topic.TITLE}"
        figure = f"{head}\n\n{caption}\n```\n\n"
    return f"""{body}

{figure}Test: `tests/verification/test_{name}.py`. Generated by `python tests/verification/pages.py {name}`.
"""


def write(name: str) -> tuple[str, str, str, str]:
    """Run a topic, write its page and figure, and return its line of the index."""
    topic = import_module(f"test_{name}")
    result = topic.case()
    compared, measured, allowed = topic.row(result)
    if hasattr(topic, "draw"):
        (DOCS / "images").mkdir(parents=True, exist_ok=True)
        draw(topic, result, DOCS / "images" / f"{name}.svg")
    (DOCS / f"{name}.md").write_text(text(topic, result), encoding="utf-8")
    return f"[{topic.TITLE}]({name}.md)", compared, measured, allowed


def main(names: list[str]) -> None:
    """Write the named topics, or all of them and the index."""
    unknown = [name for name in names if name not in TOPICS]
    if unknown:
        raise SystemExit(f"unknown topic {unknown[0]!r}; topics are {', '.join(TOPICS)}")
    rows = []
    for name in names or TOPICS:
        rows.append(write(name))
        print(f"docs/verification/{name}.md")
    if not names:
        lines = "\n".join("| " + " | ".join(row) + " |" for row in rows)
        (DOCS / "index.md").write_text(INDEX.format(rows=lines, topics="\n".join(TOPICS)), encoding="utf-8")
        print("docs/verification/index.md")


if __name__ == "__main__":
    main(sys.argv[1:])
