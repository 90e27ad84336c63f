"""Repeated tests: mean, scatter and band by hand; coverage of the band."""

import numpy as np
import pytest

from kolsky.bars.records import FaceWaves
from kolsky.bars.reduction.repeated_tests import Curve, average, repeated_tests, rising
from kolsky.bars.reduction.stress_strain import reduce
from kolsky.base.apparatus import Bar, Specimen

X = np.linspace(0.0, 0.4, 81)


def curve(name, value, axis=X, sigma=None):
    return Curve(name, np.asarray(axis, dtype=float), np.asarray(value, dtype=float), sigma)


def test_three_straight_lines_by_hand():
    made = average([curve(f"t{k}", (10.0 + k) * X, sigma=np.full(X.size, 0.1 * k)) for k in (-1, 0, 1)])
    np.testing.assert_allclose(made.axis, X, atol=1e-16)
    np.testing.assert_allclose(made.mean, 10.0 * X, rtol=1e-13)
    np.testing.assert_allclose(made.scatter, X, rtol=1e-12)  # of 9, 10, 11: 1
    np.testing.assert_allclose(made.sigma, X / np.sqrt(3.0), rtol=1e-12)
    low, high = made.band()
    np.testing.assert_allclose(high - made.mean, 4.3027 * X / np.sqrt(3.0), rtol=2e-5)  # t_95(2), printed
    np.testing.assert_allclose(made.mean - low, high - made.mean, rtol=1e-12)
    np.testing.assert_allclose(made.within, 0.1 * np.sqrt(2.0 / 3.0), rtol=1e-12)
    assert (made.count, made.freedom, made.remarks) == (3, 2, ())


def test_what_all_tests_share_is_not_averaged_away():
    made = average([curve(f"t{k}", 5.0 + k + 0.0 * X) for k in (-1.0, 1.0)])
    # Scatter sqrt(2), of the mean 1, and 2 that is shared.
    u, nu = made.combined(2.0)
    np.testing.assert_allclose(u, np.sqrt(5.0))
    np.testing.assert_allclose(nu, 25.0)  # Welch and Satterthwaite: 1 * (sqrt 5 / 1)^4
    np.testing.assert_allclose(made.band(shared=2.0)[1] - 5.0, 2.0595 * np.sqrt(5.0), rtol=1e-4)  # t_95(25)
    same = average([curve("a", X), curve("b", X)])
    np.testing.assert_allclose(same.band(shared=1.0)[1] - X, 1.95996, rtol=1e-5)  # no scatter: normal


def test_unequal_ranges_are_cut_and_said():
    long = curve("long", 2.0 * X)
    short = curve("short", 2.0 * X[10:51], X[10:51])
    made = average([long, short])
    assert (made.axis[0], made.axis[-1]) == (X[10], X[50])
    assert made.axis.size == 41
    assert made.remarks == ("long: 0 to 0.4 cut to the common range 0.05 to 0.25",)
    np.testing.assert_allclose(made.mean, 2.0 * made.axis, rtol=1e-13)
    assert average([long, short], points=5).axis.size == 5


def test_interpolation_is_linear():
    coarse = curve("coarse", X[::8] ** 2, X[::8])
    made = average([coarse, coarse], points=81)
    # h^2 / 8 times the second derivative, 2, at most.
    off = made.mean - X**2
    assert off.min() > -1e-15
    assert off.max() == pytest.approx(0.04**2 / 4.0, rel=1e-9)


@pytest.mark.parametrize("tests", [2, 5])
def test_the_band_holds_the_truth_as_often_as_it_says(tests):
    rng = np.random.default_rng(tests)
    x = np.linspace(0.0, 1.0, 3)
    held = 0
    for _ in range(2000):
        made = average([curve(f"t{k}", x + rng.standard_normal(), x) for k in range(tests)])
        low, high = made.band()
        held += bool(low[1] <= 0.5 <= high[1])
    assert held / 2000 == pytest.approx(0.95, abs=0.02)  # 0.5 %, four of them


@pytest.mark.parametrize(
    ("curves", "message"),
    [
        ([curve("a", X)], "at least 2 tests, got 1"),
        ([curve("a", X), curve("b", X, X + 1.0)], "no range in common: b starts at 1, a ends at 0.4"),
        ([curve("a", X), curve("b", X[:-1])], "b: axis, value and sigma need one length"),
        ([curve("a", X), curve("b", X, np.minimum(X, 0.3))], r"b: the axis must increase, .* at point 61"),
        ([curve("a", X), curve("b", np.where(X > 0.2, np.nan, X))], "b: every axis value"),
    ],
)
def test_impossible_repeats_are_refused(curves, message):
    with pytest.raises(ValueError, match=message):
        average(curves)


def test_impossible_options_are_refused():
    pair = [curve("a", X), curve("b", X)]
    with pytest.raises(ValueError, match="at least 2 points, got 1"):
        average(pair, points=1)
    with pytest.raises(ValueError, match=r"inside \(0, 1\), got 95"):
        average(pair).band(95)


@pytest.mark.parametrize(
    ("value", "first", "last"),
    [
        ([0, 1, 2, 3], 0, 3),
        ([3, 1, 0, 1, 2, 2], 2, 4),
        ([0, 1, 0, 1, 2, 1], 2, 4),
        ([0, 1, 0, 1], 0, 1),
    ],
)
def test_the_longest_rise(value, first, last):
    found = rising(np.array(value, dtype=float))
    assert (found.start, found.stop - 1) == (first, last)


def test_a_strain_without_rise_is_refused():
    with pytest.raises(ValueError, match="does not increase anywhere"):
        rising(np.array([2.0, 1.0, 1.0]))


BAR = Bar(diameter=20e-3, length=2.0, youngs_modulus=210e9, density=7800.0)
SPECIMEN = Specimen(diameter=10e-3, length=4e-3, density=1180.0)
TIME = 1e-6 * np.arange(200)


def reduction(strength, rate):
    """Balanced test at one rate after a ramp, unloaded at the end."""
    shape = np.interp(TIME, [10e-6, 30e-6, 150e-6, 170e-6, 199e-6], [0.0, 1.0, 1.0, -0.1, -0.1])
    reflected = -rate * shape * SPECIMEN.length / (2.0 * BAR.wave_speed)
    area = np.pi / 4.0 * BAR.diameter**2
    transmitted = strength * shape * SPECIMEN.area / (BAR.youngs_modulus * area)
    return reduce(
        FaceWaves(
            TIME,
            incident=transmitted - reflected,
            reflected=reflected,
            transmitted=transmitted,
            sigma={"incident": 1e-7, "reflected": 1e-7, "transmitted": 1e-7},
            incident_bar=BAR,
            transmission_bar=BAR,
        ),
        SPECIMEN,
    )


def test_reductions_of_repeated_tests():
    made = repeated_tests({"a": reduction(100e6, 1000.0), "b": reduction(120e6, 1200.0)})
    assert made.unit == "Pa"
    flat = (made.repeats.axis > 0.05) & (made.repeats.axis < 0.11)
    np.testing.assert_allclose(made.repeats.mean[flat], 110e6, rtol=1e-9)
    np.testing.assert_allclose(made.repeats.scatter[flat], 20e6 / np.sqrt(2.0), rtol=1e-9)
    single = reduction(100e6, 1000.0).stress["three waves"].sigma[0]
    np.testing.assert_allclose(made.shared, single, rtol=1e-12)
    np.testing.assert_allclose(made.history().sigma[flat], np.hypot(10e6, single), rtol=1e-9)
    # t_95 = 12.706 with one degree of freedom; what is shared raises the degrees by 1e-6 here.
    np.testing.assert_allclose(made.band()[1][flat] - 110e6, 12.706 * 10e6, rtol=1e-3)
    # Constant rate from 30 to 150 us, ramps half of 20 us: 0.130 and 0.156; the strain falls behind 168 us.
    assert made.repeats.axis[-1] == pytest.approx(
        0.5 * 1000 * 20e-6 + 1000 * 120e-6 + 0.5 * 1000 * 18.2e-6, rel=2e-3
    )
    assert [remark[:20] for remark in made.repeats.remarks] == [
        "a: loading from stra",
        "b: loading from stra",
        "b: 0 to 0.1669 cut t",
    ]


def test_one_test_has_no_mean():
    with pytest.raises(ValueError, match="at least 2 tests, got 1"):
        repeated_tests({"a": reduction(100e6, 1000.0)})
