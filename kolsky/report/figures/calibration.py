"""Figures of a stereo calibration: residuals over the images, residuals of every pair."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from kolsky.report.figures.base import COLUMN, GREY, MEASURED, MODEL, PAGE, SHAPE, Panels, figure

if TYPE_CHECKING:
    from dic.calibration.views import Calibration


COLOURS = (SHAPE, MODEL)
"""Of camera 0 and camera 1."""


def _length(result: Calibration) -> float:
    """A round length near twice the rms residual [px]."""
    size = 2.0 * max(result.rms, 1e-12)
    power = 10.0 ** np.floor(np.log10(size))
    return float(power * min((1.0, 2.0, 5.0, 10.0), key=lambda step: abs(step * power - size)))


def _height(result: Calibration) -> float:
    columns, rows = result.rig.cameras[0].sensor or (1, 1)
    return 16.0 + COLUMN * 0.88 * rows / columns


@figure(PAGE, _height, [["camera 0", "camera 1"]], letters=True)
def calibration_residuals(result: Calibration, panels: Panels) -> str:
    key = _length(result)
    for camera, colour in enumerate(COLOURS):
        ax = panels[f"camera {camera}"]
        views = [pair.views[camera] for pair in result.pairs if pair.outcome.used]
        valid = [view for view in views if view is not None]
        places = np.concatenate([view.pixels[view.used] for view in valid])
        vectors = np.concatenate([view.residual[view.used] for view in valid])
        columns, rows = result.rig.cameras[camera].sensor or tuple(places.max(axis=0))
        arrows = ax.quiver(
            *places.T, *vectors.T, color=colour, angles="xy", units="width", width=0.0013, alpha=0.8,
            scale=key / (0.06 * columns), scale_units="xy", headwidth=3.0, headlength=4.0, headaxislength=3.6,
        )  # fmt: skip
        ax.quiverkey(
            arrows, 0.88, 1.045, key, f"{key:g} px", labelpos="W", labelsep=0.06, coordinates="axes",
            fontproperties={"size": "small"},
        )  # fmt: skip
        ax.set_aspect("equal")
        ax.set_xlim(0, columns)
        ax.set_ylim(rows, 0)
        ax.set_xlabel("$x$ (px)")
        if camera == 0:
            ax.set_ylabel("$y$ (px)")
        else:
            ax.tick_params(labelleft=False)
        ax.set_title(f"camera {camera}", fontsize="small", pad=3.0)
    return (
        "Residuals of all points used, measured minus expected, where the two cameras saw them; their "
        f"rms is {result.rms:.3g} px. Vectors that agree with their neighbours would show too simple a "
        "lens model or a wrong target."
    )


NAMED = 30
"""Up to this number of pairs, each pair has its name on the axis."""


@figure(PAGE, 60.0, [["pairs", "distribution"]], width_ratios=[1.6, 1.0], letters=True)
def calibration_pairs(result: Calibration, panels: Panels) -> str:
    ax = panels["pairs"]
    values = []
    for camera, (colour, shift) in enumerate(zip(COLOURS, (-0.16, 0.16), strict=True)):
        for used, mark in ((True, "os"[camera]), (False, "x")):
            rows = [
                (k + shift, view.rms)
                for k, pair in enumerate(result.pairs)
                if pair.outcome.used is used and (view := pair.views[camera]) is not None
            ]
            if rows:
                label = f"camera {camera}" if used else f"camera {camera}, left out"
                edge = 0.8 if mark == "x" else 0.0
                ax.plot(*np.array(rows).T, mark, color=colour, ms=3.5, mew=edge, label=label)
                values += [value for _, value in rows]
    ax.axhline(result.rms, color=GREY, lw=0.8, zorder=0)
    if max(values) > 10.0 * max(min(values), 1e-12):
        ax.set_yscale("log")
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_minor_formatter(NullFormatter())
        ax.set_ylim(0.5 * min(values), 30.0 * max(values))  # room for the legend
    else:
        ax.set_ylim(0.0, 1.45 * max(values))
    ax.set(xlabel="Pair", ylabel="Rms residual (px)", xlim=(-0.7, len(result.pairs) - 0.3))
    names = [pair.name for pair in result.pairs]
    if len(names) <= NAMED:
        ax.set_xticks(
            range(len(names)), names, fontsize="x-small", rotation=0 if max(map(len, names)) < 3 else 90
        )
        ax.tick_params(axis="x", which="minor", bottom=False, top=False)
    else:
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.legend(loc="upper right", ncols=2)

    ax = panels["distribution"]
    edges = np.linspace(-4.0, 4.0, 41)
    for camera, colour in enumerate(COLOURS):
        scaled = [
            (view.residual / (result.unit * view.sigma[:, None]))[view.used].ravel()
            for pair in result.pairs
            if pair.outcome.used and (view := pair.views[camera]) is not None
        ]
        style: dict[str, Any] = {"color": colour, "label": f"camera {camera}"}
        ax.hist(np.concatenate(scaled), edges.tolist(), density=True, histtype="step", **style)
    z = np.linspace(-4.0, 4.0, 201)
    ax.plot(z, np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi), "--", color=MEASURED, lw=0.8, label="normal")
    ax.set(xlabel="Residual / $σ$", ylabel="Density", xlim=(-4.0, 4.0))
    ax.set_ylim(0.0, 1.35 * ax.get_ylim()[1])
    ax.legend(loc="upper right")
    bad = [pair.name for pair in result.rejected if np.isfinite(pair.rms)]
    crossed = f" Crosses: pairs left out ({', '.join(bad)})." if bad else ""
    return (
        f"(a) Rms residual of each picture; line: of all that were used.{crossed} (b) Residuals along x and "
        "y over their standard deviation, with the normal distribution."
    )
