"""Legends that lie on data are moved to a free place.

Everything is in pixels of the figure's canvas. Data are lines, markers, bars, the edges of bands and
contours; what fills a whole panel (a picture, a map, a shaded window) and guides that run from side to side
are not.
"""

from collections.abc import Iterator
from typing import Literal

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import Collection, PathCollection, QuadMesh
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.transforms import Bbox

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

    ``figure``: laid out, its axes are where they will be drawn. Returns: true if an axis has new limits, so
    that the figure must be laid out again. A legend beside its panel stays there.
    """
    changed = False
    for ax in figure.axes:
        legend = ax.get_legend()
        if legend is None or legend.get_bbox_to_anchor().bounds != ax.bbox.bounds:
            continue
        if _covers(legend, ax) and not _move(legend, ax):
            changed |= _room_above(legend, ax)
    return changed


def _move(legend: Legend, ax: Axes) -> bool:
    """Put a legend to the first free place; leave it if there is none."""
    before = legend._loc_real  # type: ignore[attr-defined]  # Matplotlib has no public way to read it
    for place in PLACES:
        legend.set_loc(place)
        if not _covers(legend, ax):
            return True
    legend.set_loc(before)
    return False


def _room_above(legend: Legend, ax: Axes) -> bool:
    """Raise the upper limit of the y axis until a legend at the top is free; put it back if it never is."""
    if ax.images:
        return False
    before, scale = ax.get_ylim(), ax.yaxis.get_transform()
    low, high = scale.transform(np.array(before))
    for share in np.arange(ROOM, MOST_ROOM + 0.5 * ROOM, ROOM):
        ax.set_ylim(before[0], float(scale.inverted().transform(np.array([high + share * (high - low)]))[0]))
        if _move(legend, ax):
            return True
    ax.set_ylim(before)
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
    """True if data of a panel are inside a box; what is drawn is clipped at the panel."""
    inside = Bbox.intersection(box.padded(-TOUCH), ax.bbox)
    if inside is None:
        return False
    drawn = [artist for artist in (*ax.lines, *ax.collections) if artist.get_visible()]
    bars = [bar for bars in ax.containers for bar in bars if hasattr(bar, "xy")]
    return any(_meets(path, joined, inside) for one in drawn for path, joined in _paths(one, ax)) or any(
        _shared(inside, bar.get_window_extent()) for bar in bars
    )


def _paths(artist: Artist, ax: Axes) -> Iterator[tuple[Path, bool]]:
    """Lines of an artist in pixels, with True, and its points, with False."""
    if isinstance(artist, QuadMesh):
        return  # it fills the panel
    if isinstance(artist, PathCollection) and len(artist.get_paths()) <= 1:
        places = np.ma.filled(np.ma.asarray(artist.get_offsets(), dtype=np.float64), np.nan)
        if len(places):
            yield Path(artist.get_offset_transform().transform(places)), False
            return
    transform = artist.get_transform()
    if not all(transform.contains_branch_seperately(ax.transData)):
        return  # a guide from side to side
    if isinstance(artist, Collection):
        yield from ((path.transformed(transform), True) for path in artist.get_paths())
        return
    assert isinstance(artist, Line2D)
    path = artist.get_path().transformed(transform)
    if artist.get_linestyle() not in ("None", "", " "):
        yield path, True
    if artist.get_marker() not in ("None", "", " ", None):
        yield path, False


def _meets(path: Path, joined: bool, box: Bbox) -> bool:
    """True if a line crosses a box, or one of its points is inside if they are not joined."""
    vertices = np.asarray(path.vertices, dtype=np.float64)
    if not joined:
        x, y = vertices.T
        return bool(np.any((x > box.x0) & (x < box.x1) & (y > box.y0) & (y < box.y1)))
    if not np.isfinite(vertices).all():
        path = path.cleaned(remove_nans=True)
    return bool(len(vertices)) and bool(path.intersects_bbox(box, filled=False))
