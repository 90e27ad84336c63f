"""The centre line through time: as the camera saw it, and as a radius."""

import numpy as np
from matplotlib.collections import PolyCollection

from kolsky.report.figures.base import MM, MODEL, MS, PAGE, FigureKind, Panels, letter, smooth_bar
from kolsky.report.view import SurfaceView


def caption(view: SurfaceView) -> str:
    """What is seen."""
    return (
        "Kymograph of the centre line. (a) One column of camera 0's pictures through time, and the rows "
        "in which the points nearest to it were found. (b) Measured radius Z at height y above the "
        "transmission platen; white: no valid point."
    )


def draw(view: SurfaceView, panels: Panels) -> None:
    """Draw the column of all pictures, and the radius over height and time."""
    result, body = view.result, view.result.specimen
    time = MS * result.t
    half = 0.5 * float(np.median(np.diff(time)))
    ax = panels["picture"]
    rows = view.kymograph.shape[0]
    seen = view.kymograph[np.isfinite(view.kymograph)]
    low, high = np.percentile(seen, [0.5, 99.5]) if seen.size else (0.0, 1.0)
    ax.imshow(
        view.kymograph,
        cmap="gray",
        vmin=low,
        vmax=max(high, low + 1.0),
        aspect="auto",
        interpolation="none",
        extent=(time[0] - half, time[-1] + half, rows - 0.5, -0.5),
    )
    middle = np.abs(body.surface.X[:, 0])
    column = body.cell[np.argmin(middle), 0]
    for point in np.flatnonzero(body.cell[:, 0] == column):
        ax.plot(time, body.pixels[0][:, point, 1], color=MODEL, lw=0.5)
    ax.set(xlabel="Time (ms)", ylabel="Row of camera 0 (px)")
    ax.set_ylim(rows - 0.5, -0.5)
    letter(ax, "a")

    ax, line = panels["radius"], result.centre
    corners, radii = [], []
    for frame in np.unique(line.frame):
        of = line.frame == frame
        y, Z = MM * line.y[of], MM * line.Z[of]
        if y.size < 2:
            continue
        # Each point stands for the height half-way to its neighbours.
        between = 0.5 * (y[1:] + y[:-1])
        edges = np.concatenate([[2.0 * y[0] - between[0]], between, [2.0 * y[-1] - between[-1]]])
        left, right = (np.full(y.size, time[frame] + side) for side in (-half, half))
        low, high = edges[:-1], edges[1:]
        corners.append(np.stack([left, low, right, low, right, high, left, high], axis=1).reshape(-1, 4, 2))
        radii.append(Z)
    ax.set(xlabel="Time (ms)", ylabel="Height $y$ (mm)", xlim=(time[0] - half, time[-1] + half))
    if corners:
        colours = PolyCollection(
            list(np.concatenate(corners)),
            array=np.concatenate(radii),
            cmap="viridis",
            lw=0.0,
            antialiased=False,
            rasterized=True,
        )
        ax.add_collection(colours)
        ax.autoscale_view(scalex=False)
        bar = ax.figure.colorbar(colours, ax=ax, aspect=25, pad=0.02)  # type: ignore[union-attr]
        bar.set_label("Radius $Z$ (mm)")
        smooth_bar(bar)
    letter(ax, "b")


KIND: FigureKind[SurfaceView] = FigureKind(
    name="kymograph",
    width=PAGE,
    height=lambda view: 68.0,
    caption=caption,
    panels=lambda view: [["picture", "radius"]],
    draw=draw,
    applies=lambda view: view.result.centre.Z.size > 0 and view.kymograph.size > 0,
)
