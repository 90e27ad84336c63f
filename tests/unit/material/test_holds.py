"""Viscoelastic tests: holds, Prony series, timescales and temperature."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from explicit.materials import neo_hookean
from explicit.relaxation import PronySeries
from kolsky.base.errors import InputError
from kolsky.material.fits.columns import Columns
from kolsky.material.fits.homogeneous_test import read_homogeneous_test, turning_point
from kolsky.material.reference_curve import Treatment, reference_curve
from kolsky.material.relaxation.rate_fit import (
    ApparentModuli,
    DynamicTest,
    Evidence,
    HistoryTest,
    RateModel,
    apparent_moduli,
    fit_prony,
    fitted_modulus,
    required_branches,
)
from kolsky.material.relaxation.temperature import Superposition, TemperatureSweep, superpose, wlf
from kolsky.material.uniaxial import UniaxialTest, divide_ramp_and_hold, loading_ramps, remarks_of
from kolsky.report.canvas import build
from kolsky.report.figures import RELAXATIONS

# Constant strains after a ramp: the end of the ramp, messages, and the data of the reference curve.


def record(*, held=1000.0, noise=0.0, timed=True, seed=4):
    """A ramp to 20 % in 10 s, stress 100 kPa times strain, then a hold in which it falls to 0.8."""
    rng = np.random.default_rng(seed)
    ramp, hold = np.linspace(0.0, 10.0, 101), 10.0 + np.linspace(0.0, held, 201)[1:]
    time = np.concatenate([ramp, hold])
    strain = np.minimum(0.02 * time, 0.2) + np.where(time > 10.0, noise * rng.standard_normal(time.size), 0.0)
    stress = 1e5 * np.minimum(0.02 * time, 0.2) * np.where(time > 10.0, 0.8 + 0.2 * np.exp(10.0 - time), 1.0)
    return UniaxialTest("s1", strain, stress, compression=True, time=time if timed else None)


@pytest.mark.parametrize("noise", [0.0, 3e-4])
def test_a_ramp_ends_where_its_strain_is_reached(noise):
    test = record(noise=noise)
    ramp, hold = divide_ramp_and_hold(test, loading_ramps(test)[0])
    # 0.5 % of the range before the end is reached at 9.95 s: the sample of 10.0 s, or with noise one beside.
    assert 99 <= ramp.stop - 1 <= 101
    assert hold is not None
    assert hold.duration == pytest.approx(1000.0, abs=0.2)
    assert hold.first == pytest.approx(2e4, rel=0.01)
    assert hold.last == pytest.approx(1.6e4)
    (said,) = remarks_of("s1", hold)
    assert "for 1000 s and the stress goes from 20 to 16 kPa" in said
    assert "kolsky material relaxation" in said


def test_a_steady_ramp_holds_nothing():
    time = np.linspace(0.0, 10.0, 1001)
    test = UniaxialTest("s1", 0.02 * time, 1e3 * time, compression=True, time=time)
    ramp, hold = divide_ramp_and_hold(test, slice(0, 1001))
    assert hold is None
    assert ramp == slice(0, 1001)


@pytest.mark.parametrize(("held", "found"), [(0.4, False), (0.6, True)])
def test_a_hold_is_five_per_cent_of_the_ramp(held, found):
    """Of 10 s; the ramp ends at its sample of 10 s."""
    assert (divide_ramp_and_hold(record(held=held), slice(0, 101))[1] is not None) is found


def test_without_times_samples_count():
    _, hold = divide_ramp_and_hold(record(timed=False), slice(0, 101))
    assert hold is not None
    assert hold.duration is None
    assert hold.samples == 201
    assert "for 201 samples" in remarks_of("s1", hold)[0]


def test_a_hold_without_relaxation_is_not_told():
    _, hold = divide_ramp_and_hold(record(), slice(0, 101))
    assert hold is not None
    for last, told in ((0.995, 0), (0.985, 1)):
        assert len(remarks_of("s1", type(hold)(0.2, 1.0, 9, 100.0, 100.0 * last))) == told
    assert remarks_of("s1", None) == ()


def test_a_reference_curve_leaves_the_hold_out_and_says_so():
    made = reference_curve([record(noise=3e-4)], Treatment(points=20))
    # Linear to the end: relaxed samples would bend its last point down by up to 20 %.
    np.testing.assert_allclose(made.band.stress, 1e5 * made.band.strain, rtol=5e-3)
    assert any("its strain is held at 0.2" in said for said in made.remarks)


UP = np.linspace(0.0, 0.8, 21)
COLUMNS = {"convention": "tension-positive", "strain": "strain", "stress": "stress"}


@pytest.mark.parametrize(
    ("strain", "row"),
    [
        (UP, None),
        (UP[::-1], None),
        (-UP, None),
        (np.concatenate([UP, UP[-2::-1]]), 20),
        (np.concatenate([-UP, -UP[-2::-1]]), 20),
        (np.concatenate([UP[::-1], UP[1:]]), 20),
        (np.concatenate([UP, UP[-2::-1], UP]), 20),
        (UP + 0.019 * np.cos(np.pi * np.arange(21)), None),  # goes back by less than a twentieth of 0.838
        (np.concatenate([UP[:11], [0.37, 0.375, 0.38], UP[11:]]), None),  # by 0.03, a twentieth is 0.04
        (np.concatenate([UP, UP[-2::-1], 1.2 * UP]), 20),
        (np.concatenate([-UP, UP]), None),  # a tension below a compression
    ],
)
def test_a_strain_turns_back_over_what_it_has_covered(strain: np.ndarray, row: int | None) -> None:
    assert turning_point(strain) == row


def written(folder: Path, strain: np.ndarray) -> Path:
    path = folder / "a.csv"
    rows = "\n".join(f"{e:.5f},{1e3 * e:.5f}" for e in strain)
    path.write_text(f"strain,stress (Pa)\n{rows}\n")
    return path


def test_loading_takes_the_points_up_to_the_turn(tmp_path: Path) -> None:
    path = written(tmp_path, np.concatenate([UP, UP[-2::-1]]))
    test, _ = read_homogeneous_test(path, Columns(**COLUMNS, loading=True))
    assert test.strain == pytest.approx(UP, abs=1e-5)
    with pytest.raises(InputError, match=r"turns back behind point 21, at 0.8.* --loading"):
        read_homogeneous_test(path, Columns(**COLUMNS))


def test_strains_that_may_be_per_cent_are_asked_for_their_unit(tmp_path: Path) -> None:
    path = written(tmp_path, 100.0 * UP)
    with pytest.raises(InputError, match=r"strains up to 80 without a unit, .* a stretch of 81"):
        read_homogeneous_test(path, Columns(**COLUMNS))
    assert read_homogeneous_test(path, Columns(**COLUMNS, strain_unit="%"))[0].strain.max() == 0.8
    assert read_homogeneous_test(path, Columns(**COLUMNS, strain_unit="1"))[0].strain.max() == 80.0


# Fits of Prony series to synthetic histories with known answers.

LAW = neo_hookean(20e3)
TRUTH = RateModel(1.1, PronySeries((0.4, 0.25), (3e-3, 0.2)))
ELASTIC = RateModel(0.9, PronySeries((), ()))
TIMES = np.geomspace(1e-3, 2.0, 60)
OMEGA = np.geomspace(1.0, 2000.0, 20)


def evidence(truth: RateModel, seed: int) -> list[Evidence]:
    """Relaxation after a ramp, and oscillations; noise of 60 and 400 Pa."""
    rng = np.random.default_rng(seed)
    held = HistoryTest.relaxation(TIMES, np.zeros(60), 60.0, stretch=0.8, rise=5e-4)
    stress = held.predict(LAW, [truth])[0] + 60.0 * rng.standard_normal(len(held.time))
    noise = np.full(20, 400.0)
    shaken = DynamicTest(OMEGA, noise, noise, noise, noise)
    moduli = shaken.predict(LAW, [truth])[0] + 400.0 * rng.standard_normal(40)
    return [replace(held, stress=stress), replace(shaken, storage=moduli[:20], loss=moduli[20:])]


def test_two_branches_are_found_and_a_third_is_not_asked_for() -> None:
    verdict = required_branches(LAW, evidence(TRUTH, 1), at_most=3)
    assert verdict.branches == 2
    assert "2 branches" in verdict.sentence
    fit = verdict.fit
    planted = np.log([1.1, 0.4, 0.25, 3e-3, 0.2])
    errors = (np.log(fit.values) - planted) / np.sqrt(np.diag(fit.covariance))
    assert np.abs(errors).max() < 3.5  # five normal numbers: beyond that once in 400
    assert fit.n_data == 100
    assert 60.0 < fit.chi_square < 140.0  # 95 +- 3.3 sqrt(190)
    low, high = fit.interval("time 1")
    assert low < 3e-3 < high
    assert (high / low) < 1.1


def test_elastic_data_do_not_ask_for_a_branch() -> None:
    asked = [required_branches(LAW, evidence(ELASTIC, seed), at_most=1) for seed in range(3)]
    assert [verdict.branches for verdict in asked] == [0, 0, 0]
    assert all("do not need" in verdict.sentence for verdict in asked)
    factors = [verdict.fit.model.factor for verdict in asked]
    np.testing.assert_allclose(factors, 0.9, rtol=3e-3)  # 100 values, each to 60 Pa of 12 kPa


def test_a_normalised_error_has_unit_size_over_many_draws() -> None:
    errors = []
    for seed in range(30):
        fit = fit_prony(LAW, evidence(TRUTH, 100 + seed), 2, start=TRUTH)
        planted = np.log([1.1, 0.4, 0.25, 3e-3, 0.2])
        errors.append((np.log(fit.values) - planted) / np.sqrt(np.diag(fit.covariance) / fit.scatter))
    # 150 correlated numbers; independent ones would scatter by 0.06
    assert 0.8 < np.sqrt(np.mean(np.square(errors))) < 1.2


def test_noiseless_oscillations_alone_give_the_series_back() -> None:
    moduli = [TRUTH.factor * 60e3 * f(OMEGA) for f in (TRUTH.series.storage, TRUTH.series.loss)]
    shaken = DynamicTest(OMEGA, moduli[0], moduli[1], np.full(20, 1.0), np.full(20, 1.0))
    fit = fit_prony(LAW, [shaken], 2)
    np.testing.assert_allclose(fit.values, [1.1, 0.4, 0.25, 3e-3, 0.2], rtol=1e-5)  # where the search stops


def test_a_time_that_no_test_reaches_is_said_to_be_at_its_bound() -> None:
    """Two slow tests see an instantaneous branch as a part that has gone: nothing is left of it."""
    slow = HistoryTest.relaxation(np.linspace(10.0, 100.0, 20), np.zeros(20), 50.0, stretch=0.8, rise=1.0)
    fast = RateModel(1.0, PronySeries((0.5,), (1e-4,)))
    made = replace(slow, stress=slow.predict(LAW, [fast])[0])
    assert required_branches(LAW, [made], at_most=1).branches == 0


def test_errors_name_what_is_wrong() -> None:
    ones = np.ones(3)
    with pytest.raises(ValueError, match="needs evidence"):
        fit_prony(LAW, [], 1)
    with pytest.raises(ValueError, match="n_branches must be >= 0"):
        fit_prony(LAW, evidence(TRUTH, 0), -1)
    with pytest.raises(ValueError, match="more than 5 measured values, got 3"):
        fit_prony(LAW, [HistoryTest(np.arange(3.0), ones, ones, ones)], 2)
    with pytest.raises(ValueError, match="sigma of stress must be > 0"):
        HistoryTest(np.arange(3.0), ones, ones, 0.0 * ones)
    with pytest.raises(ValueError, match="need 3 values, one per sample"):
        HistoryTest(np.arange(3.0), ones, np.ones(2), ones)
    with pytest.raises(ValueError, match=r"storage must be in \(0, inf\) Pa, got -1 at 0"):
        DynamicTest(ones, -ones, ones, ones, ones)
    with pytest.raises(ValueError, match=r"at_most must be in \[0, inf\), got -1"):
        required_branches(LAW, evidence(ELASTIC, 0), at_most=-1)
    fit = fit_prony(LAW, evidence(ELASTIC, 0), 0)
    for young, age, words in ((0.0, 1.0, "young must be in"), (1.0, -1.0, r"age must be in \[0")):
        with pytest.raises(ValueError, match=words):
            fitted_modulus(fit, young, np.array([age]))
    with pytest.raises(ValueError, match="angular_frequency must be > 0"):
        DynamicTest(np.array([0.0, 1.0, 2.0]), ones, ones, ones, ones)
    with pytest.raises(ValueError, match="times must be >= the rise"):
        HistoryTest.relaxation([0.1, 1.0], ones[:2], ones[:2], stretch=0.8, rise=0.5)
    with pytest.raises(ValueError, match="parameter must be one of factor"):
        fit_prony(LAW, evidence(ELASTIC, 0), 0).interval("time 1")


# Apparent moduli of tests of every kind on one axis of time.

TIMESCALES_LAW, YOUNG = neo_hookean(20e3), 60e3
MODEL = RateModel(1.1, PronySeries((0.4,), (0.05,)))


def relaxed(stretch: float) -> HistoryTest:
    times = np.geomspace(1e-3, 1.0, 40)
    test = HistoryTest.relaxation(times, np.zeros(40), 20.0, stretch=stretch)
    return replace(test, stress=test.predict(TIMESCALES_LAW, [MODEL])[0])


@pytest.mark.parametrize("stretch", [0.48, 0.85, 1.4])
def test_a_held_step_shows_the_relaxation_modulus_at_any_strain(stretch: float) -> None:
    shown = apparent_moduli(relaxed(stretch))
    times = np.geomspace(1e-3, 1.0, 40)
    np.testing.assert_allclose(shown.age, times, rtol=1e-12)
    # neo-Hookean: strain and time separate, as the paper's Fig. 11 relies on
    np.testing.assert_allclose(shown.modulus, 1.1 * YOUNG * MODEL.series.relaxation(times), rtol=1e-10)
    np.testing.assert_allclose(shown.sigma, 60.0 / abs(stretch - stretch**-2), rtol=1e-12)


def test_a_steady_ramp_is_half_as_old_as_it_lasts() -> None:
    time = np.linspace(0.0, 4.0, 81)
    ramp = HistoryTest(time, np.exp(-0.1 * time), -np.ones(81), np.ones(81), "ramp")
    shown = apparent_moduli(ramp)
    np.testing.assert_allclose(shown.age, 0.5 * time[-len(shown.age) :], rtol=1e-12)
    assert np.abs(shown.strain).min() >= 0.02


def test_an_oscillation_has_its_place() -> None:
    omega = np.array([1.0, 100.0])
    shown = apparent_moduli(DynamicTest(omega, np.array([6e4, 7e4]), omega, np.ones(2), np.ones(2)))
    np.testing.assert_array_equal(shown.age, [1.0, 0.01])
    np.testing.assert_array_equal(shown.modulus, [6e4, 7e4])


def test_the_fitted_curve_has_the_spread_of_its_draws() -> None:
    rng, test = np.random.default_rng(2), relaxed(0.8)
    noise = np.where(np.isfinite(test.sigma), test.sigma, 0.0)
    fit = fit_prony(
        TIMESCALES_LAW, [replace(test, stress=test.stress + noise * rng.standard_normal(len(noise)))], 1
    )
    age = np.array([1e-3, 0.03, 0.1, 1.0])
    modulus, sigma = fitted_modulus(fit, YOUNG, age)
    logs = rng.multivariate_normal(np.log(fit.values), fit.covariance, size=4000)
    drawn = np.exp(logs)
    curves = YOUNG * drawn[:, :1] * (1.0 + drawn[:, 1:2] * np.exp(-age / drawn[:, 2:]))
    np.testing.assert_allclose(sigma, curves.std(axis=0), rtol=0.08)  # 4000 draws: 1.1 %; and what is curved
    assert (np.abs(modulus - 1.1 * YOUNG * MODEL.series.relaxation(age)) < 4.0 * sigma).all()


def test_what_has_no_age_is_refused() -> None:
    time = np.linspace(0.0, 1.0, 5)
    cycle = HistoryTest(time, np.array([1.0, 0.9, 0.8, 0.9, 1.0]), np.zeros(5), np.ones(5), "cycle")
    with pytest.raises(ValueError, match="cycle: the stretch turns back at sample 3"):
        apparent_moduli(cycle)
    tiny = HistoryTest(time, np.linspace(1.0, 0.99, 5), np.zeros(5), np.ones(5), "tiny")
    with pytest.raises(ValueError, match="tiny: no sample"):
        apparent_moduli(tiny)


def test_every_kind_of_test_stands_on_one_axis() -> None:
    step = relaxed(0.8)
    omega = np.array([1.0, 100.0])
    dynamic = DynamicTest(omega, np.array([6e4, 7e4]), omega, np.ones(2), np.ones(2))
    shot = ApparentModuli("shot", *np.array([[5e-4], [-0.6], [1.1 * YOUNG], [0.01 * YOUNG]]))
    fit, age = fit_prony(TIMESCALES_LAW, [step], 1), np.geomspace(1e-3, 1.0, 20)
    shown = SimpleNamespace(
        moduli=(apparent_moduli(step), apparent_moduli(dynamic), shot),
        fitted=ApparentModuli("fitted", age, np.zeros(20), *fitted_modulus(fit, YOUNG, age)),
    )
    kind = RELAXATIONS["relaxation-moduli"]
    assert kind.applies(shown)
    assert not kind.applies(SimpleNamespace(moduli=()))
    (ax,) = build(kind, shown).axes
    assert ax.get_xscale() == "log"
    assert len(ax.containers) == 3
    drawn = ax.containers[2].lines[0]
    assert float(drawn.get_xdata()[0]) == shot.age[0]
    assert float(drawn.get_ydata()[0]) == pytest.approx(1e-3 * shot.modulus[0])


# Shift factors of temperature sweeps: the law by hand, known constants, rejected sweeps.

KELVIN = 273.15
LEVELS = np.array([-20.0, -10.0, 0.0, 10.0, 20.0, 30.0]) + KELVIN
TEMPERATURE_OMEGA = np.geomspace(0.05, 60.0, 11)
TEMPERATURE_TIMES, STRENGTHS = (
    np.geomspace(3e-6, 2e4, 12),
    1e4 * np.array([1, 2, 4, 6, 8, 8, 6, 5, 4, 3, 2, 1]),
)


def swept(law, *, noise=0.0, seed=7, levels=LEVELS, strengths=STRENGTHS):
    """A sweep of a solid of twelve Maxwell elements, lg a_T by `law` of T - 0 degC."""
    T, omega = (grid.ravel() for grid in np.meshgrid(levels, TEMPERATURE_OMEGA, indexing="ij"))
    x = (omega * 10.0 ** law(T - KELVIN))[:, None] * TEMPERATURE_TIMES
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
        reduced.angular_frequency[:11], TEMPERATURE_OMEGA * 10.0 ** wlf(-20.0, found.C1, found.C2), rtol=1e-9
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
