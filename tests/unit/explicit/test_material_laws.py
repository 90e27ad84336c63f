"""Every closed-form law against its own energy and against itself in other axes; limits, bounds and names."""

from dataclasses import fields
from decimal import Decimal, localcontext
from math import inf

import numpy as np
import pytest
from lawstates import stretches, turned

from explicit.materials import LAWS, AnyLaw, law_class, neo_hookean
from explicit.materials.law import kirchhoff, tangent
from explicit.materials.laws.exponential import LEAST_EXPONENT, VerondaWestmann
from explicit.materials.laws.ogden import Ogden1, Ogden2, Ogden3
from explicit.materials.laws.yeoh import Yeoh

EVERY = pytest.mark.parametrize("law", [c.example() for c in LAWS.values()], ids=list(LAWS))
STEP = 1e-5
"""Step of central differences in ln lam: their error is STEP^2 times third derivatives over first ones, 1e-9
with the exponents here, and 1e-16 / STEP of rounding."""
DIFFERENCE = {"rtol": 3e-8, "atol": 3e-8 * 25e3}


def shifted(lam: np.ndarray, axis: int, step: float) -> np.ndarray:
    moved = lam.copy()
    moved[..., axis] *= np.exp(step)
    return moved


@EVERY
def test_its_constants_are_its_fields(law: AnyLaw) -> None:
    assert type(law).of(law.constants()) == law
    named = [field.name for field in fields(law) if not field.kw_only]
    assert [spec.name for spec in law.PARAMETERS] == named
    assert law.outside() == ()
    assert law_class(law.NAME) is type(law)


@EVERY
def test_at_rest_there_is_neither_stress_nor_energy(law: AnyLaw) -> None:
    rest = np.array([1.0, 1.0, 0.0, 1.0])
    assert law.energy(rest) == pytest.approx(0.0, abs=1e-11 * law.shear_modulus)
    np.testing.assert_allclose(law.stress(rest), 0.0, atol=1e-14 * law.shear_modulus)  # round-off


@EVERY
def test_slopes_are_those_of_the_energy(law: AnyLaw) -> None:
    lam = stretches(100) * 1.1  # of any volume: W takes the stretches as they stand
    slope, curvature = np.stack(law.principal(*lam.T), axis=-1), law.hessian(*lam.T)
    for k in range(3):
        up, down = shifted(lam, k, STEP), shifted(lam, k, -STEP)
        width = up[:, k] - down[:, k]
        found = (law.strain_energy(*up.T) - law.strain_energy(*down.T)) / width
        np.testing.assert_allclose(slope[:, k], found, **DIFFERENCE)
        found = (np.stack(law.principal(*up.T), -1) - np.stack(law.principal(*down.T), -1)) / width[:, None]
        np.testing.assert_allclose(curvature[:, :, k], found, rtol=1e-7, atol=1e-7 * 25e3)
    np.testing.assert_array_equal(curvature, curvature.transpose(0, 2, 1))


@EVERY
def test_the_tangent_is_the_derivative_of_the_stress(law: AnyLaw) -> None:
    lam = stretches(100)
    slopes = tangent(law, lam)
    for k in range(3):
        up, down = (kirchhoff(law, shifted(lam, k, h)) for h in (STEP, -STEP))
        np.testing.assert_allclose(slopes[:, :, k], (up - down) / (2.0 * STEP), **DIFFERENCE)
    np.testing.assert_allclose(slopes.sum(axis=-1), 0.0, atol=1e-10 * 25e3)  # blind to volume


@EVERY
def test_the_stress_turns_with_the_strain(law: AnyLaw) -> None:
    lam, angle = stretches(100), np.linspace(0.0, np.pi, 100)
    found = law.stress(turned(lam**2, angle))
    np.testing.assert_allclose(found, turned(kirchhoff(law, lam), angle), rtol=0, atol=1e-9)
    np.testing.assert_allclose(law.energy(turned(lam**2, angle)), law.strain_energy(*lam.T), rtol=1e-9)


@EVERY
def test_its_linear_limit_is_the_shear_modulus(law: AnyLaw) -> None:
    strain = 1e-4  # small enough that the law is linear to 1e-4, large enough for sixteen digits
    lam = np.exp(strain)
    pulled = law.stress(np.array([lam**-1, lam**2, 0.0, lam**-1]))
    assert pulled[1] - pulled[0] == pytest.approx(3.0 * law.shear_modulus * strain, rel=2e-4)
    sheared = law.stress(np.array([1.0 + strain**2, 1.0, strain, 1.0]))
    assert sheared[2] == pytest.approx(law.shear_modulus * strain, rel=1e-6)  # the next term is cubic
    assert law.energy(np.array([1.0 + strain**2, 1.0, strain, 1.0])) == pytest.approx(
        0.5 * law.shear_modulus * strain**2, rel=2e-4
    )


@EVERY
def test_a_factor_scales_every_stress(law: AnyLaw) -> None:
    b_bar = turned(stretches(20) ** 2, 0.4)
    # rounding of components of 1e5 Pa, of which some are differences
    np.testing.assert_allclose(law.scaled(1.7).stress(b_bar), 1.7 * law.stress(b_bar), rtol=1e-13, atol=1e-9)
    np.testing.assert_allclose(law.scaled(1.7).energy(b_bar), 1.7 * law.energy(b_bar), rtol=1e-13)


def test_a_law_knows_how_far_its_data_went() -> None:
    assert Yeoh(12e3, 0.0, 0.0, fitted_s=1.2).scaled(2.0).data_limit == 1.2
    assert LAWS["gent"].of([25e3, 4.0]).data_limit == 2.0  # it locks there
    with pytest.raises(ValueError, match="yeoh: fitted_s must be > 0, got 0"):
        Yeoh(12e3, 0.0, 0.0, fitted_s=0.0)


@EVERY
def test_inside_its_bounds_the_energy_is_positive(law: AnyLaw) -> None:
    rng = np.random.default_rng(11)
    lam = np.concatenate([stretches(2000, 1.0), stretches(2000, 0.05), modes()])
    low = np.array([spec.lower for spec in law.PARAMETERS])
    high = np.array([min(spec.upper, spec.lower + 4.0 * abs(spec.example)) for spec in law.PARAMETERS])
    first = np.where(np.arange(len(low)) == 0, law.constants(), low)  # all but one at their least
    for values in (first, *(rng.uniform(low, high) for _ in range(40))):
        item = type(law).of(values)
        assert item.outside() == ()
        energy = item.strain_energy(*lam.T)
        assert np.nanmin(energy) > -1e-12 * item.shear_modulus
        if np.isnan(energy).any():  # past locking there is no law
            assert np.isfinite(item.data_limit)


def modes() -> np.ndarray:
    """Uniaxial, equibiaxial and planar deformation, to stretches of 0.1 and 10."""
    x = np.exp(np.linspace(-2.3, 2.3, 401))
    paths = [np.stack([x, x**-0.5, x**-0.5], -1), np.stack([x, x**-1.0, np.ones_like(x)], -1)]
    return np.concatenate(paths)


def test_below_its_least_exponent_the_energy_of_veronda_and_westmann_is_negative() -> None:
    low, high = (VerondaWestmann(1e4, LEAST_EXPONENT * share) for share in (0.85, 1.0))
    biaxial = np.exp(np.linspace(0.0, 3.0, 601))
    energies = [law.strain_energy(biaxial, biaxial, biaxial**-2.0) for law in (low, high)]
    assert energies[0].min() < 0.0 <= energies[1].min()
    assert low.outside() == ("alpha = 0.119 is outside [0.14, inf]",)


@pytest.mark.parametrize("alpha", [-7.0, 0.5, 2.0, 9.0])
def test_the_quotient_of_ogden_is_smooth_where_both_stretches_meet(alpha: float) -> None:
    law, a = Ogden1(1e4, alpha), alpha / 2.0
    with localcontext(prec=60):
        for apart in (0.0, 1e-12, 1e-6, 1e-3, 0.1, 1.0, 3.0):
            b1 = np.exp(apart)
            larger, power = Decimal(float(b1)), Decimal(a)
            exact = power if apart == 0.0 else (larger**power - 1) / (larger - 1)
            exact *= Decimal(20000) / Decimal(alpha)
            # a few roundings, times the exponent
            assert law.quotient(np.array(b1), np.array(1.0)) == pytest.approx(float(exact), rel=3e-15 * 9)


def test_ogdens_own_constants_give_his_energy() -> None:
    mu, alpha = np.array([6.3e5, 1.2e3, -1e4]), np.array([1.3, 5.0, -2.0])  # Ogden 1972, for Treloar's rubber
    law = Ogden3.from_classical(mu, alpha)
    lam = stretches(50)
    expected = sum(m / a * ((lam**a).sum(axis=1) - 3.0) for m, a in zip(mu, alpha, strict=True))
    np.testing.assert_allclose(law.strain_energy(*lam.T), expected, rtol=1e-11, atol=1e-6)
    assert law.shear_modulus == pytest.approx(0.5 * (mu * alpha).sum(), rel=1e-14)
    with pytest.raises(ValueError, match="ogden3 has 3 terms, got 1 moduli and 1 exponents"):
        Ogden3.from_classical(1e4, 2.0)


def test_a_special_case_is_that_of_another_law() -> None:
    lam, mu = stretches(50), 31e3
    other = LAWS["neo_hookean"].of([mu]).strain_energy(*lam.T)
    b_bar = turned(lam**2, 0.3)
    np.testing.assert_allclose(neo_hookean(mu, last=9.0).energy(b_bar), other, rtol=1e-12)
    for law in (
        Yeoh(mu / 2.0, 0.0, 0.0),
        Ogden1(mu, 2.0),
        LAWS["mooney_rivlin"].of([mu / 2.0, 0.0, 0.0]),
        LAWS["reduced_polynomial"].of([mu / 2.0, 0.0]),
    ):
        np.testing.assert_allclose(law.strain_energy(*lam.T), other, rtol=1e-12)
    # Mooney and Rivlin's is Ogden's with exponents 2 and -2.
    pair = Ogden2(mu, 2.0, mu / 4.0, -2.0)
    both = LAWS["mooney_rivlin"].of([mu / 2.0, mu / 8.0, 0.0])
    np.testing.assert_allclose(pair.strain_energy(*lam.T), both.strain_energy(*lam.T), rtol=1e-12)
    # Far from locking these are neo-Hookean, to the order of I1 / Jm and 1 / lambda_m^2.
    for law in (LAWS["gent"].of([mu, 1e6]), LAWS["arruda_boyce"].of([mu, 1e3])):
        np.testing.assert_allclose(law.strain_energy(*lam.T), other, rtol=5e-6)


@pytest.mark.parametrize("locking", [1.2, 3.0, 7.0])
def test_arruda_and_boyces_modulus_is_the_published_series(locking: float) -> None:
    # Abaqus Theory Guide, 4.6.1; the series is exact for the five terms.
    squared = locking**-2
    factor = 1 + 3 / 5 * squared + 99 / 175 * squared**2 + 513 / 875 * squared**3 + 42039 / 67375 * squared**4
    assert LAWS["arruda_boyce"].of([2e4, locking]).shear_modulus == pytest.approx(2e4 * factor, rel=1e-14)


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("yeoh", [1.0, 2.0], r"yeoh has 3 constants \(C10, C20, C30\), got 2"),
        ("gent", [25e3, -1.0], r"gent: Jm must be in \[0.01, inf\], got -1"),
        ("arruda_boyce", [25e3, 0.5], r"arruda_boyce: lambda_m must be in \[1, inf\], got 0.5"),
        ("mooney_rivlin", [1e3, -2e3, 0.0], r"shear modulus must be > 0 Pa, got -2000 from C10 = 1000, C01"),
        ("neo_hookean", [inf], "neo_hookean: mu must be finite, got inf"),
        ("ogden1", [1e4, 0.0], r"ogden1: \|alpha\| must be >= 0.001, got 0"),
    ],
)
def test_constants_that_make_no_law_are_refused(name: str, values: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        law_class(name).of(values)


def test_a_fit_may_leave_the_bounds_and_the_law_says_so() -> None:
    law = Yeoh(12e3, -300.0, 40.0)
    assert law.outside() == ("C20 = -300 Pa is outside [0, inf]",)
    assert law.strain_energy(2.0, 2.0**-0.5, 2.0**-0.5) > 0.0


def test_an_unknown_law_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(ValueError, match=r"law must be one of \['arruda_boyce', .*'yeoh'\], got 'hooke'"):
        law_class("hooke")
