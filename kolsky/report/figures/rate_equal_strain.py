"""Shape and force of the shots at equal strain (Figs. 13 and 14 of Mates et al. 2012)."""

import numpy as np

from kolsky.report.figures.base import GREY, MEASURED, MM, PAGE, FigureKind, Panels, letter, say_empty
from kolsky.report.figures.rate_stiffness import COLOURS, MARKERS
from kolsky.report.labels import shortened
from kolsky.studies.rates.records import GroupRates


def caption(group: GroupRates) -> str:
    """What is seen."""
    assert group.equal_strain is not None  # `applies` saw to it
    strains = ", ".join(f"{e:g}" for e in group.equal_strain.strains)
    return (
        "Left: transmitted force against nominal strain, bin means of every counted shot (lines), its values"
        " at the strains compared (markers), and the quasi-static stress times the undeformed area, as of a"
        " specimen that stays a cylinder (dashed). Waves, inertia and the held faces are in the shots’"
        " forces: the distance between the lines is no rate sensitivity."
        f" Right: outlines in the frames nearest to the strains {strains}, measured (markers) and simulated"
        " (lines)."
    )


def draw(group: GroupRates, panels: Panels) -> None:
    """Draw force and shape."""
    e = group.equal_strain
    assert e is not None  # `applies` saw to it
    force, shape = panels["force"], panels["shape"]
    letter(force, "a")
    letter(shape, "b")
    for number, shot in enumerate(group.counted):
        colour, marker = COLOURS[number % len(COLOURS)], MARKERS[number % len(MARKERS)]
        c, h = shot.found.comparison, shot.history
        inside = (c.force_time >= h.time[0]) & (c.force_time <= h.time[-1])
        strain = np.interp(c.force_time[inside], h.time, h.strain)
        label = f"{shortened(shot.name, 20)}, {h.nominal_rate:.3g} 1/s"
        force.plot(strain, c.force_measured[inside], color=colour, lw=0.7, label=label)
        force.plot(e.strains, e.force[number], marker, color=colour, ms=3.0, mec="white", mew=0.4)
        for outline in (s for s in e.shapes if s.shot == shot.name):
            shape.plot(MM * outline.y, MM * outline.model, color=colour, lw=0.5)
            shape.plot(MM * outline.y, MM * outline.Z, marker, color=colour, ms=1.8, mew=0.0)
    force.plot(
        e.baseline_strain,
        e.baseline_force,
        "--",
        color=MEASURED,
        lw=0.9,
        label="quasi-static × area",
        zorder=5,
    )
    for strain in e.strains:
        force.axvline(strain, color=GREY, lw=0.3)
    force.set(xlabel="Nominal strain (–)", ylabel="Force $F$ (N)")
    shape.set(xlabel="Height $y$ (mm)", ylabel="Radius $Z$ (mm)")
    force.legend(loc="upper left")
    if not e.shapes:
        say_empty(shape, "no outline was measured")
    for strain in e.strains:
        here = [s for s in e.shapes if s.strain == strain]
        if here:
            last = max(here, key=lambda s: s.y[-1])
            shape.annotate(
                f"{strain:g}",
                (MM * last.y[-1], MM * last.Z[-1]),
                xytext=(3, 0),
                textcoords="offset points",
                va="center",
                color=GREY,
                annotation_clip=False,
            )


KIND: FigureKind[GroupRates] = FigureKind(
    name="rate-equal-strain",
    width=PAGE,
    height=lambda group: 72.0,
    caption=caption,
    panels=lambda group: [["force", "shape"]],
    draw=draw,
    applies=lambda group: group.equal_strain is not None,
)
