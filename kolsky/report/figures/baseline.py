"""A quasi-static baseline: tests, mean, the material's curve with its band, and the apparent modulus."""

from kolsky.material.curves.uniaxial import gaussian_strain
from kolsky.material.reference_curve import ReferenceCurve
from kolsky.report.figures.base import BAND, GREY, MEASURED, MODEL, PAGE, FigureKind, Panels, letter

KPA = 1e-3
"""Factor from Pa to kPa."""


def caption(made: ReferenceCurve) -> str:
    """What is seen."""
    corrected = "" if made.friction is None else ", their mean (dashed) and the curve without end friction"
    return (
        f"(a) Nominal stress against nominal strain of {len(made.tests)} tests (grey){corrected}, with its"
        " k = 2 band. (b) Apparent modulus of Gaussian rubber elasticity, Eq. (M.9), likewise."
    )


def draw(made: ReferenceCurve, panels: Panels) -> None:
    """Draw the tests, the mean, the material's curve and its modulus."""
    left, right = panels["curve"], panels["modulus"]
    for number, one in enumerate(made.tests):
        test = one.test
        left.plot(test.strain, KPA * test.stress, color=GREY, lw=0.5, label="" if number else "tests")
    band, modulus = made.band, made.modulus
    if made.friction is not None:
        gaussian = gaussian_strain(band.strain, compression=made.compression)
        as_measured = 3.0 * made.apparent.stress / gaussian
        for ax, value in ((left, made.apparent.stress), (right, as_measured)):
            ax.plot(band.strain, KPA * value, "--", color=MODEL, lw=1.0, label="as if frictionless")
    for ax, (low, high), value in (
        (left, band.interval(), band.stress),
        (right, modulus.interval(), modulus.modulus),
    ):
        ax.fill_between(band.strain, KPA * low, KPA * high, color=BAND, alpha=0.4, lw=0.0, label="k = 2")
        ax.plot(band.strain, KPA * value, color=MEASURED, lw=1.0, label="material")
    side = "compressive" if made.compression else "tensile"
    left.set(xlabel=f"Nominal {side} strain [–]", ylabel="Nominal stress [kPa]")
    right.set(xlabel=f"Nominal {side} strain [–]", ylabel="$E_a$ [kPa]")
    left.set(
        xlim=(0.0, 1.02 * float(band.strain[-1])), ylim=(0.0, 1.1 * KPA * float(made.apparent.stress[-1]))
    )
    right.set(xlim=left.get_xlim(), ylim=(0.0, 1.05 * right.dataLim.y1))
    left.legend(loc="upper left")
    letter(left, "a")
    letter(right, "b")


KIND: FigureKind[ReferenceCurve] = FigureKind(
    name="baseline",
    width=PAGE,
    height=lambda made: 70.0,
    caption=caption,
    panels=lambda made: [["curve", "modulus"]],
    draw=draw,
)
