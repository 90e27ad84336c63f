"""Shift factors of temperature sweeps: the law by hand, known constants, rejected sweeps."""

import numpy as np
import pytest

from kolsky.material.relaxation.evidence import DynamicTest
from kolsky.material.relaxation.temperature import Superposition, TemperatureSweep, superpose, wlf

KELVIN = 273.15
LEVELS = np.array([-20.0, -10.0, 0.0, 10.0, 20.0, 30.0]) + KELVIN
OMEGA = np.geomspace(0.05, 60.0, 11)
TIMES, STRENGTHS = np.geomspace(3e-6, 2e4, 12), 1e4 * np.array([1, 2, 4, 6, 8, 8, 6, 5, 4, 3, 2, 1])


def swept(law, *, noise=0.0, seed=7, levels=LEVELS, strengths=STRENGTHS):
    """A sweep of a solid of twelve Maxwell elements, lg a_T by `law` of T - 0 degC."""
    T, omega = (grid.ravel() for grid in np.meshgrid(levels, OMEGA, indexing="ij"))
    x = (omega * 10.0 ** law(T - KELVIN))[:, None] * TIMES
    storage = 2e4 + (strengths * x**2 / (1.0 + x**2)).sum(axis=1)
    loss = (strengths * x / (1.0 + x**2)).sum(axis=1)
    rng = np.random.default_rng(seed)
    sigma = max(noise, 1e-3) * np.stack([storage, loss + 1e-3 * storage])
    storage, loss = np.stack([storage, loss]) + (noise > 0.0) * sigma * rng.standard_normal(sigma.shape)
    return TemperatureSweep(T, DynamicTest(omega, storage, loss, *sigma, label="sweep"), KELVIN)


def planted(d):
    return wlf(d, 8.86, 101.6)


def test_the_law_by_hand():
    # Williams, Landel and Ferry's universal constants 10 K above the glass transition: -17.44 * 10 / 61.6.
    assert wlf(np.array(10.0), 17.44, 51.6) == pytest.approx(-2.83117, abs=1e-5)
    assert wlf(np.array(-10.0), 17.44, 51.6) == pytest.approx(174.4 / 41.6)


def test_planted_constants_are_found():
    found = superpose(swept(planted, noise=0.01))
    assert found.determined
    assert found.one_curve
    assert found.law_holds
    assert found.covariance is not None
    u = np.sqrt(np.diag(found.covariance))
    assert abs(found.C1 - 8.86) < 3.0 * u[0] < 0.6
    assert abs(found.C2 - 101.6) < 3.0 * u[1] < 8.0
    free = found.sigma > 0.0
    assert free.sum() == 5
    assert (np.abs(found.shifts - planted(LEVELS - KELVIN))[free] < 4.0 * found.sigma[free]).all()
    # Reduced: a_T omega, the moduli as measured.
    reduced = found.reduced()
    np.testing.assert_allclose(
        reduced.angular_frequency[:11], OMEGA * 10.0 ** wlf(-20.0, found.C1, found.C2), rtol=1e-9
    )
    np.testing.assert_array_equal(reduced.storage, found.sweep.test.storage)


def test_shifts_of_another_law_are_kept_free():
    found = superpose(swept(lambda d: -0.06 * d - 8e-4 * d * np.abs(d), noise=0.01))
    assert found.determined
    assert found.one_curve
    assert not found.law_holds
    np.testing.assert_array_equal(found.adopted, found.shifts)


def test_curves_of_two_mechanisms_are_not_one():
    """Half of the solid shifts and half does not: thermorheologically complex."""
    one = swept(planted, strengths=0.5 * STRENGTHS)
    other = swept(lambda d: 0.0 * d, strengths=0.5 * STRENGTHS)
    both = DynamicTest(
        one.test.angular_frequency, one.test.storage + other.test.storage, one.test.loss + other.test.loss,
        one.test.sigma_storage, one.test.sigma_loss,
    )  # fmt: skip
    assert not superpose(TemperatureSweep(one.temperature, both, KELVIN)).one_curve


def test_an_elastic_solid_determines_no_shift():
    sweep = swept(planted)
    n, rng = sweep.temperature.size, np.random.default_rng(3)
    flat = DynamicTest(
        sweep.test.angular_frequency, 6e4 + 600.0 * rng.standard_normal(n), 50.0 * rng.standard_normal(n),
        np.full(n, 600.0), np.full(n, 50.0), label="rubber",
    )  # fmt: skip
    found = superpose(TemperatureSweep(sweep.temperature, flat, KELVIN))
    assert not found.determined
    assert found.C1 is None
    with pytest.raises(ValueError, match=r"rubber: the shift at .* is not determined"):
        found.reduced()


def test_verdicts_at_their_limits():
    sweep = swept(planted)
    none = np.zeros(6)

    def made(**changed):
        given = {"sigma": none, "scatter": 1.0, "likely": 1.0, "C1": 8.0, "C2": 100.0, "law_likely": 1.0}
        return Superposition(sweep, none, **(given | changed))

    assert made(sigma=np.full(6, 0.499)).determined
    assert not made(sigma=np.full(6, 0.501)).determined
    assert made(likely=0.0101).one_curve
    assert not made(likely=0.0099).one_curve
    assert made(law_likely=0.0101).law_holds
    assert not made(law_likely=0.0099).law_holds
    assert not made(C1=None).law_holds


def test_two_temperatures_tell_a_shift_and_no_law():
    found = superpose(swept(planted, noise=0.01, levels=LEVELS[2:4]))
    assert found.C1 is None
    assert found.shifts[1] == pytest.approx(planted(10.0), abs=4.0 * found.sigma[1])


def test_temperatures_near_each_other_are_one_and_the_reference_is_measured():
    test = DynamicTest(np.ones(3), np.ones(3), np.ones(3), np.ones(3), np.ones(3), label="x")
    near = TemperatureSweep(KELVIN + np.array([0.0, 20.1, 19.9]), test, KELVIN)
    np.testing.assert_allclose(near.levels - KELVIN, [0.0, 20.0])
    np.testing.assert_array_equal(near.level, [0, 1, 1])
    with pytest.raises(ValueError, match=r"the reference, 5\.0 °C, is not one of the measured"):
        TemperatureSweep(KELVIN + np.array([0.0, 20.0, 40.0]), test, KELVIN + 5.0)
    with pytest.raises(ValueError, match="needs two temperatures"):
        TemperatureSweep(np.full(3, KELVIN), test, KELVIN)
    with pytest.raises(ValueError, match="above absolute zero"):
        TemperatureSweep(np.array([-1.0, 1.0, 2.0]), test, KELVIN)
