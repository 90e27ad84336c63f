"""Write the validation page on laws of soft materials: `python tests/validation/materials_page.py`.

Page and `test_soft_laws.py` call the same functions of `softlaws`. The data are from other authors, in a
folder `shared` next to the repository.
"""

import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parent.parent
for folder in (TESTS.parent, TESTS / "helpers", TESTS / "validation"):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import numpy as np  # noqa: E402
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
PAGE = """# Laws fitted to silicones and rubbers

This page compares fits of `kolsky.material` ({{ref}}`theory-homogeneous`) to homogeneous tests of other
laboratories with the published fits. `python tests/validation/materials_page.py` writes this page.
`pytest --long tests/validation/test_soft_laws.py` tests its numbers. The data are not part of the project.

## Four silicones in compression

The tissue phantom database of Dawood and others
(github.com/abubakardawood/tissue-phantom-material-database, data CC BY 4.0) has ten compression tests to
66.7 % of each of four silicones. Eleven laws are fitted to the mean at 1000 strains by least squares in
engineering stress. Their Ogden terms are µ/α (…), and their Yeoh law of one term is the neo-Hookean law.
Their Mooney-Rivlin law of second order has C10, C01 and C20 (`mooney_rivlin_c20` here). Their
Veronda-Westmann and Humphrey laws are those of {{ref}}`theory-materials`. For all {count} fits, these laws
with *their* constants give their sums of squares within {own:.0e}. Laws, curve and mean are therefore the
same.

The table gives the sums of squares of the fits here (those of the database are 1). Ogden's terms are fitted
with positive moduli, as in the database. The other laws are fitted without the bounds of a positive energy,
because some published constants are outside these bounds.

{phantoms}

Every sum of squares here agrees with the published one to four digits or is smaller. If the minimum is
unique, constants agree within {constants:.1e} of their value. Their two-term Ogden fit of EF50_0T ended
with two equal terms. With twelve starts the sum of squares is a fourth of theirs. With positive moduli a
third term does not improve the fit. Two of the three exponents become equal, and the outcome is *not
determined*. With moduli of either sign, two terms fit {free_low:.0f} to {free_high:.0f} times better than
theirs. Each of these fits has a negative modulus, so the energy can become negative. {free_words} between
principal stretches of a tenth and ten.

## Rubber in three modes together

The table compares constants published for *one* mode of Treloar's data with the fit of that mode here:

{single}

The neo-Hookean constant of tension and the two constants of equibiaxial tension agree within the difference
of two digitisations of one figure. The published neo-Hookean constants of equibiaxial and planar tension do
not minimise the squares of these data, in absolute or in relative stress.

The next tables have unweighted fits of all three modes together. They give the root mean square residual in
kPa and, in brackets, that of residual over measured stress. The laws are in the order of their AIC.
"Drucker" is the first mode, by logarithmic strain, in which the law is not stable
({{py:mod}}`kolsky.material.fits.compare`).

{rubbers}

```{{figure}} images/materials-treloar.png
:width: 100%
:alt: Treloar's three tests and the five best laws

{caption}
```

No law of I₁ only fits tension and equibiaxial tension of natural rubber together, as Treloar (1975) found.
Three terms of Ogden fit both. For Meunier's silicone a law of I₁ only (Yeoh) fits nearly as well. For
Kawabata's and Meunier's digitised tests no published constants of the same laws are available.

## Errors in two papers

These errors were found by computing the tables again. The tests check the arithmetic.

*Characterisation of soft tissue* (thesis, Section 3.2.1, Tables 3.3 and 3.4).

{thesis}

- Eq. (3.3) has C₁₀ instead of 2 C₁₀, which Eqs. (3.4) to (3.9) use. Eq. (3.8) divides the transverse stress
  by the axial stretch. Eq. (3.9) is nevertheless correct.
- E₀ of three rows is 3 µ₀ only with digits that are not printed.
- **One R² is impossible.** √(1 − R²) is a distance of curves divided by the spread of
  the data. By the triangle inequality each value lies in an interval about that of the best law, for any
  data (last two columns). The curve of the Mooney-Rivlin constants is close to that of the reduced
  polynomial, so its R² must be above {least_r2:.4f}.
- "Stable for all strains" is true of all four, between principal stretches of a tenth and ten.

*Self-healing pneumatic actuator* (Table 2).

- µ₀ = 2 C₁₀ = 0.218 MPa and µ₁ = 0.218 MPa agree if the Ogden law has 2µ/α² before its bracket. Table 1 of
  the text has µ/α. With it µ₀ would be 1.4 % lower. K = 2 / D₁ of both gives the measured ν = 0.44.
- The transverse strain is assumed as ε₂ = −νε₁ up to ε₁ = 1.28. This gives J = {J:.3f}. The specimen would
  have lost {lost:.0f} % of its volume. With the constants of the paper the free sides would then carry
  {across:.2f} MPa (true stress, tension-positive). The axial true stress would be {along:.2f} MPa instead of
  {right:.2f} MPa. {{py:func}}`kolsky.material.fits.homogeneous.free_stretch` finds the stretch that leaves
  the sides free.
- The second invariant is printed with a plus sign, ½ [(tr B)² + tr B²]. It should be a minus sign.
"""


def main() -> None:
    """Write the page and its figure."""
    treloar = compared("Treloar 1944")
    figure = build(MATERIALS["material-fits"], treloar)
    (DOCS / "images").mkdir(exist_ok=True)
    figure.savefig(DOCS / "images" / "materials-treloar.png", dpi=200, metadata={"Software": None})
    low, high, words = without_bounds()
    J, across, along, right = side_stress_of_the_linear_rule()
    text = PAGE.format(
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
    (DOCS / "materials.md").write_text(text, encoding="utf-8")


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
                "*published:* Ogden 1972",
                "6",
                f"{3e-3 * OGDEN_1972.shear_modulus:.4g}",
                *cells,
                "",
                "unstable",
            ]
        )
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
                name,
                f"{mu:.1f}, {E:.1f}",
                f"{law.shear_modulus:.1f}, {3.0 * law.shear_modulus:.1f}",
                f"{r2:.5f}",
                possible,
            ]
        )
    return table(rows)


def table(rows: list[list[str]]) -> str:
    """A table in Markdown."""
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


if __name__ == "__main__":
    main()
