"""Fits: known constants, normal equations, covariance and draws, weights, outcomes, criteria by hand."""

from dataclasses import replace

import numpy as np
import pytest

from explicit.materials import LAWS
from kolsky.material.fits import fit
from kolsky.material.fits.compare import candidates, compare_laws
from kolsky.material.fits.fit import FitOutcome, fit_law
from kolsky.material.fits.homogeneous import Mode, compressible_stress, incompressible_stress
from kolsky.material.fits.homogeneous_test import HomogeneousTest, means_by_mode
from kolsky.material.fits.search import Weighting

STRETCH = np.concatenate([np.linspace(0.5, 0.97, 16), np.linspace(1.03, 1.6, 16)])
SHEAR = np.linspace(0.05, 0.8, 12)
ALL = (Mode.UNIAXIAL, Mode.EQUIBIAXIAL, Mode.PLANAR, Mode.SIMPLE_SHEAR)


def planted(law, modes=ALL, *, noise=0.0, rng=None, **more):
    tests = []
    for mode in modes:
        at = SHEAR if mode is Mode.SIMPLE_SHEAR else STRETCH
        T = incompressible_stress(law, mode, at)
        if noise:
            T = T + noise * rng.standard_normal(len(T))
        tests.append(HomogeneousTest(mode.value, mode, at, T, **more))
    return tests


def sorted_terms(law):
    """Constants with Ogden's terms by their exponents, which have no order of their own."""
    values = law.constants()
    if not hasattr(law, "TERMS"):
        return values
    terms = values.reshape(-1, 2)
    return terms[np.argsort(terms[:, 1])].ravel()


@pytest.mark.parametrize("name", [name for name in LAWS if name != "ogden3"])
def test_planted_constants_are_found(name):
    law = LAWS[name].example()
    found = fit_law(LAWS[name], planted(law), starts=6)
    assert found.outcome is FitOutcome.DETERMINED
    # What is left is round-off of the stress, 1e-16, over the least singular value, above 1e-7 (`WEAKEST`).
    np.testing.assert_allclose(sorted_terms(found.law), sorted_terms(law), rtol=1e-6)
    assert found.rmse < 1e-7 * law.shear_modulus
    assert found.youngs_modulus == pytest.approx(3.0 * law.shear_modulus, rel=1e-6)


@pytest.mark.slow
def test_three_terms_of_ogden_are_found():
    law = LAWS["ogden3"].example()
    found = fit_law(LAWS["ogden3"], planted(law))
    np.testing.assert_allclose(sorted_terms(found.law), sorted_terms(law), rtol=1e-4)  # nearly parallel terms


def test_a_linear_law_is_the_normal_equations():
    rng = np.random.default_rng(2)
    tests = planted(LAWS["polynomial"].example(), noise=300.0, rng=rng)
    found = fit_law(LAWS["polynomial"], tests, bounded=False)
    columns = [
        np.concatenate(
            [
                incompressible_stress(LAWS["polynomial"](*(1e3 * row)), t.mode, t.deformation)
                - incompressible_stress(LAWS["polynomial"](1e3, 1e3), t.mode, t.deformation)
                for t in tests
            ]
        )
        / 1e3
        for row in np.eye(5) + np.array([1.0, 1.0, 0.0, 0.0, 0.0])
    ]
    A, b = np.column_stack(columns), np.concatenate([t.stress for t in tests])
    exact, rest = np.linalg.lstsq(A, b, rcond=None)[:2]
    np.testing.assert_allclose(
        found.law.constants(), exact, rtol=1e-7, atol=1e-4
    )  # conditioning 1e4, of round-off
    assert found.sse == pytest.approx(rest[0], rel=1e-10)
    variance = rest[0] / (len(b) - 5)
    np.testing.assert_allclose(found.covariance, variance * np.linalg.inv(A.T @ A), rtol=1e-5)  # differences


def test_the_covariance_is_that_of_many_draws():
    rng = np.random.default_rng(7)
    law = LAWS["gent"](2e4, 8.0)
    draws, sigmas = [], []
    for _ in range(40):
        found = fit_law(LAWS["gent"], planted(law, (Mode.UNIAXIAL,), noise=150.0, rng=rng), starts=1)
        draws.append([found.values["mu"], found.values["Jm"]])
        sigmas.append([found.sigma["mu"], found.sigma["Jm"]])
    # A standard deviation from 40 draws has a relative error of 11 %; three of them.
    np.testing.assert_allclose(np.median(sigmas, axis=0), np.std(draws, axis=0, ddof=1), rtol=0.33)
    np.testing.assert_allclose(np.mean(draws, axis=0), [2e4, 8.0], rtol=0.01)  # 3 sigma of the mean and bias


def test_known_noise_and_its_weights():
    rng = np.random.default_rng(4)
    sigma = np.where(STRETCH < 1.0, 400.0, 40.0)
    T = incompressible_stress(LAWS["neo_hookean"](1e4), Mode.UNIAXIAL, STRETCH)
    test = HomogeneousTest("t", Mode.UNIAXIAL, STRETCH, T + sigma * rng.standard_normal(len(T)), sigma=sigma)
    found = fit_law(LAWS["neo_hookean"], [test], weighting=Weighting.SIGMA)
    g = STRETCH - STRETCH**-2
    weighted = np.sum(g * test.stress / sigma**2) / np.sum((g / sigma) ** 2)
    assert found.values["mu"] == pytest.approx(weighted, rel=1e-9)
    chi2 = np.sum(((weighted * g - test.stress) / sigma) ** 2)
    assert found.chi2 == pytest.approx(chi2, rel=1e-9)
    widened = max(1.0, chi2 / (len(T) - 1))
    assert found.sigma["mu"] == pytest.approx(np.sqrt(widened / np.sum((g / sigma) ** 2)), rel=1e-6)
    assert found.aic == pytest.approx(chi2 + 2.0)


def test_absolute_and_relative_fits_by_hand():
    rng = np.random.default_rng(5)
    tests = planted(LAWS["neo_hookean"](1e4), (Mode.UNIAXIAL, Mode.PLANAR), noise=500.0, rng=rng)
    g = [STRETCH - STRETCH**-2, STRETCH - STRETCH**-3]
    found = fit_law(LAWS["neo_hookean"], tests)
    top = sum(a @ t.stress for a, t in zip(g, tests, strict=True))
    assert found.values["mu"] == pytest.approx(top / sum(a @ a for a in g), rel=1e-9)
    found = fit_law(LAWS["neo_hookean"], tests, weighting=Weighting.RELATIVE)
    ratio = np.concatenate([a / t.stress for a, t in zip(g, tests, strict=True)])
    assert found.values["mu"] == pytest.approx(ratio.sum() / (ratio @ ratio), rel=1e-9)


def test_a_point_at_rest_says_nothing_of_relative_residuals():
    law = LAWS["neo_hookean"](1e4)
    at = np.linspace(1.0, 1.5, 11)
    test = HomogeneousTest("t", Mode.UNIAXIAL, at, incompressible_stress(law, Mode.UNIAXIAL, at))
    found = fit_law(LAWS["neo_hookean"], [test], weighting=Weighting.RELATIVE)
    assert (found.n, found.values["mu"]) == (10, pytest.approx(1e4))
    spoilt = HomogeneousTest("t", Mode.UNIAXIAL, at, np.where(at == at[3], 0.0, test.stress))
    with pytest.raises(
        ValueError, match=r"t: the stress is 0 at strain 0\.15, so no relative residual exists"
    ):
        fit_law(LAWS["neo_hookean"], [spoilt], weighting=Weighting.RELATIVE)


def test_the_compressible_solution_is_fitted():
    from explicit.materials import bulk_modulus
    from explicit.materials.volumetric import VolumetricLaw

    law = LAWS["yeoh"](8e3, 400.0, 30.0)
    volume = VolumetricLaw(float(bulk_modulus(law.shear_modulus, 0.44)))
    T = compressible_stress(law, volume, Mode.UNIAXIAL, STRETCH)
    test = HomogeneousTest("t", Mode.UNIAXIAL, STRETCH, T)
    found = fit_law(LAWS["yeoh"], [test], poisson=0.44)
    np.testing.assert_allclose(found.law.constants(), law.constants(), rtol=1e-6)  # round-off, as above
    assert found.youngs_modulus == pytest.approx(2.0 * 1.44 * 16e3, rel=1e-6)
    assert fit_law(LAWS["yeoh"], [test]).rmse > 1e4 * found.rmse  # the incompressible one is another curve


def test_outcomes():
    soft = planted(LAWS["reduced_polynomial"](5e3, -200.0), (Mode.UNIAXIAL,))
    found = fit_law(LAWS["reduced_polynomial"], soft)
    assert (found.outcome, found.at_bound) == (FitOutcome.AT_BOUND, ("C20",))
    assert found.values["C20"] == 0.0
    assert found.sigma["C20"] == 0.0
    free = fit_law(LAWS["reduced_polynomial"], soft, bounded=False)
    assert free.outcome is FitOutcome.DETERMINED
    assert free.law.outside() == ("C20 = -200 Pa is outside [0, inf]",)
    # Planar tension sees C10 + C01 only: the sum is determined, each is not.
    planar = fit_law(
        LAWS["mooney_rivlin"], planted(LAWS["mooney_rivlin"](3e3, 1e3), (Mode.PLANAR,)), held={"C11": 0.0}
    )
    assert planar.outcome is FitOutcome.NOT_DETERMINED
    assert planar.law.shear_modulus == pytest.approx(8e3, rel=1e-9)
    assert np.isnan(planar.covariance).all()
    assert planar.name == "mooney_rivlin, C11 = 0"
    assert planar.free == ("C10", "C01")


def test_what_cannot_be_fitted_is_refused():
    test = planted(LAWS["yeoh"].example(), (Mode.UNIAXIAL,))[0]
    three = HomogeneousTest("three", Mode.UNIAXIAL, test.deformation[:3], test.stress[:3])
    for arguments, message in (
        ({"tests": []}, "at least one test"),
        ({"tests": [three]}, "has 3 free constants, the tests only 3 points"),
        ({"held": {"mu": 1.0}}, "has no constant 'mu'; it has C10, C20, C30"),
        ({"held": {"C10": 1.0, "C20": 1.0, "C30": 1.0}}, "all constants are held"),
        ({"weighting": Weighting.SIGMA}, "has no sigma"),
        ({"weighting": "absolut"}, "'absolut' is not a valid Weighting"),
        ({"starts": 0}, "starts must be >= 1"),
        ({"poisson": 0.5}, r"poisson must be in \(-1, 0.5\), got 0.5"),
    ):
        with pytest.raises(ValueError, match=message):
            fit_law(LAWS["yeoh"], **{"tests": [test], **arguments})


def test_no_law_is_said():
    # A curve that falls: without bounds least squares make mu_0 negative.
    lam = np.linspace(1.1, 4.0, 20)
    T = incompressible_stress(LAWS["reduced_polynomial"](5e3, 500.0), Mode.UNIAXIAL, lam)
    A = np.column_stack([2 * (lam - lam**-2), 2 * (lam - lam**-2) / lam])
    assert np.linalg.lstsq(A, T, rcond=None)[0].sum() < 0.0
    with pytest.raises(ValueError, match="the initial shear modulus would not be > 0"):
        fit_law(
            LAWS["mooney_rivlin"],
            [HomogeneousTest("t", Mode.UNIAXIAL, lam, T)],
            bounded=False,
            held={"C11": 0.0},
        )


def test_criteria_by_hand():
    r, T = np.array([1.0, -1.0, 2.0]), np.array([1.0, 2.0, 6.0])
    assert fit.rmse(r) == pytest.approx(np.sqrt(2.0))
    assert fit.r_squared(r, T) == pytest.approx(1.0 - 6.0 / 14.0)
    made = replace(
        fit_law(LAWS["yeoh"], planted(LAWS["yeoh"](1e4, 0.0, 0.0))), chi2=6.0, n=3, free=("a", "b")
    )
    assert made.aic == pytest.approx(3.0 * np.log(2.0) + 4.0)
    assert made.bic == pytest.approx(3.0 * np.log(2.0) + 2.0 * np.log(3.0))
    assert replace(made, weighting=Weighting.SIGMA).aic == 10.0
    assert fit.durbin_watson(r) == pytest.approx((4.0 + 9.0) / 6.0)


def test_a_comparison_orders_judges_and_explains():
    rng = np.random.default_rng(11)
    tests = planted(LAWS["mooney_rivlin"](4e3, 2e3), (Mode.UNIAXIAL, Mode.EQUIBIAXIAL), noise=100.0, rng=rng)
    made = compare_laws(
        candidates(["neo_hookean", "mooney_rivlin_2", "mooney_rivlin", "gent"]), tests, starts=2
    )
    assert made.best is not None
    assert made.best.candidate.name == "mooney_rivlin_2"  # the law of the data, with the constants it needs
    aics = [row.fit.aic for row in made.rows]
    assert aics == sorted(aics)
    assert all(row.stable for row in made.rows if row.candidate.name != "gent")
    few = [HomogeneousTest("few", Mode.UNIAXIAL, tests[0].deformation[:4], tests[0].stress[:4])]
    rows = {row.candidate.name: row for row in compare_laws(candidates(["yeoh", "polynomial"]), few).rows}
    assert rows["yeoh"].fit is not None
    assert rows["polynomial"].fit is None
    assert rows["polynomial"].reason == "polynomial has 5 free constants, the tests only 4 points"
    with pytest.raises(ValueError, match="law 'mooney' is not one of neo_hookean, mooney_rivlin"):
        candidates(["mooney"])


def test_repeats_by_hand():
    lam = np.linspace(1.0, 0.5, 26)
    tests = [HomogeneousTest(f"t{k}", Mode.UNIAXIAL, lam, (1.0 + 0.1 * k) * (lam - 1.0)) for k in (-1, 0, 1)]
    (made,) = means_by_mode(tests, 11)
    np.testing.assert_allclose(made.deformation, np.linspace(1.0, 0.5, 11))
    np.testing.assert_allclose(made.stress, made.deformation - 1.0, atol=1e-15)
    assert made.sigma is None  # at rest all tests agree: a sigma of zero weights nothing
    later = [replace(t, deformation=t.deformation[5:], stress=t.stress[5:]) for t in tests]
    (inner,) = means_by_mode(later, 200)
    np.testing.assert_allclose(inner.sigma, 0.1 * np.abs(inner.stress) / np.sqrt(3.0))
    pull = HomogeneousTest("pull", Mode.UNIAXIAL, 2.0 - lam, 1.0 - lam)
    assert [test.name for test in means_by_mode([*tests, pull], 11)] == ["mean of 3 uniaxial", "pull"]
    back = HomogeneousTest("back", Mode.UNIAXIAL, np.append(lam, 0.7), np.append(lam, 0.7) - 1.0)
    with pytest.raises(ValueError, match=r"back: the strain goes back at point 26 \(-0.5 to -0.3\)"):
        means_by_mode([back], 11)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"stress": 1.0 - np.linspace(0.5, 0.9, 5)}, "differ in sign over the whole curve"),
        ({"stress": np.full(5, np.nan)}, "stress 0 is not finite"),
        ({"deformation": np.linspace(-0.1, 0.9, 5)}, "t: uniaxial: stretch must be > 0"),
        ({"deformation": np.linspace(0.5, 0.9, 4)}, "must have one shape"),
        ({"sigma": np.zeros(5)}, "sigma must be > 0 Pa"),
    ],
)
def test_a_test_that_cannot_be_is_refused(change, message):
    lam = np.linspace(0.5, 0.9, 5)
    with pytest.raises(ValueError, match=message):
        HomogeneousTest(
            **{"name": "t", "mode": Mode.UNIAXIAL, "deformation": lam, "stress": lam - 1.0, **change}
        )


def test_a_failure_is_named_as_the_test_that_was_made():
    law = LAWS["reduced_polynomial"](5e3, -300.0)
    tests = planted(law, (Mode.UNIAXIAL,))
    (row,) = compare_laws(candidates(["reduced_polynomial"]), tests, bounded=False).rows
    first = row.first_failure
    # Equibiaxial compression is the same deformation as uniaxial tension, which is the test people make.
    assert first is not None
    sizes = {(p.mode, p.direction): p for p in row.stability}
    same = sizes[Mode.EQUIBIAXIAL, "compression"]
    uniaxial = sizes[Mode.UNIAXIAL, "tension"]
    assert 1.0 + uniaxial.strain == pytest.approx((1.0 + same.strain) ** -2, rel=1e-9)
    largest = {
        p: np.abs(np.log(np.stack(p.mode.principal_stretches(p.mode.at_rest + p.strain)))).max()
        for p in row.stability
    }
    assert largest[first] == pytest.approx(min(largest.values()), rel=1e-8)
    assert first is not same
