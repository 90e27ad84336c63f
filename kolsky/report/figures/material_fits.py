"""Homogeneous tests and the laws fitted to them, a panel for each mode."""

from kolsky.material.fits.compare import Comparison, Row
from kolsky.material.fits.modes import Mode
from kolsky.report.figures.base import GREY, MEASURED, PAGE, FigureKind, Panels, letter
from kolsky.report.figures.waves import stress_scale

MOST_LAWS = 5
"""Curves of one panel; more cannot be told apart."""
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1)))
MARKERS = ("o", "s", "^", "D", "v")


def shown(comparison: Comparison) -> list[Row]:
    """The laws to draw: least AIC first, one of a kind that gives the same curve."""
    chosen: list[Row] = []
    for row in comparison.rows:
        # The same error to six digits is the same curve under another name.
        if row.fit is not None and all(
            other.fit is None or abs(row.fit.rmse - other.fit.rmse) > 1e-6 * row.fit.rmse for other in chosen
        ):
            chosen.append(row)
    return chosen[:MOST_LAWS]


def modes(comparison: Comparison) -> list[Mode]:
    """The modes that were tested."""
    return [mode for mode in Mode if any(test.mode is mode for test in comparison.tests)]


def caption(comparison: Comparison) -> str:
    """What is seen."""
    count = sum(row.fit is not None for row in comparison.rows)
    return (
        f"Nominal stress of {len(comparison.tests)} tests (black) and of the {len(shown(comparison))} laws "
        f"of least AIC among {count}, fitted to all tests at once."
    )


def draw(comparison: Comparison, panels: Panels) -> None:
    """Draw every test and the best laws."""
    for number, (mode, ax) in enumerate(zip(modes(comparison), panels.values(), strict=True)):
        if len(panels) > 1:
            letter(ax, "abcd"[number])
        tests = [k for k, test in enumerate(comparison.tests) if test.mode is mode]
        factor, unit = stress_scale(
            max((comparison.tests[k].stress for k in tests), key=lambda s: abs(s).max())
        )
        ax.axhline(0.0, color=GREY, lw=0.4)
        for place, k in enumerate(tests):
            test = comparison.tests[k]
            ax.plot(
                test.deformation,
                factor * test.stress,
                MARKERS[place % len(MARKERS)],
                ms=2.5,
                mfc="none",
                mew=0.5,
                color=MEASURED,
                markevery=max(1, len(test.stress) // 40),
                label="measured" if place == 0 else "",
            )
        for row, colour, dashes in zip(shown(comparison), COLOURS, DASHES, strict=False):
            assert row.fit is not None
            for place, k in enumerate(tests):
                part = row.fit.parts[k]
                order = part.test.deformation.argsort()
                ax.plot(
                    part.test.deformation[order],
                    factor * part.predicted[order],
                    linestyle=dashes,
                    color=colour,
                    lw=0.9,
                    label=row.candidate.name.replace("_", " ") if place == 0 else "",
                )
        ax.set_xlabel("Amount of shear (–)" if mode is Mode.SIMPLE_SHEAR else "Stretch (–)")
        ax.set_ylabel(f"Nominal stress ({unit})")
        ax.set_title(mode.value)
        if number == 0:
            ax.legend(loc="best")


KIND: FigureKind[Comparison] = FigureKind(
    name="material-fits",
    width=PAGE,
    height=lambda comparison: 65.0 if len(modes(comparison)) < 4 else 120.0,
    caption=caption,
    panels=lambda comparison: _mosaic([mode.value for mode in modes(comparison)]),
    draw=draw,
)


def _mosaic(names: list[str]) -> list[list[str]]:
    return [names] if len(names) < 4 else [names[:2], names[2:]]
