"""Legends that lie on data are moved to a free place.

Everything is in pixels of the figure's canvas. Data are lines, markers, bars, the edges of bands and
contours; what fills a whole panel (a picture, a map, a shaded window) and guides that run from side to side
are not.
"""

from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import Collection, PathCollection, QuadMesh
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from kolsky.base.arrays import FloatArray

_Place = Literal["upper right", "upper left", "lower right", "lower left", "upper center", "lower center"]
PLACES: tuple[_Place, ...] = (
    "upper right",
    "upper left",
    "lower right",
    "lower left",
    "upper center",
    "lower center",
)
"""Where a legend may stand, the preferred ones first."""
ROOM, MOST_ROOM = 0.1, 0.8
"""Where none is free, the y axis gets so much of its range more at its upper end, in steps, at most."""
TOUCH = 0.5
"""Boxes that share less than this are side by side [px]."""


def free_legends(figure: Figure) -> bool:
    """Move every legend that lies on data to a free place, or make one above the data.

    Parameters
    ----------
    figure
        Laid out: its axes are where they will be drawn.

    Returns
    -------
    bool
        True if an axis has new limits, so that the figure must be laid out again.
    """
    changed = False
    for ax in figure.axes:
        legend = ax.get_legend()
        if legend is None or not _covers(legend, ax) or _move(legend, ax):
            continue
        changed |= _room_above(legend, ax)
    return changed


def _move(legend: Legend, ax: Axes) -> bool:
    """Put a legend to the first free place; leave it if there is none."""
    before = legend._loc_real  # type: ignore[attr-defined]  # Matplotlib has no public way to read it
    if legend.get_bbox_to_anchor().bounds != ax.bbox.bounds:
        return False  # it was put beside the panel or to a place of its own
    for place in PLACES:
        legend.set_loc(place)
        if not _covers(legend, ax):
            return True
    legend.set_loc(before)
    return False


def _room_above(legend: Legend, ax: Axes) -> bool:
    """Raise the upper limit of the y axis until a legend at the top is free; put all back if it never is."""
    before, place = ax.get_ylim(), legend._loc_real  # type: ignore[attr-defined]
    if legend.get_bbox_to_anchor().bounds != ax.bbox.bounds or ax.images:
        return False
    scale = ax.yaxis.get_transform()
    low, high = scale.transform(np.array(before))
    for share in np.arange(ROOM, MOST_ROOM + 0.5 * ROOM, ROOM):
        ax.set_ylim(before[0], float(scale.inverted().transform(np.array([high + share * (high - low)]))[0]))
        if _move(legend, ax):
            return True
    ax.set_ylim(before)
    legend._set_loc(place)  # type: ignore[attr-defined]
    return False


def _covers(legend: Legend, ax: Axes) -> bool:
    box = legend.get_window_extent()
    texts = [text for text in ax.texts if _shown(text)]
    return any(_shared(box, text.get_window_extent()) for text in texts) or _on_data(ax, box)


def _shown(text: Text) -> bool:
    return bool(text.get_visible() and text.get_text().strip())


def _shared(one: Bbox, other: Bbox) -> bool:
    wide = min(one.x1, other.x1) - max(one.x0, other.x0)
    high = min(one.y1, other.y1) - max(one.y0, other.y0)
    return bool(wide > TOUCH and high > TOUCH)


def _on_data(ax: Axes, box: Bbox) -> bool:
    """True if data of a panel are inside a box."""
    inner = Bbox.from_extents(box.x0 + TOUCH, box.y0 + TOUCH, box.x1 - TOUCH, box.y1 - TOUCH)
    seen = Bbox.intersection(inner, ax.bbox)  # what is drawn is clipped at the panel
    if seen is None:
        return False
    for line in ax.lines:
        if (
            line.get_visible()
            and line.get_transform().contains_branch(ax.transData)
            and _line(ax, line, seen)
        ):
            return True
    return any(_collection(one, seen) for one in ax.collections if one.get_visible()) or any(
        _shared(seen, bar.get_window_extent()) for bars in ax.containers for bar in bars if hasattr(bar, "xy")
    )


def _line(ax: Axes, line: Line2D, box: Bbox) -> bool:
    if not all(line.get_transform().contains_branch_seperately(ax.transData)):
        return False  # a guide from side to side
    path = line.get_path().transformed(line.get_transform())
    if line.get_linestyle() not in ("None", "", " ") and _crosses(path, box):
        return True
    return line.get_marker() not in ("None", "", " ", None) and _any_inside(_vertices(path), box)


def _collection(one: Collection, box: Bbox) -> bool:
    if isinstance(one, QuadMesh):
        return False  # it fills the panel
    places = np.ma.filled(np.ma.asarray(one.get_offsets(), dtype=np.float64), np.nan)
    if isinstance(one, PathCollection) and len(places) and len(one.get_paths()) <= 1:
        return _any_inside(one.get_offset_transform().transform(places), box)
    transform = one.get_transform()
    if not all(transform.contains_branch_seperately(one.axes.transData)):  # type: ignore[union-attr]
        return False
    return any(_crosses(path.transformed(transform), box) for path in one.get_paths() if len(_vertices(path)))


def _crosses(path: Path, box: Bbox) -> bool:
    if not np.isfinite(_vertices(path)).all():
        path = path.cleaned(remove_nans=True)
    return bool(path.intersects_bbox(box, filled=False))


def _vertices(path: Path) -> FloatArray:
    return np.asarray(path.vertices, dtype=np.float64)


def _any_inside(points: FloatArray, box: Bbox) -> bool:
    x, y = points[:, 0], points[:, 1]
    return bool(np.any((x > box.x0) & (x < box.x1) & (y > box.y0) & (y < box.y1)))
