"""[law] of shot.toml, and changes of the quasi-static curve."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from explicit.materials import LAWS, marlow_from_curve
from explicit.materials.law import not_positive
from explicit.materials.laws import Yeoh
from kolsky.base.errors import InputError
from kolsky.base.records import MaterialCurve
from kolsky.inverse.forward import curve_replicates, material_law
from kolsky.inverse.problem import prepare_shot
from kolsky.inverse.settings import Numerics
from kolsky.shot.corrections import FORMS, PAST_END, SOFTEST, changed_curve
from kolsky.shot.load import load_shot
from kolsky.shot.summary import summarise

# [law] of shot.toml: a fitted law instead of the curve, from the file to the solver's law.

OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"
LAW = """[law]
name = "yeoh"
parameters = { C10 = "12.5 kPa", C20 = "300 Pa", C30 = "20 Pa" }
branch = "compression"
largest_strain = "60 %"
relative_sigma = "3 %"

"""


@pytest.fixture
def shot(tmp_path: Path):
    """A copy of open-01 with [curve] replaced by a text."""

    def written(text: str, *, keep_curve: bool = False) -> Path:
        for path in OPEN_01.glob("*.csv"):
            shutil.copy(path, tmp_path)
        toml = (OPEN_01 / "shot.toml").read_text(encoding="utf-8")
        start, end = toml.index("[curve]"), toml.index("[model]")
        kept = toml[start:end] if keep_curve else ""
        (tmp_path / "shot.toml").write_text(toml[:start] + kept + text + toml[end:], encoding="utf-8")
        return tmp_path

    return written


def test_the_law_of_the_file_is_the_law_of_the_solver(shot) -> None:
    prepared = prepare_shot(load_shot(shot(LAW)))
    (law,) = prepared.forward.laws
    # s of the compression to 0.4: sqrt(0.16 + 2 / 0.4 - 3)
    assert law == Yeoh(12.5e3, 300.0, 20.0, fitted_s=law.data_limit)
    assert prepared.checks["curve_last_s"] == pytest.approx(np.sqrt(0.4**2 + 2.0 / 0.4 - 3.0), rel=1e-14)
    assert prepared.checks["curve_last_strain"] == pytest.approx(-0.6)
    assert prepared.forward.model(Numerics()).materials == (law,)


def test_its_curve_is_the_incompressible_uniaxial_one(shot) -> None:
    curve = load_shot(shot(LAW)).curve
    lam = curve.stretch
    x = lam**2 + 2.0 / lam - 3.0
    # T = 2 (lam - lam^-2) dW/dI1, Yeoh's
    expected = 2.0 * (lam - lam**-2) * (12.5e3 + 600.0 * x + 60.0 * x**2)
    np.testing.assert_allclose(curve.stress, expected, rtol=1e-12)
    np.testing.assert_allclose(curve.total_sigma, 0.03 * np.abs(expected), rtol=1e-12)


def test_the_summary_names_the_law(shot) -> None:
    entries = {(e.section, e.name): e.value for e in summarise(load_shot(shot(LAW)))}
    assert entries["curve", "law"] == "yeoh"
    assert entries["curve", "stretch at the end"] == pytest.approx(0.4)


def test_replicates_vary_by_a_common_factor(shot) -> None:
    curve = load_shot(shot(LAW)).curve
    law = material_law(curve)
    factors = np.log(
        [x.initial_shear_modulus for x in curve_replicates(curve, 4000, np.random.default_rng(2))]
    )
    factors -= np.log(law.initial_shear_modulus)
    # 4000 draws: 3 % known to 1.1 % of itself, and the mean to 3 % / sqrt(4000)
    assert factors.std() == pytest.approx(0.03, rel=0.05)
    assert abs(factors.mean()) < 4.0 * 0.03 / np.sqrt(4000)


def test_beside_a_curve_the_file_names_the_baseline(shot) -> None:
    by_law = load_shot(shot(LAW.replace("[law]", "[law]\nbaseline = true"), keep_curve=True))
    assert by_law.curve.law is not None
    by_curve = load_shot(shot(LAW.replace("[law]", "[law]\nbaseline = false"), keep_curve=True))
    assert by_curve.curve.law is None
    np.testing.assert_array_equal(by_curve.curve.stress, load_shot(OPEN_01).curve.stress)
    with pytest.raises(InputError, match=r"law is given, and so is \[curve\].*baseline = true"):
        load_shot(shot(LAW, keep_curve=True))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[law]", "[law]\nbaseline = false", r"law.baseline.*no \[curve\]"),
        ('"yeoh"', '"hooke"', r'law.name = "hooke" is not a law.*arruda_boyce.*yeoh'),
        ('C30 = "20 Pa"', 'D1 = "20 Pa"', r'law.parameters.*"yeoh" has no constant D1.*C10, C20, C30'),
        (', C30 = "20 Pa"', "", r'law.parameters.*"yeoh" needs the constant C30'),
        ('"300 Pa"', "300", r"law.parameters.*C20: 300 has no unit.*write C20 = \"12.5 kPa\""),
        ('"300 Pa"', '"3 mm"', r"law.parameters.*C20: '3 mm' is a length"),
        ('"12.5 kPa"', '"-12.5 kPa"', r"law.parameters.*make no law: yeoh: C10 must be in \[0, inf\] Pa"),
        ('"300 Pa"', '"-90 kPa"', "law.parameters.*not positive in uniaxial deformation at the stretch"),
        ('"60 %"', '"120 %"', "law.largest_strain.*below 1 in compression"),
        ('"3 %"', '"0 %"', "law.relative_sigma.*is zero, as if the law had no uncertainty"),
        ('branch = "compression"', 'branch = "both"', "law.branch"),
        ('branch = "compression"', 'branch = "compression"\nfile = "x.csv"', "law.file"),
    ],
)
def test_what_makes_no_law_is_refused(shot, old: str, new: str, message: str) -> None:
    assert LAW.count(old) == 1
    with pytest.raises(InputError) as caught:
        load_shot(shot(LAW.replace(old, new)))
    assert re.search(message, str(caught.value), flags=re.DOTALL), str(caught.value)


def test_a_number_without_a_unit_may_stand_alone(shot) -> None:
    text = LAW.replace('"yeoh"', '"gent"')
    text = re.sub(r"parameters = .*", 'parameters = { mu = "25 kPa", Jm = 30 }', text)
    law = load_shot(shot(text)).curve.law
    assert (law.NAME, list(law.constants())) == ("gent", [25e3, 30.0])


def test_an_energy_is_looked_at_in_every_mode() -> None:
    assert not_positive(Yeoh(12e3, -300.0, 40.0)) is None
    # Negative C01: uniaxial tension is positive to a stretch of 5, the other side is not.
    found = not_positive(LAWS["mooney_rivlin"].of([10e3, -4e3, 0.0]))
    assert found[1] < 1.0
    assert not_positive(LAWS["gent"].of([25e3, 1.0])) is None  # past locking there is nothing to look at


@pytest.mark.slow
def test_a_shot_runs_with_a_law(shot) -> None:
    prepared = prepare_shot(load_shot(shot(LAW)))
    response = prepared.forward.run({"stiffness_factor": [1.0, 2.0]}, Numerics(mesh=(8, 10)))
    assert response.completed.all()
    # As stiff at rest as half the curve's material: the same waves, lower.
    curve = prepare_shot(load_shot(OPEN_01)).forward.run({"stiffness_factor": 1.0}, Numerics(mesh=(8, 10)))
    assert response.extrapolated_share[0] > 0.0
    drawn = prepared.with_replicates(2, np.random.default_rng(1))
    varied = drawn.run({"stiffness_factor": 1.0}, Numerics(mesh=(8, 10)), material=[0, 1, 2])
    ratio = [law.initial_shear_modulus / drawn.laws[0].initial_shear_modulus for law in drawn.laws]
    scaled = prepared.forward.run({"stiffness_factor": ratio}, Numerics(mesh=(8, 10)))
    # A factor on the law is a factor m, but for the damping that m scales too: both scale it alike.
    np.testing.assert_allclose(varied.force_transmission, scaled.force_transmission, rtol=1e-6, atol=1e-6)
    assert response.force_transmission.max() > 0.5 * curve.force_transmission.max()


# Changes of the quasi-static curve, against closed forms.

MU = 3e4
LAM = np.linspace(1.0, 0.4, 61)[1:]


def neo_hookean(stretch: np.ndarray) -> np.ndarray:
    return MU * (stretch - stretch**-2)


def curve(stretch: np.ndarray = LAM) -> MaterialCurve:
    stress = neo_hookean(stretch)
    return MaterialCurve(stretch=stretch, stress=stress, sigma=0.01 * np.abs(stress))


@pytest.mark.parametrize("form", [name for name in FORMS if name != "past end"])
def test_nothing_is_changed_by_an_amount_of_nothing(form: str) -> None:
    same = changed_curve(curve(), {form: 0.0})
    np.testing.assert_allclose(same.stretch, LAM, rtol=1e-15)
    np.testing.assert_allclose(same.stress, neo_hookean(LAM), rtol=1e-15)


def test_true_stress_is_over_the_area_there() -> None:
    """An incompressible column's area grows by 1 / λ: sigma = T λ."""
    declared = curve()
    wrong = MaterialCurve(stretch=LAM, stress=declared.stress * LAM, sigma=declared.sigma * LAM)
    right = changed_curve(wrong, {"true stress": 1.0})
    np.testing.assert_allclose(right.stress, declared.stress, rtol=1e-13)
    np.testing.assert_allclose(right.sigma, declared.sigma, rtol=1e-13)


def test_logarithmic_strain_is_that_of_the_stretch() -> None:
    wrong = MaterialCurve(stretch=1.0 + np.log(LAM), stress=neo_hookean(LAM), sigma=np.ones(60))
    np.testing.assert_allclose(changed_curve(wrong, {"true strain": 1.0}).stretch, LAM, rtol=1e-13)


def test_secants_grow_along_the_curve_and_a_scale_is_a_scale() -> None:
    tilted = changed_curve(curve(), {"tilt": 0.25}).stress / neo_hookean(LAM)
    assert tilted[-1] == pytest.approx(1.125, rel=1e-12)
    assert tilted[-1] - tilted[0] == pytest.approx(0.25 * (1.0 - 1.0 / 60.0), rel=1e-9)
    both = changed_curve(curve(), {"scale": 1.0, "tilt": 0.25}).stress
    np.testing.assert_allclose(both, 2.0 * tilted * neo_hookean(LAM), rtol=1e-13)


def test_the_other_branch_has_the_same_strains_with_the_other_sign() -> None:
    pulled = np.linspace(1.0, 1.6, 61)[1:]
    wrong = MaterialCurve(stretch=2.0 - pulled, stress=-neo_hookean(pulled), sigma=np.ones(60))
    right = changed_curve(wrong, {"branch": 1.0})
    np.testing.assert_allclose(right.stretch, pulled, rtol=1e-14)
    np.testing.assert_allclose(right.stress, neo_hookean(pulled), rtol=1e-14)


@pytest.mark.parametrize("stretch", [LAM, np.linspace(1.0, 2.0, 61)[1:]])
def test_a_curve_goes_on_past_its_end(stretch: np.ndarray) -> None:
    """A neo-Hookean quotient is mu everywhere; past the end mu (1 + u x²) with x = s / last - 1."""
    on = changed_curve(curve(stretch), {"past end": 3.0})
    law, last = (
        marlow_from_curve(on.stretch, on.stress, n_knots=513),
        marlow_from_curve(stretch, neo_hookean(stretch)).last,
    )
    assert law.last == pytest.approx(PAST_END * last, rel=1e-4)
    for x in (0.0, 0.5, 1.0):
        assert law.two_u_prime(np.array((1.0 + x) * last)) == pytest.approx(MU * (1.0 + 3.0 * x**2), rel=2e-3)
    soft = changed_curve(curve(stretch), {"past end": -3.0})
    quotient = soft.stress / (soft.stretch - soft.stretch**-2)
    assert quotient[-1] == pytest.approx(SOFTEST * MU, rel=1e-4)
    assert (np.diff(np.abs(soft.stretch - 1.0)) > 0.0).all()
