"""The flyer's flight: strain rate, strain and direction of the velocity, as the paper's Fig. 6."""

import numpy as np

from kolsky.bars.flyer.flight_report import FlightOfSpecimen
from kolsky.report.figures.base import BAND, COLUMN, MEASURED, MODEL, MS, SHAPE, FigureKind, Panels, letter

COVERAGE = 2.0
"""Half width of the bands in standard uncertainties."""


def caption(shown: FlightOfSpecimen) -> str:
    """What is seen."""
    text = (
        "(a) Nominal strain of the specimen and its rate, from the flyer's path. (b) Angle between the "
        "flyer's velocity and the compression axis. (c) Rotation of the flyer about x and Z. Bands: two "
        "standard uncertainties."
    )
    return text if shown.end is None else f"{text} Dotted: symmetry ends."


def draw(shown: FlightOfSpecimen, panels: Panels) -> None:
    """Draw strain and rate, the angle, the tilt."""
    t, path = shown.time, shown.flight.toward
    ms = MS * t
    ax = panels["motion"]
    rate, spread = path.velocity(t) / shown.length, path.sigma_velocity(t) / shown.length
    ax.fill_between(ms, rate - COVERAGE * spread, rate + COVERAGE * spread, color=BAND, alpha=0.5, lw=0.0)
    ax.plot(ms, rate, color=SHAPE, label="strain rate")
    ax.set_ylabel("Nominal strain rate (1/s)")
    ax.set_ylim(0.0, 1.25 * float(rate.max()))
    other = ax.twinx()
    other.plot(ms, path.position(t) / shown.length, "--", color=MODEL, label="strain")
    other.set_ylabel("Nominal strain (1)")
    other.set_ylim(0.0, 1.0)
    other.tick_params(axis="x", labelbottom=False)
    lines = [*ax.get_lines(), *other.get_lines()]
    ax.legend(lines, [str(line.get_label()) for line in lines], loc="upper left", ncols=2)

    ax = panels["angle"]
    known = shown.known
    angle, spread = (np.degrees(values[known]) for values in shown.flight.orientation(t))
    ax.fill_between(
        ms[known],
        np.maximum(angle - COVERAGE * spread, 0.0),
        angle + COVERAGE * spread,
        color=BAND,
        alpha=0.5,
        lw=0.0,
    )
    ax.plot(ms[known], angle, color=MEASURED)
    firm = (angle + COVERAGE * spread)[spread < np.degrees(0.1)]
    ax.set_ylim(0.0, 1.1 * float(firm.max() if firm.size else 90.0) + 0.2)
    ax.set_ylabel(r"Angle $\varphi$ (°)")

    ax = panels["tilt"]
    tilt, spread = (values[known] for values in shown.flight.tilt(t))
    for k, (name, colour, style) in enumerate((("about $x$", SHAPE, "-"), ("about $Z$", MODEL, "--"))):
        low, high = (1e3 * (tilt[:, k] + side * COVERAGE * spread[:, k]) for side in (-1.0, 1.0))
        ax.fill_between(ms[known], low, high, color=colour, alpha=0.2, lw=0.0)
        ax.plot(ms[known], 1e3 * tilt[:, k], style, color=colour, label=name)
    ax.set_ylabel("Rotation (mrad)")
    ax.set_xlabel("Time (ms)")
    ax.margins(y=0.25)  # room for the legend
    ax.legend(loc="lower left", ncols=2)
    for mark, name in zip("abc", ("motion", "angle", "tilt"), strict=True):
        letter(panels[name], mark)
        panels[name].set_xlim(ms[0], ms[-1])
        if name != "tilt":
            panels[name].tick_params(labelbottom=False)
        if shown.end is not None:
            panels[name].axvline(MS * shown.end, color=MEASURED, ls=":")


KIND: FigureKind[FlightOfSpecimen] = FigureKind(
    name="flight",
    width=COLUMN,
    height=lambda shown: 130.0,
    caption=caption,
    panels=lambda shown: [["motion"], ["angle"], ["tilt"]],
    draw=draw,
)
