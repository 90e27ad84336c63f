"""Legends, labels and numbers of axes that cover data or each other, for tests of figures."""

from collections.abc import Iterator
from itertools import pairwise

from matplotlib.axis import Axis
from matplotlib.figure import Figure

from kolsky.report.canvas import _covers, _on_data, _shared, _shown


def overlaps(figure: Figure) -> list[str]:
    """Texts: for every legend, label and number of an axis, the objects that it covers."""
    figure.draw_without_rendering()  # this sets the texts of the ticks
    found = []
    for ax in figure.axes:
        name = ax.get_label() or "a panel"
        legend = ax.get_legend()
        if legend is not None and _covers(legend, ax):
            found.append(f"{name}: the legend")
        texts = [text for text in ax.texts if _shown(text)]
        for i, text in enumerate(texts):
            box = text.get_window_extent()
            if _on_data(ax, box):
                found.append(f"{name}: the label {text.get_text()!r} on data")
            for other in texts[:i]:
                if _shared(box, other.get_window_extent()):
                    found.append(f"{name}: the labels {other.get_text()!r} and {text.get_text()!r}")
        for axis in (ax.xaxis, ax.yaxis):
            power = axis.get_offset_text()
            if _shown(power) and any(
                _shared(power.get_window_extent(), t.get_window_extent()) for t in texts
            ):
                found.append(f"{name}: the power of ten {power.get_text()}")
            found += [f"{name}: the numbers {a} and {b}" for a, b in _crowded(axis)]
    return found


def _crowded(axis: Axis) -> Iterator[tuple[str, str]]:
    """Pairs of neighbouring numbers of an axis that overlap."""
    low, high = sorted(axis.get_view_interval())
    ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
    for side in ("label1", "label2"):
        shown = [
            (text.get_window_extent(), text.get_text())
            for tick in ticks
            if low <= tick.get_loc() <= high and _shown(text := getattr(tick, side)) and tick.get_visible()
        ]
        shown.sort(key=lambda one: (one[0].x0 + one[0].x1, one[0].y0 + one[0].y1))
        for (box, said), (other, word) in pairwise(shown):
            if _shared(box, other):
                yield said, word
