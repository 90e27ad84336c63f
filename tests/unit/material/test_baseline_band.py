"""Bands with common modes, toes, ramps, compliance and E_a, against closed forms."""

import numpy as np
import pytest
from scipy.stats import t as student

from kolsky.base.records import MaterialCurve
from kolsky.inverse.forward import curve_replicates
from kolsky.material.reference_curve import Treatment, reference_curve, softening
from kolsky.material.uniaxial import (
    CurveBand,
    Toe,
    UniaxialTest,
    apparent_modulus,
    correct_toe,
    loading_ramps,
    mean_of_repeats,
    resample,
    student_factor,
)

STRAIN = np.linspace(0.005, 0.5, 100)
E = 60e3


def gaussian(strain: np.ndarray) -> np.ndarray:
    """Nominal stress of Gaussian rubber elasticity in compression, Eq. (M.9) [Pa]."""
    lam = 1.0 - strain
    return E / 3.0 * (lam**-2 - lam)


def specimen(name: str, strain: np.ndarray, stress: np.ndarray, **more: np.ndarray) -> UniaxialTest:
    return UniaxialTest(name, strain, stress, compression=True, **more)


def test_modes_of_repeats_are_the_covariance_of_the_mean():
    rng = np.random.default_rng(3)
    values = gaussian(STRAIN) * (1.0 + 0.05 * rng.standard_normal((6, 1))) + 50.0 * rng.standard_normal(
        (6, 100)
    )
    band = mean_of_repeats(STRAIN, values)
    widened = student.ppf(0.977249868, 5) / 2.0  # two-sided 95.45 %, the k = 2 of a normal distribution
    expected = np.cov(values, rowvar=False) / 6.0 * widened**2
    assert band.modes.T @ band.modes == pytest.approx(expected, rel=1e-6, abs=1e-6 * expected.max())
    assert band.modes.shape == (5, 100)  # n - 1 independent differences
    assert student_factor(5) == pytest.approx(widened, rel=1e-6)  # nine digits of the probability


def test_one_scale_is_not_averaged_away_in_the_mean_modulus():
    stress = gaussian(STRAIN)
    common = CurveBand(STRAIN, stress, 0.0 * stress, 0.05 * stress[None], ("scale",))
    alone = CurveBand(STRAIN, stress, 0.05 * stress, np.empty((0, 100)), ())
    assert apparent_modulus(common, compression=True).mean_sigma == pytest.approx(0.05 * E)  # all of it
    assert apparent_modulus(alone, compression=True).mean_sigma == pytest.approx(0.005 * E)  # 1 / sqrt(100)
    assert apparent_modulus(common, compression=True).modulus == pytest.approx(np.full(100, E))


def test_replicates_of_a_shots_curve_keep_the_modes_together():
    stress = -gaussian(STRAIN)
    curve = MaterialCurve(1.0 - STRAIN, stress, np.zeros(100), modes=0.05 * stress[None])
    laws = curve_replicates(curve, 400, np.random.default_rng(5))
    ends = np.array([law.two_u_prime(np.array([0.1, 0.8])) for law in laws]) / (E / 3.0) - 1.0
    # The law is linear in the stress: both ends have the draw's factor, to the table's interpolation.
    assert ends[:, 0] == pytest.approx(ends[:, 1], abs=1e-6)
    assert ends.std() == pytest.approx(0.05, rel=0.15)  # 400 draws: 3.5 %, four of those


def test_a_line_through_samples_is_read_off_exactly_and_its_noise_is_found():
    rng = np.random.default_rng(2)
    x = np.linspace(0.0, 1.0, 3001)
    value, noise = resample(x, 3.0 * x + 1.0, np.linspace(0.1, 0.9, 9))
    assert value == pytest.approx(3.0 * np.linspace(0.1, 0.9, 9) + 1.0, rel=1e-12)
    assert noise < 1e-12
    with pytest.raises(ValueError, match=r"axis must be in \[.*\], got 2 at 1"):
        resample(x, x, np.array([0.5, 2.0]))
    with pytest.raises(ValueError, match="value must be finite, got nan at 0"):
        resample(x, x * np.nan, np.array([0.1, 0.5]))
    _, noise = resample(x, 3.0 * x + 0.2 * rng.standard_normal(x.size), np.linspace(0.1, 0.9, 9))
    assert noise == pytest.approx(0.2, rel=0.1)  # a median of 3000: 2.5 %, four of those


@pytest.mark.parametrize("offset", [0.0, 0.01, -0.004])
def test_gaussian_toe_finds_a_planted_offset(offset: float):
    recorded = np.linspace(0.002, 0.4, 400)
    stress = gaussian(np.maximum(recorded - offset, 0.0))
    begun = correct_toe(specimen("a", recorded, stress), Toe("gaussian", 0.03, 0.12))
    assert begun.offset == pytest.approx(offset, abs=1e-6)  # its own curve: converged
    assert begun.test.strain[0] >= 0.03 - offset - 1e-12


def test_line_toe_is_the_straight_lines_zero():
    recorded = np.linspace(0.0, 0.1, 101)
    begun = correct_toe(specimen("a", recorded, 5e4 * (recorded - 0.012)), Toe("line", 0.03, 0.08))
    assert begun.offset == pytest.approx(0.012, abs=1e-9)


def test_a_toes_range_without_samples_is_refused():
    with pytest.raises(ValueError, match=r"a: 0 samples have a strain from 0\.6 to 0\.7"):
        correct_toe(specimen("a", STRAIN, gaussian(STRAIN)), Toe("gaussian", 0.6, 0.7))


def test_ramps_of_a_cyclic_record():
    rng = np.random.default_rng(4)
    up = np.linspace(0.0, 0.5, 200)
    strain = np.concatenate([up, up[::-1], up, up[::-1], up]) + 1e-4 * rng.standard_normal(1000)
    ramps = loading_ramps(specimen("cycles", strain, strain))
    assert len(ramps) == 3
    for ramp, start in zip(ramps, (0, 400, 800), strict=True):
        assert ramp.start == pytest.approx(start, abs=3)  # noise moves the turning sample a little
        assert ramp.stop == pytest.approx(start + 200, abs=3)


def test_first_pull_and_conditioned_are_kept_apart():
    up = np.linspace(0.0, 0.5, 200)
    strain = np.concatenate([up, up[::-1][1:], up[1:]])
    softer = np.concatenate([np.ones(200), np.full(398, 0.8)])
    tests = [
        specimen(f"s{i}", strain, f * softer * gaussian(strain)) for i, f in enumerate((0.98, 1.0, 1.02))
    ]
    first, last = (reference_curve(tests, Treatment(), pull=pull) for pull in ("first", "conditioned"))
    # Mean over a spacing of a convex curve: 1e-4 of E_a.
    assert first.modulus.modulus == pytest.approx(np.full(60, E), rel=2e-3)
    assert last.modulus.modulus == pytest.approx(np.full(60, 0.8 * E), rel=2e-3)
    with pytest.raises(ValueError, match="one loading ramp"):
        reference_curve([specimen("a", up, gaussian(up))], Treatment(), pull="conditioned")
    with pytest.raises(ValueError, match="pull must be 'first' or 'conditioned', got 'last'"):
        reference_curve(tests, Treatment(), pull="last")  # type: ignore[arg-type]
    for name in ("compliance", "bulge_sigma"):
        with pytest.raises(ValueError, match=rf"{name} must be in \[0, inf\), got -1e-07"):
            Treatment(**{name: -1e-7})


def test_machine_in_series_is_taken_off():
    area, length, compliance = 7.1e-5, 6.5e-3, 2e-5
    measured = STRAIN + compliance * area * gaussian(STRAIN) / length
    cured = specimen("a", measured, gaussian(STRAIN)).without_machine(compliance, area=area, length=length)
    assert cured.strain == pytest.approx(STRAIN, rel=1e-12)
    with pytest.raises(ValueError, match="would explain the whole displacement"):
        specimen("a", STRAIN, gaussian(STRAIN)).without_machine(1e-1, area=area, length=length)


def test_band_covers_the_true_mean_as_often_as_it_says():
    rng = np.random.default_rng(11)
    axis, inside, trials = STRAIN[::10], 0, 600
    for _ in range(trials):
        values = gaussian(axis) * (1.0 + 0.05 * rng.standard_normal((4, 1)))
        low, high = mean_of_repeats(axis, values).interval()
        inside += bool(low[3] <= gaussian(axis)[3] <= high[3])
    # 95.45 % of 600 with a binomial sigma of 0.85 %: three of those.
    assert inside / trials == pytest.approx(0.9545, abs=0.026)


def test_times_and_one_test_alone_are_said():
    found = reference_curve([specimen("a", STRAIN, gaussian(STRAIN), time=STRAIN / 0.01 + 3.0)], Treatment())
    assert found.modulus.time == pytest.approx(found.modulus.strain / 0.01, rel=1e-9)  # constant rate
    assert any("one test" in remark for remark in found.remarks)


def test_tension_and_compression_do_not_mix():
    tension = UniaxialTest("t", STRAIN, STRAIN, compression=False)
    with pytest.raises(ValueError, match="one branch"):
        reference_curve([tension, specimen("c", STRAIN, gaussian(STRAIN))], Treatment())


def test_softening_compares_each_specimen_with_itself():
    # Specimens that differ by a tenth, each softer in its last ramp by a factor that differs by 0.02.
    up = np.linspace(0.0, 0.5, 200)
    strain = np.concatenate([up, up[::-1][1:], up[1:]])
    part = np.repeat([1.0, 0.0, 0.0], [200, 199, 199])
    tests = [
        specimen(str(k), strain, scale * (part + (1.0 - part) * factor) * gaussian(strain))
        for k, (scale, factor) in enumerate([(0.9, 0.78), (1.0, 0.80), (1.1, 0.82)])
    ]
    first, last = (reference_curve(tests, Treatment(), pull=pull) for pull in ("first", "conditioned"))
    ratio, sigma = softening(first, last)
    assert ratio == pytest.approx(0.8, rel=1e-9)  # the curve's shape cancels at every strain
    assert sigma == pytest.approx(0.02 / 3**0.5 * student.ppf(0.977249868, 2) / 2.0, rel=1e-6)
    one, other = (reference_curve(tests[:1], Treatment(), pull=pull) for pull in ("first", "conditioned"))
    assert softening(one, other) == (pytest.approx(0.78), pytest.approx(float("nan"), nan_ok=True))
