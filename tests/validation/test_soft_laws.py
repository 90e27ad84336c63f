"""Published homogeneous tests of rubber, and published fits of laws to them."""

import json
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from shared_data import DATA, data

from explicit.materials import LAWS, AnyLaw
from explicit.materials.laws.ogden import Ogden1
from explicit.materials.laws.polynomial import NeoHookean
from explicit.materials.volumetric import VolumetricLaw
from kolsky.material.fits.compare import Candidate, Stability, candidates, drucker
from kolsky.material.fits.fit import Fit, FitOutcome, fit_law
from kolsky.material.fits.homogeneous import Mode, compressible_stress, free_stretch, incompressible_stress
from kolsky.material.fits.homogeneous_test import HomogeneousTest, means_by_mode
from kolsky.readers.measured_tables import WantedColumn, read_columns

SHARED = DATA / "quasistatic"
PHANTOMS = ("EF10_0T", "EF10_25T", "EF30_0T", "EF50_0T")
FITTED = {
    "Neo Hookean": "neo_hookean", "Yeoh_o1": "neo_hookean", "Yeoh_o2": "reduced_polynomial",
    "Yeoh_o3": "yeoh", "Mooney Rivlin_o1": "mooney_rivlin_2", "Mooney Rivlin_o2": "mooney_rivlin_c20",
    "Ogden_o1": "ogden1", "Ogden_o2": "ogden2", "Ogden_o3": "ogden3", "Veronda Westmann": "veronda_westmann",
    "Humphrey": "humphrey",
}  # fmt: skip
"""Names of the tissue phantom database -> candidates here."""
KPA = 1e3
RUBBERS = {"Treloar 1944": "Treloar_1944", "Kawabata 1981": "Kawabata_1981", "Meunier 2008": "Meunier_2008"}
MODES = {"UT": Mode.UNIAXIAL, "ET": Mode.EQUIBIAXIAL, "PS": Mode.PLANAR}


Published = SimpleNamespace


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
    return replace(means_by_mode(tests, 1000)[0], name=name)


@cache
def published(name: str) -> tuple[Published, ...]:
    """The authors' fits to engineering stress."""
    whole = json.loads(
        (SHARED / "tissue_phantom" / "hyperelastic_parameters.json").read_text(encoding="utf-8")
    )
    rows = whole["engineering"][name]
    return tuple(
        Published(
            name=key,  # its name there
            parameters=tuple(row["parameters"]),  # parameters as printed there, moduli in kPa
            sse=row["SSE"],  # sum of squared residuals in engineering stress [kPa^2]
        )
        for key, row in rows.items()
    )


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


DIGITS = 5e-5
"""Half a unit of the fourth digit. The curves differ by less: the authors' last strain is not printed."""
QUICK = [name for name in FITTED if not name.startswith("Ogden")]
SAMPLED = [pytest.param(x, marks=[pytest.mark.long] * (x != "EF50_0T")) for x in PHANTOMS]
"""The stiffest phantom in CI, all every week: the path is the same."""


@pytest.fixture(autouse=True)
def _data():
    data("quasistatic", "tissue_phantom")


def printed(material):
    return {p.name: p for p in published(material)}


@pytest.mark.parametrize("material", PHANTOMS)
def test_published_constants_give_the_published_sums(material):
    # Laws, curve and mean alone: nothing is fitted.
    for p in published(material):
        assert sse(law_of(p), [phantom(material)]) == pytest.approx(p.sse * KPA**2, rel=DIGITS), p.name


@pytest.mark.parametrize(
    "material", [pytest.param(x, marks=[pytest.mark.slow] * (x != "EF50_0T")) for x in PHANTOMS]
)
@pytest.mark.parametrize("name", QUICK)
def test_published_fits_are_met(material, name):
    found = fitted(name, material, bounded=False)
    p = printed(material)[name]
    assert found.sse <= p.sse * KPA**2 * (1.0 + DIGITS)
    assert found.outcome is FitOutcome.DETERMINED
    # Three digits: half a unit of the third, where it is largest (1.00).
    np.testing.assert_allclose(found.law.constants(), law_of(p).constants(), rtol=5e-3, atol=1.5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("material", SAMPLED)
@pytest.mark.parametrize("name", ["Ogden_o1", "Ogden_o2", "Ogden_o3"])
def test_published_ogden_fits_are_met_or_beaten(material, name):
    found = fitted(name, material, bounded=True)  # as theirs, whose moduli all have mu alpha > 0
    p = printed(material)[name]
    assert found.sse <= p.sse * KPA**2 * (1.0 + DIGITS)
    theirs = law_of(p).constants().reshape(-1, 2)
    if name == "Ogden_o3":
        assert found.outcome is not FitOutcome.DETERMINED  # two of three exponents are alike, there and here
    elif (material, name) == ("EF50_0T", "Ogden_o2"):
        assert found.sse < 0.26 * p.sse * KPA**2  # theirs stopped at two equal terms, the sum of Ogden_o1
        np.testing.assert_allclose(theirs[0], theirs[1])
    else:
        ours = found.law.constants().reshape(-1, 2)
        ours, theirs = (x[np.argsort(x[:, 1])] for x in (ours, theirs))
        np.testing.assert_allclose(ours, theirs, rtol=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("material", SAMPLED)
def test_moduli_of_either_sign_fit_four_times_better(material):
    # What a better sum costs: without bounds two terms of opposite sign, and Drucker's criterion fails.
    free = fitted("Ogden_o2", material, bounded=False)
    assert free.sse < 0.35 * printed(material)["Ogden_o2"].sse * KPA**2
    assert free.law.outside()


@pytest.mark.parametrize(
    ("mode", "name"), [(mode, name) for mode, laws in STEINMANN_2012.items() for name in laws]
)
def test_one_mode_of_treloar_against_published_constants(mode, name):
    tests = [test for test in rubber("Treloar 1944") if test.mode is mode]
    tried = candidates([name])[0]
    found = fit_law(tried.law, tests, bounded=False, held=tried.held)
    theirs = tried.law(*STEINMANN_2012[mode][name])
    assert found.sse <= sse(theirs, tests)
    if (mode, name) not in ((Mode.EQUIBIAXIAL, "neo_hookean"), (Mode.PLANAR, "neo_hookean")):
        # Their digitisation of Treloar's figure is another one: 1 % of the stress at the far end.
        assert found.law.shear_modulus == pytest.approx(theirs.shear_modulus, rel=0.01)


@pytest.mark.slow
def test_three_modes_at_once_do_better_than_ogden_did():
    tests = list(rubber("Treloar 1944"))
    found = fit_law(LAWS["ogden3"], tests, starts=4)
    # His constants were fitted by hand over less of the tension curve.
    assert found.sse < 0.1 * sse(OGDEN_1972, tests)
    assert found.r_squared > 0.998
    assert {p.outcome for p in drucker(found.law)} == {Stability.STABLE}
    for test in tests:
        near = test.strain <= 5.0  # stretch 6: there his fit is as good as his figures show
        stress = incompressible_stress(OGDEN_1972, test.mode, test.deformation)
        assert np.abs(stress - test.stress)[near].max() < 0.09 * test.stress[near].max()


@pytest.mark.slow
@pytest.mark.parametrize("name", RUBBERS)
def test_the_second_invariant_is_needed_for_several_modes(name):
    # Treloar 1975, ch. 10: a function of I1 alone cannot meet tension and equibiaxial tension at once.
    tests = list(rubber(name))
    yeoh, ogden = (fit_law(LAWS[law], tests, starts=4) for law in ("yeoh", "ogden3"))
    assert ogden.chi2 < 0.5 * yeoh.chi2
    worst = max(yeoh.parts, key=lambda part: part.relative_rms)
    assert (
        worst.test.mode is not Mode.UNIAXIAL
    )  # of natural rubber equibiaxial tension, of the silicone planar


# ---- tables of two papers ------------------------------------------------------------------


def test_linear_limits_of_the_thesis_tables():
    for name, (law, mu, E, _) in THESIS.items():
        # Constants have a tenth of a pascal: 2 (C10 + C01) is known to 0.2, three times that to 0.6.
        assert law.shear_modulus == pytest.approx(mu, abs=0.21), name
        assert 3.0 * law.shear_modulus == pytest.approx(E, abs=0.61), name
    # Not so the last digits: three rows of four are 3 mu_0 of digits that are not printed.
    off = {name: 3.0 * law.shear_modulus - E for name, (law, _, E, _) in THESIS.items()}
    assert {name for name, d in off.items() if abs(d) > 0.05} == {
        "reduced polynomial",
        "Mooney-Rivlin",
        "Ogden",
    }


def test_one_r_squared_of_the_thesis_is_impossible():
    possible = {name: low <= printed <= high for name, (printed, low, high, _) in left_by_r_squared().items()}
    assert possible == {
        "reduced polynomial": True,
        "Mooney-Rivlin": False,
        "Ogden": True,
        "neo-Hookean": True,
    }


def test_factor_two_of_the_thesis_equation():
    # Its Eq. (3.3) has C10 where 2 C10 is meant, as its Eqs. (3.4) to (3.9) use: against the energy itself.
    C10, lam, h = 1461.6, 0.9, 1e-5
    W = [C10 * (x**2 + 2.0 / x - 3.0) for x in (lam - h, lam + h)]
    slope = (W[1] - W[0]) / (2.0 * h)
    assert slope == pytest.approx(2.0 * C10 * (lam - lam**-2), rel=1e-8)  # h^2 and rounding
    assert incompressible_stress(NeoHookean(2.0 * C10), Mode.UNIAXIAL, lam) == pytest.approx(slope, rel=1e-8)


def test_linear_limits_of_the_self_healing_rubber():
    # Table 2 in MPa; its strain energies divide by D1, so K = 2 / D1. Poisson's ratio was measured: 0.44.
    for law, D1 in ((NeoHookean(2.0 * 0.109e6), 1.150e-6), (Ogden1(0.218e6, 1.972), 1.144e-6)):
        mu, K = law.shear_modulus, 2.0 / D1
        assert mu == pytest.approx(0.218e6)
        nu = (3.0 * K - 2.0 * mu) / (2.0 * (3.0 * K + mu))
        assert nu == pytest.approx(0.44, abs=0.005)  # two digits
        assert {p.outcome for p in drucker(law)} == {Stability.STABLE}
    # With mu / alpha before the bracket instead of 2 mu / alpha^2 the two laws' moduli would part by 1.4 %.
    assert Ogden1.from_classical(0.218e6, 1.972).shear_modulus == pytest.approx(0.986 * 0.218e6, rel=1e-3)


def test_the_linear_rule_of_poisson_leaves_stress_on_free_sides():
    # Its fits take lam_t = 1 - nu e up to e = 1.3; the sides of a specimen carry no stress.
    J, across, along, right = side_stress_of_the_linear_rule()
    assert abs(J - 0.435) < 5e-4
    assert across < -1e6  # 1 MPa of suction where there is none, more than the stress along
    assert abs(across) > right > 0.0
    assert abs(along - right) > 0.5 * right


def test_drucker_of_the_thesis_laws_holds_as_it_says():
    for law, *_ in THESIS.values():
        assert {p.outcome for p in drucker(law)} == {Stability.STABLE}


def test_the_phantom_curves_are_what_the_readme_says():
    test = phantom("EF10_0T")
    assert isinstance(test, HomogeneousTest)
    assert test.deformation.min() == pytest.approx(1.0 / 3.0, abs=1e-5)
    assert (test.stress[10:] < 0.0).all()
