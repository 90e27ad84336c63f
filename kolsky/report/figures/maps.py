"""A quantity over time and height, as a map with its colour bar; no figure of its own."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from kolsky.report.figures.base import MM, MS, largest, smooth_bar
from kolsky.studies.local_sensitivity import ObservationGrid


def draw_map(
    ax: Axes, grid: ObservationGrid, values: NDArray[np.float64], label: str, *, bottom: float | None = None
) -> None:
    """Draw values of shape [n_frames, n_heights], NaN where there is none.

    Parameters
    ----------
    ax
        Where.
    grid
        Times and heights.
    values
        What, in the unit of the label.
    label
        Of the colour bar.
    bottom
        Smallest value of a one-sided scale; without it the scale is symmetric about zero.
    """
    top = largest(values)
    shown = np.ma.masked_invalid(values.T)
    drawn = ax.pcolormesh(
        MS * grid.frames,
        MM * grid.heights,
        shown,
        cmap="RdBu_r" if bottom is None else "cividis",
        vmin=-top if bottom is None else bottom,
        vmax=top,
        shading="nearest",
        rasterized=True,
    )
    ax.set(xlabel="Time (ms)", ylabel="Height $y$ (mm)", ylim=(0.0, MM * grid.heights[-1]))
    # Few ticks: more of them as the axes shrink would have longer labels than the layout reckoned with.
    ticks = MaxNLocator(4)
    bar = ax.figure.colorbar(drawn, ax=ax, aspect=25, pad=0.02, ticks=ticks)  # type: ignore[union-attr]
    bar.set_label(label)
    smooth_bar(bar)
