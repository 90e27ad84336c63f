"""Write the numbers of docs/validation/healing.md: printed tables of a healing actuator, recomputed."""

import sys
from pathlib import Path

import numpy as np

from explicit.materials import LAWS
from explicit.materials.volumetric import VolumetricLaw
from kolsky.material.fits.compare import Stability, drucker
from kolsky.material.fits.homogeneous import Mode, compressible_stress, free_stretch

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests" / "helpers"))
from page_values import store  # noqa: E402

PAGE = ROOT / "docs" / "validation" / "healing.md"
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


def shown() -> dict[str, object]:
    """Further names of the page."""
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
    return locals()


if __name__ == "__main__":
    store(PAGE, globals() | shown())
