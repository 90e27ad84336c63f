"""Write docs/validation/healing.md: tables of a self-healing actuator, recomputed from their printed
values."""

from pathlib import Path

import numpy as np

from explicit.materials import LAWS
from explicit.materials.volumetric import VolumetricLaw
from kolsky.material.fits.compare import Stability, drucker
from kolsky.material.fits.homogeneous import Mode, compressible_stress, free_stretch

ROOT = Path(__file__).resolve().parents[2]
TABLE_3 = {
    "E (MPa)": (0.68, 0.70, 0.01, 103),
    "C10 (MPa)": (0.109, 0.107, 0.03, None),
    "D1 (1/MPa)": (1.150, 1.153, 0.02, None),
    "fracture stress (kPa)": (316.0, 304.0, 4.0, 96),
    "fracture strain (%)": (128.0, 117.0, 2.0, 91),
}
"""Property -> undamaged, healed, RMSE, healing efficiency [%] as printed in Table 3 and in the text."""
TABLE_2 = {"Ogden N = 1": (0.256, 0.019), "Neo-Hookean": (0.248, 0.018)}
"""Law -> norm of residuals, root mean square error, as printed [MPa]."""


def points(norm: float, rmse: float) -> tuple[float, float]:
    """Least and largest number of points with which norm = rmse sqrt(n), both rounded to three decimals."""
    half = 0.0005
    return ((norm - half) / (rmse + half)) ** 2, ((norm + half) / (rmse - half)) ** 2


def ratio_at_rest(C10: float, D1: float) -> float:
    """Poisson's ratio of mu = 2 C10 and K = 2 / D1."""
    mu, bulk = 2.0 * C10, 2.0 / D1
    return (3.0 * bulk - 2.0 * mu) / (6.0 * bulk + 2.0 * mu)


def nominal(C10: float, D1: float, strain: float) -> float:
    """Nominal stress of the printed constants in tension with free sides [MPa]."""
    law, volume = LAWS["neo_hookean"](2e6 * C10), VolumetricLaw(2e6 / D1)
    return 1e-6 * float(compressible_stress(law, volume, Mode.UNIAXIAL, 1.0 + strain))


def narrowing(C10: float, D1: float, strain: float) -> float:
    """Side stretch of the same solid [-]."""
    law, volume = LAWS["neo_hookean"](2e6 * C10), VolumetricLaw(2e6 / D1)
    return float(free_stretch(law, volume, Mode.UNIAXIAL, 1.0 + strain))


def initial_modulus(C10: float, D1: float, upto: float = 0.05) -> float:
    """Slope of the regression line of these stresses from 0 to 5 % [MPa]."""
    e = np.linspace(1e-4, upto, 51)
    return float(np.polyfit(e, [nominal(C10, D1, x) for x in e], 1)[0])


def table_3() -> str:
    """Efficiencies recomputed."""
    rows = ["| property | undamaged | healed | RMSE | efficiency | printed |", "| --- |" + " --- |" * 5]
    for name, (before, after, rmse, printed) in TABLE_3.items():
        said = "" if printed is None else f"{printed} %"
        rows.append(
            f"| {name} | {before:g} | {after:g} | {rmse:g} | {100.0 * after / before:.1f} % | {said} |"
        )
    return "\n".join(rows)


def page() -> str:
    """The page's text."""
    C10, D1 = TABLE_3["C10 (MPa)"][0], TABLE_3["D1 (1/MPa)"][0]
    h10, h1 = TABLE_3["C10 (MPa)"][1], TABLE_3["D1 (1/MPa)"][1]
    stable = all(path.outcome is Stability.STABLE for path in drucker(LAWS["neo_hookean"](2e6 * C10)))
    counts = {name: points(*row) for name, row in TABLE_2.items()}
    low, high = max(c[0] for c in counts.values()), min(c[1] for c in counts.values())
    at_break = 1e3 * nominal(C10, D1, 1.28)
    ogden, neo = counts["Ogden N = 1"], counts["Neo-Hookean"]
    E, healed_E = initial_modulus(C10, D1), initial_modulus(h10, h1)
    words = "No contradiction." if low <= high else "A contradiction."
    truth = "true" if stable else "not so"
    return f"""# Healing efficiencies: Tables 1 to 3 of a self-healing actuator

Terryn and others fit the tensile tests of a self-healing elastomer. They cut specimens in half, heal them
for 40 min at 80 °C and test them again. The measured curves are not published.
`python tests/validation/healing_page.py` computes this page from the printed numbers.
`kolsky material healing` ({{doc}}`../howto/material_fit`) makes such a table from curves, with the
uncertainty of every efficiency. `tests/unit/cli/test_healing_command.py` tests this command with planted
constants and fractures.

## Table 1: laws and stability

- The sentence "Neo-Hookean: stable for all strains" is {truth}, by Drucker's criterion between principal
  stretches of a tenth and ten. The paper states that Mooney-Rivlin, Ogden of two terms and Yeoh are unstable
  beyond 75, 58 and 89 %. Their constants are not printed, so this cannot be checked.
- The volumetric terms of Yeoh's law are printed with exponents 4, 4 and 6. They should be 2, 4 and 6.
- Ogden's energy is printed with µ/α. With the constants of Table 2 it must be 2µ/α² ({{doc}}`materials`).

## Table 2: norm of residuals and RMSE

Both laws were fitted to the same points, and the norm is RMSE times the root of their number. The printed,
rounded values require {ogden[0]:.0f} to {ogden[1]:.0f} points (Ogden) and {neo[0]:.0f} to {neo[1]:.0f}
(neo-Hookean). Both are satisfied with {np.ceil(low):.0f} to {np.floor(high):.0f}. {words}

## Table 3: recovery

{table_3()}

- The efficiencies of E, of stress and of strain agree with the printed ones. Those of the constants are not
  printed.
- The unit of D₁ is printed as MPa. It is 1/MPa, because K = 2/D₁ = {2.0 / D1:.2f} MPa gives the
  measured ν = {ratio_at_rest(C10, D1):.3f} (healed: {ratio_at_rest(h10, h1):.3f}).
- **One undamaged specimen** was tested. The scatter of undamaged specimens is therefore unknown, and no
  efficiency has an interval. The column RMSE is that of the healed ones. In this case
  `kolsky material healing` prints the reason instead of an uncertainty.
- An RMSE of 0.03 MPa for C₁₀ is {100 * 0.03 / h10:.0f} % of it, while E and the fracture stress scatter by
  {100 * 0.01 / 0.70:.1f} and {100 * 4 / 304:.1f} %. A neo-Hookean stress is proportional to C₁₀, so the
  RMSE cannot be the scatter of C₁₀ between these specimens.
- E by regression from 0 to 5 % is {E:.3f} MPa for the undamaged constants and {healed_E:.3f} MPa for the
  healed ones. The measured values are 0.68 and 0.70 MPa. By the constants the healed material is
  {100 * (1 - healed_E / E):.0f} % softer, by the regression 3 % stiffer.
- **At fracture** (128 %) the undamaged constants give {at_break:.0f} kPa with free sides (side stretch
  {narrowing(C10, D1, 1.28):.3f}). The measured value is 316 kPa. The difference is {at_break - 316.0:+.0f}
  kPa, {abs(at_break - 316.0) / 18.0:.1f} times the RMSE of the fit. The constants were fitted with the
  assumption ε₂ = −0.44 ε₁ for the sides ({{doc}}`materials`).
"""


def main() -> None:
    """Write the page."""
    (ROOT / "docs" / "validation" / "healing.md").write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
