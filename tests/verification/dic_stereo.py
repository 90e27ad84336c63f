"""Stereo match of a rendered cylinder: the page; its runs are in `dic_stereo_runs`."""

import numpy as np
from dic_stereo_runs import ANGLES, DRAWS, JUDGED, PUSHED, STEEPEST, SUBSETS, Result, case
from matplotlib.figure import Figure
from scene import table
from stereo_scene import NOISE, RADIUS

from dic.correlation import Shape

__all__ = ["FIGURE_SIZE", "TITLE", "Result", "case", "draw", "page", "row"]

TITLE = "Stereo match of a cylinder"
FIGURE_SIZE = (6.7, 3.0)
BIAS = 0.5e-6
"""Allowed mean distance from the cylinder with quadratic shape functions, subsets of 21 px and more [m]."""
SAGITTA = 0.05
"""Allowed relative distance of the affine bias from the mean sagitta: speckles weigh the places of a subset
by their gradients, one way or the other."""
SCALED = (0.8, 1.25)
"""Allowed error over sigma, 12.5°, quadratic: subsets overlap, some fifty are independent."""
HEAD = [
    "angle [°]",
    "shape",
    "subset [px]",
    "accepted [%]",
    "bias [µm]",
    "mean sagitta [µm]",
    "scatter [µm]",
    "error/sigma",
]


def sagitta(width: float) -> float:
    """Mean distance of a cylinder from the tangent at the middle of a strip of this width [m]."""
    return width**2 / (24.0 * RADIUS)


def row(result: Result) -> tuple[str, str, str]:
    """Line of the index: what is compared, what was measured, what is allowed."""
    large = [e.bias for (_, shape, n), e in result.errors.items() if shape is Shape.QUADRATIC and n >= 21]
    scaled = [e.scaled for (a, s, _), e in result.errors.items() if s is Shape.QUADRATIC and a == ANGLES[0]]
    passed = sum(false.passed for false in result.false.values())
    number = sum(false.number for false in result.false.values())
    return (
        "rendered cylinder against its rays: mean distance, quadratic, 21 px and more; error over sigma;"
        " false matches that pass",
        f"{1e6 * np.abs(large).max():.2f} µm; {min(scaled):.2f} to {max(scaled):.2f}; {passed} of {number}",
        f"{1e6 * BIAS:g} µm; {SCALED[0]:g} to {SCALED[1]:g}; 0",
    )


def draw(result: Result, figure: Figure) -> None:
    """Left: mean distance of the matched points from the cylinder by the square of the subset's side on the
    surface; dashed: minus the mean sagitta, closed form. Right: share of the false matches that each gate
    stops by itself."""
    left, right = figure.subplots(1, 2)
    colours = dict(zip(ANGLES, ("C0", "C1"), strict=True))
    for angle in ANGLES:
        for shape, marker in ((Shape.AFFINE, "o"), (Shape.QUADRATIC, "s")):
            found = [result.errors[angle, shape, n] for n in SUBSETS]
            left.plot(
                [1e6 * e.width**2 for e in found],
                [1e6 * e.bias for e in found],
                marker,
                color=colours[angle],
                mfc=colours[angle] if shape is Shape.AFFINE else "white",
                label=f"{shape.name.lower()}, {angle:g}°",
            )
    w = np.linspace(0.0, result.errors[ANGLES[0], Shape.AFFINE, SUBSETS[-1]].width, 50)
    left.plot(1e6 * w**2, [-1e6 * sagitta(x) for x in w], "k--", label=r"$-w^2/24R$")
    left.set(xlabel="square of the subset's side $w^2$ [mm²]", ylabel="distance from the cylinder [µm]")
    left.legend(loc="lower left")
    x = np.arange(len(JUDGED))
    for angle, shift in zip(ANGLES, (-0.2, 0.2), strict=True):
        false = result.false[angle]
        share = [100 * false.caught[gate] / false.number for gate in JUDGED]
        right.bar(x + shift, share, width=0.38, color=colours[angle], label=f"{angle:g}°")
    right.set_xticks(x, [gate.name.lower().replace("_", "\n") for gate in JUDGED], rotation=30)
    right.set(ylabel="false matches stopped [%]", ylim=(0.0, 118.0), yticks=np.arange(0.0, 101.0, 20.0))
    right.legend(loc="upper left", ncols=2)


def page(result: Result) -> str:
    """The page's text."""
    lines = [
        [
            f"{angle:g}",
            shape.name.lower(),
            str(n),
            f"{100 * e.accepted:.0f}",
            f"{1e6 * e.bias:+.2f}",
            f"{-1e6 * sagitta(e.width):.2f}",
            f"{1e6 * e.scatter:.2f}",
            f"{e.scaled:.2f}",
        ]
        for (angle, shape, n), e in result.errors.items()
    ]
    gates = [
        [f"{angle:g}", gate.name.lower().replace("_", " "), str(false.caught[gate]), str(false.without[gate])]
        for angle, false in result.false.items()
        for gate in JUDGED
    ]
    counts = "; ".join(
        f"{angle:g}°: {false.number} false matches, {false.passed} pass,"
        f" {false.true_rejected} of {false.true} true ones are stopped"
        for angle, false in result.false.items()
    )
    accepted, tried = result.other_surface
    return f"""# {TITLE}

**What is checked.** {{py:func}}`dic.stereo.match.match_stereo` finds the points of camera 0 in camera 1 on a
surface that curves, says how far off they are, and accepts no false one ({{doc}}`../theory/stereo_matching`).

**Independent source.** `speckle_pictures.py` cuts every ray of both cameras with the cylinder and never
warps a picture; where camera 1 sees a pixel of camera 0 follows from the same rays. Subsets of an affine
shape function lie on the mean of the cylinder over their width w, $w^2/24R$ below their middle.

**Set-up.** 128 × 128 px, {5400 * 1e-3 / (0.3 - RADIUS):.1f} px/mm, R = {1e3 * RADIUS:g} mm, cameras
{ANGLES[0]:g}° and {ANGLES[1]:g}° apart with distorted lenses, speckles of 0.35 mm, noise {100 * NOISE:g} % of
the range from black to white. Points whose whole subset lies in both pictures; errors of those seen at less
than {STEEPEST:g}°.

{table(HEAD, lines)}

At 18 px/mm an affine shape function is too stiff for any subset: quadratic ones of 21 to 31 px have no bias
to speak of and less scatter than affine ones have bias.

**False matches.** Accepted matches are pushed along their epipolar lines by {PUSHED[0]:g} to {PUSHED[1]:g} px
and matched again, any correlation allowed ({DRAWS} rounds with a third of the points, their neighbours true).
Those that converge more than 1 px from the truth are judged. {counts}.

{table(["angle [°]", "gate", "stopped by it", "pass without it"], gates)}

With other speckles in camera 1, every point a seed and every correlation allowed, {accepted} of {tried}
points are accepted.

**Tolerance.** Bias {1e6 * BIAS:g} µm: the noise of a mean, and the fourth order of the cylinder. The affine
bias must be the mean sagitta within {100 * SAGITTA:g} %. Error over sigma {SCALED[0]:g} to {SCALED[1]:g} at
{ANGLES[0]:g}°. At {ANGLES[1]:g}° the flanks are foreshortened by a half, and what a quadratic function leaves
of them shows beside a noise of a few thousandths of a pixel. No false match may pass, with any one gate
taken away neither.
"""
