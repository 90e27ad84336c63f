"""Other people's homogeneous tests of rubber, and what they published of laws fitted to them."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from explicit.materials import LAWS, AnyLaw
from explicit.materials.volumetric import VolumetricLaw
from kolsky.material.fits.compare import Candidate, candidates
from kolsky.material.fits.fit import Fit, fit_law
from kolsky.material.fits.homogeneous import Mode, compressible_stress, free_stretch, incompressible_stress
from kolsky.material.fits.homogeneous_test import HomogeneousTest, mean_test
from kolsky.readers.measured_tables import WantedColumn, read_columns

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data" / "quasistatic"
PHANTOMS = ("EF10_0T", "EF10_25T", "EF30_0T", "EF50_0T")
FITTED = {
    "Neo Hookean": "neo_hookean",
    "Yeoh_o1": "neo_hookean",
    "Yeoh_o2": "reduced_polynomial",
    "Yeoh_o3": "yeoh",
    "Mooney Rivlin_o1": "mooney_rivlin_2",
    "Mooney Rivlin_o2": "mooney_rivlin_c20",
    "Ogden_o1": "ogden1",
    "Ogden_o2": "ogden2",
    "Ogden_o3": "ogden3",
    "Veronda Westmann": "veronda_westmann",
    "Humphrey": "humphrey",
}
"""Names of the tissue phantom database -> candidates here."""
KPA = 1e3
RUBBERS = {"Treloar 1944": "Treloar_1944", "Kawabata 1981": "Kawabata_1981", "Meunier 2008": "Meunier_2008"}
MODES = {"UT": Mode.UNIAXIAL, "ET": Mode.EQUIBIAXIAL, "PS": Mode.PLANAR}


@dataclass(frozen=True)
class Published:
    """A fit of the tissue phantom database."""

    name: str
    """Its name there."""
    parameters: tuple[float, ...]
    """Parameters as printed there, moduli in kPa."""
    sse: float
    """Sum of squared residuals in engineering stress [kPa^2]."""


@cache
def phantom(name: str) -> HomogeneousTest:
    """The mean of ten compression tests at 1000 equally spaced strains, as the authors fit it."""
    tests = []
    for path in sorted((SHARED / "tissue_phantom" / name).glob("*.csv")):
        strain = WantedColumn("Engineering Strain [-]", "1", pure=True)
        table, _ = read_columns(
            path, {"strain": strain, "stress": WantedColumn("Engineering Stress (kPa)", "Pa")}
        )
        # Strain and stress of compression are negative there too.
        tests.append(HomogeneousTest(path.stem, Mode.UNIAXIAL, 1.0 + table["strain"], table["stress"]))
    assert len(tests) == 10
    return mean_test(tests, points=1000, name=name)


@cache
def published(name: str) -> tuple[Published, ...]:
    """The authors' fits to engineering stress."""
    whole = json.loads(
        (SHARED / "tissue_phantom" / "hyperelastic_parameters.json").read_text(encoding="utf-8")
    )
    rows = whole["engineering"][name]
    return tuple(Published(key, tuple(row["parameters"]), row["SSE"]) for key, row in rows.items())


def law_of(p: Published) -> AnyLaw:
    """The law with the published constants, in this package's form of it."""
    x = np.array(p.parameters)
    kind = FITTED[p.name]
    if kind.startswith("ogden"):
        mu, alpha = x.reshape(2, -1)
        return LAWS[kind].from_classical(KPA * mu, alpha)
    if kind in ("veronda_westmann", "humphrey"):
        return LAWS[kind](KPA * x[0], x[1])
    if p.name == "Yeoh_o1":
        return LAWS[kind](2.0 * KPA * x[0])  # C10 is half the shear modulus
    if kind == "mooney_rivlin_2":
        return LAWS["mooney_rivlin"](*(KPA * x))
    if kind == "mooney_rivlin_c20":
        return LAWS["polynomial"](*(KPA * x))
    return LAWS[kind](*(KPA * x))


def candidate(name: str) -> Candidate:
    """The law of a published fit."""
    return candidates([FITTED[name]])[0]


def fitted(name: str, material: str, *, bounded: bool) -> Fit:
    """That law fitted here to the same curve."""
    tried = candidate(name)
    return fit_law(tried.law, [phantom(material)], bounded=bounded, held=tried.held, name=tried.name)


def sse(law: AnyLaw, tests: list[HomogeneousTest]) -> float:
    """Sum of squared residuals [Pa^2] of a law as it is."""
    return sum(float(np.sum((predicted(law, t) - t.stress) ** 2)) for t in tests)


def predicted(law: AnyLaw, test: HomogeneousTest) -> np.ndarray:
    """Nominal stress at the points of a test [Pa]."""
    return incompressible_stress(law, test.mode, test.deformation)


@cache
def rubber(name: str) -> tuple[HomogeneousTest, ...]:
    """Uniaxial, equibiaxial and planar test of one rubber, digitised from the paper."""
    made = []
    for folder, mode in MODES.items():
        path = SHARED / "rubber_classics" / RUBBERS[name] / folder / "stress_stretch.txt"
        wanted = {"stretch": WantedColumn("2", "1", "1"), "stress": WantedColumn("1", "Pa", "MPa")}
        table, _ = read_columns(path, wanted)
        made.append(HomogeneousTest(mode.value, mode, table["stretch"], table["stress"]))
    return tuple(made)


OGDEN_1972 = LAWS["ogden3"].from_classical([0.63e6, 0.0012e6, -0.01e6], [1.3, 5.0, -2.0])
"""Ogden's own three terms for Treloar's rubber, from simple tension, equibiaxial tension and pure shear."""
STEINMANN_2012 = {
    Mode.UNIAXIAL: {"neo_hookean": (0.5673e6,)},
    Mode.EQUIBIAXIAL: {"neo_hookean": (0.4104e6,), "mooney_rivlin_2": (0.1713e6, 0.0047e6)},
    Mode.PLANAR: {"neo_hookean": (0.3360e6,)},
}
"""Constants fitted to one mode of Treloar's data [Pa] (Steinmann, Hossain and Possart 2012, as handed on by
simcoon's examples). Their Mooney-Rivlin fits to tension and pure shear are left out: without bounds the least
squares of tension have mu_0 < 0, and pure shear tells C10 + C01 alone."""

THESIS = {
    "reduced polynomial": (LAWS["reduced_polynomial"](1404.9, 699.4), 2809.8, 8429.6, 0.99971),
    "Mooney-Rivlin": (LAWS["mooney_rivlin"](624.3, 746.1), 2741.0, 8223.0, 0.99897),
    "Ogden": (LAWS["ogden1"](3225.9, 14.8), 3225.9, 9677.9, 0.99888),
    "neo-Hookean": (LAWS["neo_hookean"](2.0 * 1461.6), 2923.2, 8769.6, 0.99875),
}
"""Constants and R^2 of the thesis' Table 3.3, mu_0 and E_0 of its Table 3.4 [Pa]."""


def left_by_r_squared() -> dict[str, tuple[float, float, float, float]]:
    """sqrt(1 - R^2) of each law of the thesis as printed, its least and most possible value, the least R^2.

    1 - R^2 is the squared distance of law and data over that of the data from their mean. The laws' own
    distances are known from their constants, so by the triangle inequality sqrt(1 - R^2) lies in an interval
    about that of the best law, whichever the data were. Compression by 10 mm of 70 mm.
    """
    lam = np.linspace(1.0, 1.0 - 10.0 / 70.0, 200)
    curves = {name: incompressible_stress(row[0], Mode.UNIAXIAL, lam) for name, row in THESIS.items()}
    best = curves["reduced polynomial"]
    spread = np.linalg.norm(best - best.mean())
    radius = np.sqrt(1.0 - (THESIS["reduced polynomial"][3] - 5e-6))  # R^2 has five digits
    found = {}
    for name, curve in curves.items():
        apart = float(np.linalg.norm(curve - best) / spread)
        # The data's own spread is that of the best law but for a share `radius` at most.
        low, high = max(apart - radius, 0.0) / (1.0 + radius), (apart + radius) / (1.0 - radius)
        found[name] = (float(np.sqrt(1.0 - THESIS[name][3])), float(low), float(high), float(1.0 - high**2))
    return found


def side_stress_of_the_linear_rule() -> tuple[float, float, float, float]:
    """Volume ratio, true stress across and along [Pa] at 128 % with lam_t = 1 - 0.44 e and the constants of
    the self-healing rubber, and the true stress along with free sides [Pa]."""
    law, volume, lam = LAWS["neo_hookean"](0.218e6), VolumetricLaw(2.0 / 1.150e-6), 2.28
    side = 1.0 - 0.44 * (lam - 1.0)
    J = lam * side**2
    mean = (lam**2 + 2.0 * side**2) / 3.0
    across, along = (
        0.218e6 * J ** (-5.0 / 3.0) * (x**2 - mean) + float(volume.pressure(J)) for x in (side, lam)
    )  # the paper's Eq. (7), with 2 C10 and K = 2 / D1
    free = float(free_stretch(law, volume, Mode.UNIAXIAL, lam))
    right = float(compressible_stress(law, volume, Mode.UNIAXIAL, lam)) / free**2
    return J, across, along, right
