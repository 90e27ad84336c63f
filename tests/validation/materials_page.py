"""Numbers and figure of the page on laws of soft materials: `python tests/validation/materials_page.py`."""

import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parent.parent
for folder in (TESTS.parent, TESTS / "helpers", TESTS / "validation"):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import numpy as np  # noqa: E402
from page_values import store  # noqa: E402
from test_soft_laws import (  # noqa: E402
    FITTED,
    KPA,
    OGDEN_1972,
    PHANTOMS,
    RUBBERS,
    STEINMANN_2012,
    THESIS,
    fitted,
    law_of,
    left_by_r_squared,
    phantom,
    predicted,
    published,
    rubber,
    side_stress_of_the_linear_rule,
    sse,
)

from kolsky.material.fits.compare import Comparison, Stability, candidates, compare_laws, drucker  # noqa: E402
from kolsky.material.fits.fit import Fit, FitOutcome, fit_law  # noqa: E402
from kolsky.material.fits.tables import failure  # noqa: E402
from kolsky.report.canvas import build  # noqa: E402
from kolsky.report.figures import MATERIALS  # noqa: E402

DOCS = TESTS.parent / "docs" / "validation"


def main() -> None:
    """Write the numbers of the page and its figure."""
    treloar = compared("Treloar 1944")
    figure = build(MATERIALS["material-fits"], treloar)
    (DOCS / "images").mkdir(exist_ok=True)
    figure.savefig(DOCS / "images" / "materials-treloar.png", dpi=200, metadata={"Software": None})
    low, high, words = without_bounds()
    J, across, along, right = side_stress_of_the_linear_rule()
    names = dict(
        own=max(abs(r - 1.0) for r in own_sums()),
        count=len(PHANTOMS) * len(FITTED),
        phantoms=phantom_table(),
        constants=largest_difference(),
        free_low=low,
        free_high=high,
        free_words=words,
        single=single_mode_table(),
        rubbers="\n\n".join(
            rubber_table(name, treloar if name == "Treloar 1944" else compared(name)) for name in RUBBERS
        ),
        caption=MATERIALS["material-fits"].caption(treloar),
        thesis=thesis_table(),
        least_r2=left_by_r_squared()["Mooney-Rivlin"][3],
        J=J,
        lost=100.0 * (1.0 - J),
        across=1e-6 * across,
        along=1e-6 * along,
        right=1e-6 * right,
    )
    store(DOCS / "materials.md", names)


def own_sums() -> list[float]:
    """Sum of squares of the published constants over the published sum."""
    return [sse(law_of(p), [phantom(m)]) / (p.sse * KPA**2) for m in PHANTOMS for p in published(m)]


def phantom_table() -> str:
    """SSE here over the database's."""
    rows = [["law there", "law here", *PHANTOMS], ["---"] * (2 + len(PHANTOMS))]
    for name, here in FITTED.items():
        cells = []
        for material in PHANTOMS:
            p = {q.name: q for q in published(material)}[name]
            found = fitted(name, material, bounded=name.startswith("Ogden"))
            ratio = found.sse / (p.sse * KPA**2)
            mark = ", not determined" if found.outcome is FitOutcome.NOT_DETERMINED else ""
            cells.append(f"{ratio:.5f}{mark}")
        rows.append([name.replace("_o", ", order "), f"`{here}`", *cells])
    return table(rows)


def largest_difference() -> float:
    """Largest relative difference of a constant from the published one, where the minimum is unique."""
    worst = 0.0
    for material in PHANTOMS:
        for p in published(material):
            if p.name == "Ogden_o3" or (material, p.name) == ("EF50_0T", "Ogden_o2"):
                continue
            ours = fitted(p.name, material, bounded=p.name.startswith("Ogden")).law
            pair = [law.constants() for law in (ours, law_of(p))]
            if p.name.startswith("Ogden"):
                pair = [x.reshape(-1, 2)[np.argsort(x.reshape(-1, 2)[:, 1])].ravel() for x in pair]
            scale = np.where(np.abs(pair[1]) > 0.0, np.abs(pair[1]), np.inf)
            worst = max(worst, float(np.max(np.abs(pair[0] - pair[1]) / scale)))
    return worst


def without_bounds() -> tuple[float, float, str]:
    """How much better two terms of Ogden fit with moduli of either sign, and what Drucker says of them."""
    gains, unstable = [], 0
    for material in PHANTOMS:
        p = {q.name: q for q in published(material)}["Ogden_o2"]
        found = fitted("Ogden_o2", material, bounded=False)
        gains.append(p.sse * KPA**2 / found.sse)
        unstable += any(path.outcome is not Stability.STABLE for path in drucker(found.law))
    return min(gains), max(gains), f"Drucker's criterion fails for {unstable} of {len(PHANTOMS)}"


def single_mode_table() -> str:
    """Published constants of one mode of Treloar's data beside those found here."""
    rows = [["mode", "law", "published (kPa)", "here (kPa)", "published SSE over that here"], ["---"] * 5]
    for mode, laws in STEINMANN_2012.items():
        tests = [test for test in rubber("Treloar 1944") if test.mode is mode]
        for name, constants in laws.items():
            tried = candidates([name])[0]
            found = fit_law(tried.law, tests, bounded=False, held=tried.held)
            here = [found.values[key] for key in found.free]
            ratio = sse(tried.law(*constants), tests) / found.sse
            kpa = [", ".join(f"{1e-3 * x:.4g}" for x in values) for values in (constants, here)]
            rows.append([mode.value, f"`{name}`", *kpa, f"{ratio:.4f}"])
    return table(rows)


def compared(name: str) -> Comparison:
    """All laws on the three modes of a rubber."""
    return compare_laws(candidates(), rubber(name))


def rubber_table(name: str, made: Comparison) -> str:
    """Errors by law and mode."""
    heads = [test.mode.value for test in made.tests]
    rows = [["law", "free", "E₀ (kPa)", *heads, "R²", "Drucker"], ["---"] * (5 + len(heads))]
    for row in made.rows:
        if row.fit is not None:
            rows.append([_law(row.candidate.name, row.fit), *_errors(row.fit), failure(row)])
    if name == "Treloar 1944":
        cells = []
        for test in made.tests:
            r = predicted(OGDEN_1972, test) - test.stress
            relative = np.sqrt(np.mean((r / test.stress) ** 2))
            cells.append(f"{1e-3 * np.sqrt(np.mean(r**2)):.3g} ({100.0 * relative:.2g} %)")
        rows.append(
            ["*published:* Ogden 1972", "6", f"{3e-3 * OGDEN_1972.shear_modulus:.4g}", *cells, "", "stable"]
            if all(path.outcome is Stability.STABLE for path in drucker(OGDEN_1972))
            else [
                "*published:* Ogden 1972", "6", f"{3e-3 * OGDEN_1972.shear_modulus:.4g}", *cells, "",
                "unstable",
            ]
        )  # fmt: skip
    best = "none" if made.best is None else f"`{made.best.candidate.name}`"
    points = ", ".join(f"{len(t.stress)} {t.mode.value}" for t in made.tests)
    return f"**{name}** ({points} points; least BIC of those determined and stable: {best})\n\n{table(rows)}"


def _law(name: str, f: Fit) -> str:
    state = "" if f.outcome is FitOutcome.DETERMINED else f" ({f.outcome.value})"
    return f"`{name}`{state}"


def _errors(f: Fit) -> list[str]:
    errors = [f"{1e-3 * p.rmse:.3g} ({100.0 * p.relative_rms:.2g} %)" for p in f.parts]
    return [str(len(f.free)), f"{1e-3 * f.youngs_modulus:.4g}", *errors, f"{f.r_squared:.4f}"]


def thesis_table() -> str:
    """The thesis' two tables recomputed."""
    heads = ["law", "µ₀, E₀ printed (Pa)", "recomputed (Pa)", "R² printed", "R² possible"]
    rows = [heads, ["---"] * len(heads)]
    for name, (_, low, high, _) in left_by_r_squared().items():
        law, mu, E, r2 = THESIS[name]
        possible = f"{1.0 - high**2:.5f} to {1.0 - low**2:.5f}"
        rows.append(
            [
                name, f"{mu:.1f}, {E:.1f}", f"{law.shear_modulus:.1f}, {3.0 * law.shear_modulus:.1f}",
                f"{r2:.5f}", possible,
            ]
        )  # fmt: skip
    return table(rows)


def table(rows: list[list[str]]) -> str:
    """A table in Markdown."""
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


if __name__ == "__main__":
    main()
