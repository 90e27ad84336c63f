"""Budgets of a test: closed forms, inputs by name, and uncertainties carried from step to step."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from elastic_layer import Layer
from monte_carlo import monte_carlo, red_noise
from softflyer import Flight

from kolsky.bars.budget import budget_table, merge_quantities, propagate
from kolsky.bars.flyer.events import _full_speed
from kolsky.bars.flyer.flight import Flight as Paths
from kolsky.bars.flyer.flight import symmetry_end
from kolsky.bars.flyer.path import FlyerPath, fit_flyer
from kolsky.bars.guides.propagation import wave_speed
from kolsky.bars.records import BarSignal, FaceWaves, Quantity, Signal, Windows
from kolsky.bars.reduction import varied_test
from kolsky.bars.reduction.analyse import analyse
from kolsky.bars.reduction.separation import face_waves
from kolsky.bars.reduction.stress_strain import reduce
from kolsky.bars.reduction.windows import StationInput, WavesInput, find_windows
from kolsky.bars.signals.bridge import Linear
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.records import Recording

# Budgets and draws against closed forms; printed examples are in the verification manual.


def q(name, value, sigma, freedom=np.inf, kind="B"):
    return Quantity(name, value, sigma, "1", kind, freedom)


FOUR = [q(name, 0.0, 1.0) for name in "abcd"]


def test_supplement_1_loss_is_beyond_a_straight_line():
    # JCGM 101:2008, 9.4, table 6: X1^2 + X2^2 at 0.010 and 0, u = 0.005: GUM 100e-6 +- 100e-6, true 150, 112.
    inputs = [q("X1", 0.010, 0.005), q("X2", 0.0, 0.005)]
    budget = propagate(lambda v: {"loss": v["X1"] ** 2 + v["X2"] ** 2}, inputs)
    assert budget.value["loss"] == pytest.approx(100e-6)
    assert budget.sigma("loss") == pytest.approx(100e-6)
    np.testing.assert_allclose(budget.curvature["loss"], 25e-6, rtol=1e-9)  # u^2 of each: the missing 50e-6
    assert budget.nonlinearity("loss") == pytest.approx(0.25)
    spread = monte_carlo(
        lambda v, rng: {"loss": v["X1"] ** 2 + v["X2"] ** 2},
        inputs,
        trials=20_000,
        rng=np.random.default_rng(4),
    )["loss"]
    assert spread.mean == pytest.approx(150e-6, rel=0.022)  # four of 112 / sqrt(20 000)
    assert spread.sigma == pytest.approx(112e-6, rel=0.04)  # 0.5 % and more, as the tail is long


def test_histories_sample_by_sample():
    t = np.linspace(0.0, 1.0, 11)
    inputs = [q("a", 3.0, 0.1, 10.0), q("b", -2.0, 0.2), q("known", 5.0, 0.0)]
    noise = np.full(t.size, 0.05)
    budget = propagate(
        lambda v: {"y": v["a"] * t + v["b"] * t**2 + v["known"], "z": v["a"] ** 2}, inputs, noise={"y": noise}
    )
    u = np.sqrt((0.1 * t) ** 2 + (0.2 * t**2) ** 2 + 0.05**2)
    np.testing.assert_allclose(budget.sigma("y"), u, rtol=1e-12)
    np.testing.assert_allclose(budget.freedom("y")[1:], u[1:] ** 4 / ((0.1 * t[1:]) ** 4 / 10), rtol=1e-9)
    assert budget.freedom("y")[0] == np.inf  # nothing but noise there
    assert budget.coverage_factor("y")[0] == pytest.approx(1.96, abs=1e-3)
    history = budget.history("y", "N")
    np.testing.assert_allclose(history.sigma, u, rtol=1e-12)
    assert budget.sigma("z") == pytest.approx(0.6)
    numbers = budget_table(budget, {"y at the end": ("y", 10, "N"), "z": ("z", None, "N2")})
    (b,) = (row for row in numbers.contributions if row.quantity.name == "b")
    assert b.sensitivity["y at the end"] == pytest.approx(1.0)
    assert b.shares["y at the end"] == pytest.approx(0.04 / u[10] ** 2)
    assert numbers.results["y at the end"][:2] == pytest.approx((6.0, u[10]))
    assert [c.quantity.name for c in numbers.contributions][3:] == ["noise, y at the end", "noise, z"]
    for name in numbers.results:
        assert sum(c.shares.get(name, 0.0) for c in numbers.contributions) == pytest.approx(1.0)


def test_full_correlation_adds_linearly_and_cancels():
    inputs = [q("a", 1.0, 0.3), q("b", 1.0, 0.4)]
    pairs = {("a", "b"): 1.0}
    budget = propagate(
        lambda v: {"sum": v["a"] + v["b"], "difference": 4 * v["a"] - 3 * v["b"]}, inputs, correlations=pairs
    )
    assert budget.sigma("sum") == pytest.approx(0.7)
    assert budget.sigma("difference") == pytest.approx(0.0, abs=1e-8)  # root of round-off, 1e-16


def test_a_model_that_jumps_is_refused():
    # A window whose end moves by whole samples: the second step is half the first and sees another slope.
    def model(v):
        return {"y": np.array([np.round(v["a"])])}

    with pytest.raises(ValueError, match=r"y: differences .* disagree by .* most with a, 0\.6 1, by 1"):
        propagate(model, [q("b", 1.0, 0.1), q("a", 3.0, 0.6)])


def test_products_of_quantities_are_seen():
    # GUM 5.1.2, note: where the slopes are zero the second order is all there is.
    inputs = [q("a", 0.0, 0.2), q("b", 0.0, 3.0), q("c", 1.0, 0.1)]
    budget = propagate(lambda v: {"y": v["a"] * v["b"] + v["c"]}, inputs)
    assert budget.sigma("y") == pytest.approx(0.1)
    assert abs(budget.interaction["y"]) == pytest.approx(0.2 * 3.0)
    assert budget.nonlinearity("y") == pytest.approx(6.0)


def test_a_model_at_the_round_off_is_refused():
    with pytest.raises(ValueError, match="disagree"):
        propagate(lambda v: {"y": v["a"] + 1e16}, [q("a", 1.0, 3.0)])


@pytest.mark.parametrize(
    ("quantity", "message"),
    [
        (q("a", 1.0, 2.0), "the model fails at a = -1 1: root of -1"),
        (q("a", 1.0, 1.0), "output y is not finite at sample 0 with a = 0 1"),
    ],
)
def test_impossible_budgets_are_refused(quantity, message):
    def model(v):
        if v["a"] < 0.0:
            raise ValueError(f"root of {v['a']:.0f}")
        return {"y": np.log(v["a"]) if v["a"] > 0.0 else -np.inf}

    with pytest.raises(ValueError, match=message):
        propagate(model, [quantity])


def test_outputs_keep_their_shapes():
    with pytest.raises(ValueError, match="change their names or shapes with a = 0"):
        propagate(lambda v: {"y": np.zeros(3 + int(v["a"] < 1.0))}, [q("a", 1.0, 1.0)])


def test_quantities_that_are_listed_twice():
    assert merge_quantities([*FOUR, FOUR[1]]) == FOUR
    assert (
        merge_quantities([q("a", 0.0, 0.0), FOUR[0]])
        == merge_quantities([FOUR[0], q("a", 0.0, 0.0)])
        == FOUR[:1]
    )
    with pytest.raises(ValueError, match="quantity 'a' is stated twice"):
        merge_quantities([FOUR[0], q("a", 0.1, 0.0)])
    with pytest.raises(ValueError, match="quantity 'a' is stated twice"):
        merge_quantities([FOUR[0], q("a", 0.0, 2.0)])


def test_noise_goes_through_the_model_by_draws():
    # The integral of red noise: the sum of its covariances, draws through the same sum.
    rho = 0.8 ** np.arange(60.0)
    lag = np.abs(np.subtract.outer(np.arange(50), np.arange(50)))
    sigma = 2.0 * np.sqrt((0.8**lag).cumsum(axis=0).cumsum(axis=1).diagonal())
    slope = 0.5 * np.arange(50.0)
    spread = monte_carlo(
        lambda v, rng: {"y": np.cumsum(v["a"] + red_noise(2.0, rho, 50, rng))},
        [q("a", 0.5, 0.0)],
        trials=4000,
        rng=np.random.default_rng(5),
    )["y"]
    np.testing.assert_allclose(spread.sigma, sigma, rtol=0.045)  # 1.1 %, four of them
    # Four standard errors of the mean.
    assert (np.abs(spread.mean - 0.5 - slope) < 4.5 * sigma / np.sqrt(4000)).all()


# Inputs of a test's budget by name and value, and their effects on the results in closed form.

BAR = Bar(diameter=15e-3, length=1.5, youngs_modulus=190e9, density=8048.0, poisson=0.29)
SPECIMEN = Specimen(diameter=10e-3, length=5e-3, density=1200.0)
UNCERTAINTY = {
    "bar_modulus": 0.01, "bar_density": 0.002, "bar_diameter": 0.003, "bar_poisson": 0.004,
    "specimen_diameter": 0.005, "specimen_length": 0.006, "gauge_distance": 7e-4, "gauge_calibration": 0.008,
}  # fmt: skip


FEW = ("specimen_diameter", "specimen_length", "gauge_distance", "gauge_calibration")


def plain(quantities):
    return {q.name: (pytest.approx(q.value), pytest.approx(q.sigma), q.unit, q.kind) for q in quantities}


def test_quantities_of_a_bar():
    assert plain(varied_test.bar_quantities(BAR, "incident", UNCERTAINTY)) == {
        "incident bar, Young's modulus": (190e9, 1.9e9, "Pa", "B"),
        "incident bar, density": (8048.0, 16.096, "kg/m^3", "B"),
        "incident bar, diameter": (15e-3, 45e-6, "m", "B"),
        "incident bar, Poisson's ratio": (0.29, 0.004, "1", "B"),
    }
    measured = varied_test.bar_quantities(BAR, "incident", {**UNCERTAINTY, "bar_wave_speed": 0.001})
    assert (measured[0].name, measured[0].unit) == ("incident bar, wave speed", "m/s")
    assert measured[0].sigma == pytest.approx(1e-3 * BAR.wave_speed)


def test_quantities_of_lengths():
    positions = {"incident": 0.75, "transmission": 0.5, "incident far": 1.1}
    assert plain(varied_test.length_quantities(SPECIMEN, positions, UNCERTAINTY)) == {
        "specimen, diameter": (10e-3, 50e-6, "m", "B"),
        "specimen, length": (5e-3, 30e-6, "m", "B"),
        "incident gauge, distance": (0.75, 7e-4, "m", "B"),
        "transmission gauge, distance": (0.5, 7e-4, "m", "B"),
        "incident far gauge, distance": (1.1, 7e-4, "m", "B"),
    }


def test_other_values_of_the_quantities():
    values = {
        "incident bar, density": 8000.0,
        "incident bar, wave speed": 5000.0,
        "incident bar, diameter": 0.016,
    }
    found = varied_test.varied_bar(BAR, "incident", values)
    assert (found.youngs_modulus, found.density, found.diameter) == (pytest.approx(200e9), 8000.0, 0.016)
    assert varied_test.varied_bar(BAR, "transmission", values) == BAR
    found = varied_test.varied_bar(
        BAR, "incident", {"incident bar, Young's modulus": 2e11, "incident bar, Poisson's ratio": 0.3}
    )
    assert (found.youngs_modulus, found.poisson) == (2e11, 0.3)
    size = varied_test.varied_specimen(SPECIMEN, {"specimen, diameter": 0.011, "specimen, length": 0.006})
    assert (size.diameter, size.length) == (0.011, 0.006)
    assert varied_test.varied_position(0.5, "incident", {"incident gauge, distance": 0.6}) == 0.6
    assert varied_test.varied_position(0.5, "transmission", {"incident gauge, distance": 0.6}) == 0.5


def given(**changes):
    """A test in a made-up record: an elastic specimen, strains recorded as such."""
    scene = Layer(rise=30e-6)
    signals = scene.signals(noise=1e-6)
    stations = {}
    for side, signal in zip(("incident", "transmission"), signals, strict=True):
        strain = signal.strain
        recording = Recording(strain.time, strain.value, side, "1", Path("scope.csv"), "0" * 64)
        stations[side] = StationInput(
            (recording,),
            Linear(1.0, unit="1"),
            signal.position,
            (strain.start, strain.start + 20e-6),
            0.0,
            (1,),
        )
    bars = {"incident": scene.first, "transmission": scene.second}
    options = {"stations": stations, "bars": bars, "uncertainty": UNCERTAINTY, **changes}
    return WavesInput("made", scene.specimen, **options)


def test_every_input_is_in_the_budget():
    test = given()
    zero = Quantity("{} gauge, zero", 0.0, 1e-7, "1", "A", 10.0)
    stations = {
        side: SimpleNamespace(quantities=[replace(zero, name=f"{side} gauge, zero")]) for side in test.bars
    }
    names = {q.name for q in varied_test.budget_quantities(test, stations)}
    assert names == {
        "specimen, diameter",
        "specimen, length",
        "specimen, density",
        *(
            f"{side} {what}"
            for side in ("incident", "transmission")
            for what in (
                "gauge, zero", "gauge, distance", "bar, Young's modulus", "bar, density", "bar, diameter",
                "bar, Poisson's ratio",
            )
        ),
    }  # fmt: skip


def test_bars_of_one_rod_have_their_errors_in_common():
    quantities = [
        *varied_test.bar_quantities(BAR, "incident", {}),
        *varied_test.bar_quantities(BAR, "transmission", {}),
    ]
    assert varied_test.bar_correlations(given(), quantities) == {}
    assert varied_test.bar_correlations(given(alike=True), quantities) == {
        (f"incident bar, {what}", f"transmission bar, {what}"): 1.0
        for what in ("Young's modulus", "density", "diameter", "Poisson's ratio")
    }
    assert varied_test.bar_correlations(given(alike=True), quantities[:4]) == {}


def test_shares_of_the_budget_are_those_of_the_formulas():
    """Three-wave stress: E A (e_i + e_r + e_t) / 2 A_s; strain: c / L times integrals."""
    found = analyse(given(uncertainty={key: UNCERTAINTY[key] for key in FEW}))
    stress, sigma, _ = found.budget.results["peak stress"]
    strain, spread, _ = found.budget.results["largest strain"]
    rows = {row.quantity.name: row for row in found.budget.contributions}
    # Stress goes with 1 / d^2, strain with 1 / L; both with the calibration, of which the incident gauge's
    # waves and the transmitted one's carry half the stress each in equilibrium.
    assert rows["specimen, diameter"].shares["peak stress"] == pytest.approx(
        (2 * 0.005 * stress / sigma) ** 2, rel=1e-3
    )
    assert rows["specimen, length"].shares["largest strain"] == pytest.approx(
        (0.006 * strain / spread) ** 2, rel=1e-3
    )
    assert rows["specimen, length"].shares["peak stress"] == pytest.approx(0.0, abs=1e-9)
    half = (0.5 * 0.008 * stress / sigma) ** 2
    assert rows["transmission gauge, strain per volt"].shares["peak stress"] == pytest.approx(half, rel=0.2)
    for side in ("incident", "transmission"):
        assert rows[f"{side} gauge, distance"].quantity.sigma == 7e-4
        assert rows[f"{side} gauge, distance"].shares["largest strain"] > 1e-4
    for name in found.budget.results:
        assert sum(row.shares.get(name, 0.0) for row in rows.values()) == pytest.approx(1.0)
    band = found.reduction.stress["three waves"]
    # The combined one, not noise alone; the peak's sample moves a little with the inputs.
    assert band.sigma[np.abs(band.value).argmax()] == pytest.approx(sigma, rel=0.01)


def test_the_model_of_the_budget_holds_its_windows():
    test = given()
    windows = Windows((-160e-6, 0.0), (150e-6, 310e-6), (95e-6, 255e-6), source="shot file")
    varied = varied_test.VariedTest(test, windows, -0.75 / BAR.wave_speed)
    near = varied.carried({}, dispersive=False)
    scaled = varied.carried({"transmission gauge, strain per volt": 1.1}, dispersive=False)
    np.testing.assert_allclose(scaled.transmitted, 1.1 * near.transmitted, atol=1e-15)
    np.testing.assert_array_equal(scaled.incident, near.incident)
    moved = varied.carried(
        {"transmission gauge, distance": 0.5 + 4 * 1e-7 * BAR.wave_speed}, dispersive=False
    )
    assert moved.transmitted[:-4] == pytest.approx(near.transmitted[4:], abs=1e-9)  # four samples of 0.1 us


# Propagation of uncertainties from one step to the next, compared with closed forms.

CARRIED_BAR = Bar(diameter=20e-3, length=2.0, youngs_modulus=200e9, density=8000.0, poisson=0.0)
CARRIED_SPECIMEN = Specimen(diameter=10e-3, length=4e-3, density=1000.0)


def stations(slow=0.0, sigma=0.0, memory=1.0):
    """A pulse at both stations of two bars together, 0.5 m each; a slow error on the later one."""
    t = 0.5e-6 * np.arange(1200)

    def pulse(at):
        return 1e-3 * np.exp(-(((t - at) / 20e-6) ** 2))

    error = slow * np.sin(2 * np.pi * t / 60e-6)
    made = (pulse(150e-6), pulse(350e-6) + error)
    return [
        BarSignal(Signal(0.0, 0.5e-6, value, sigma, "1", side, memory), CARRIED_BAR, 0.5, side)
        for value, side in zip(made, ("incident", "transmission"), strict=True)
    ]


def gain_of(found, t):
    """Sigma of a gain per residual: 1 over the norm of the pulse, which its slope in time does not touch."""
    model = 1e-3 * np.exp(-(((t - 350e-6) / 20e-6) ** 2))
    return 1.0 / np.linalg.norm(model)


def test_correlated_residuals_widen_a_wave_speed():
    windows = {"incident_window": (50e-6, 250e-6), "transmitted_window": (250e-6, 450e-6)}
    found = wave_speed(*stations(slow=1e-5), **windows)
    n = found.residual.size
    assert found.alike > 10.0  # a sine of 120 samples is alike over a sixth of it and more
    expected = np.sqrt(found.alike * np.sum(found.residual**2) / (n - 2)) * gain_of(found, found.time)
    assert found.gain_sigma == pytest.approx(expected, rel=0.02)


def test_a_wave_speed_is_not_better_than_the_gauges_noise():
    """No residual: the noise of both gauges with its memory, sqrt(4 + 4) sigma for a gain of one."""
    windows = {"incident_window": (50e-6, 250e-6), "transmitted_window": (250e-6, 450e-6)}
    found = wave_speed(*stations(sigma=1e-6, memory=4.0), **windows)
    expected = np.sqrt(8.0) * 1e-6 * gain_of(found, found.time)
    assert found.gain_sigma == pytest.approx(expected, rel=0.02)


def straight(jerk, sigma):
    """A path over two spans of 1 s, the second jerk with a sigma."""
    return FlyerPath(np.array([0.0, 1.0, 2.0]), np.array(jerk), np.diag([0.0, sigma**2]), 0.0, 1.0, 1.0, 1.0)


@pytest.mark.parametrize(("sigma", "row"), [(0.34, 2), (0.38, None)])
def test_symmetry_ends_beyond_two_sigmas(sigma, row):
    """At 2 s: 12 m/s along, 0.96 m/s across, 8.0 %; 5 % are passed if 2 sigma / 2 / 12.04 is below 3.0 %."""
    paths = Paths(
        straight([6.0, 6.0], 0.0),
        (straight([0.0, 1.92], sigma), straight([0.0, 0.0], 0.0)),
        (straight([0.0, 0.0], 0.0),) * 2,
    )
    found = symmetry_end(paths, [0.5, 1.0, 2.0], separation=0.2, over=0.3, share=0.05, times_in_row=1)
    assert found.share[2] == pytest.approx(0.96 / np.hypot(12.0, 0.96))
    assert found.row == row


def test_full_speed_is_known_to_a_frame_at_best():
    """Acceleration 6 t, then 6 - 12 (t - 1): zero at 1.5 s; its sigma over the jerk 12, and a frame's 1 s."""
    path = straight([6.0, -12.0], 0.0)
    found = _full_speed(path)
    assert found.time == pytest.approx(1.5)
    assert found.sigma == pytest.approx(1 / np.sqrt(12))
    loose = _full_speed(replace(path, covariance=np.diag([36.0, 0.0])))
    assert loose.sigma == pytest.approx(np.hypot(6.0 / 12.0, 1 / np.sqrt(12)))


def test_a_common_error_of_all_frames_is_in_the_paths_uncertainty():
    """A velocity of one sigma, 0.1 m/s, that all frames have in common from the start on."""
    motion = Flight().motion(0, 400e-6)
    start = 0.0
    drift = np.maximum(motion.time - start, 0.0)
    own = np.diag(motion.sigma**2)
    plain = fit_flyer(motion, start=start)
    common = fit_flyer(motion, start=start, covariance=own + 0.1**2 * np.outer(drift, drift))
    same = fit_flyer(motion, start=start, covariance=own)
    t = 300e-6
    np.testing.assert_array_equal(common.jerk, plain.jerk)
    np.testing.assert_allclose(same.covariance, plain.covariance, rtol=1e-12)
    assert common.sigma_velocity(t) == pytest.approx(np.hypot(0.1, plain.sigma_velocity(t)), rel=0.05)


def test_slow_noise_of_the_gauges_is_carried_to_the_faces():
    scene = Layer()
    signals = scene.signals()
    noisy = [
        replace(s, strain=replace(s.strain, sigma=sigma, memory=9.0))
        for s, sigma in zip(signals, (2e-6, 5e-6), strict=True)
    ]
    found = face_waves(*noisy, find_windows(*signals))
    assert found.sigma == {"incident": 2e-6, "reflected": 2e-6, "transmitted": 5e-6}
    assert found.white == pytest.approx({"incident": 6e-6, "reflected": 6e-6, "transmitted": 15e-6})


@pytest.mark.parametrize(
    ("level", "white", "judged"), [(10e-6, 10e-6, True), (2.5e-6, 1e-6, True), (4e-6, 10e-6, False)]
)
def test_equilibrium_is_judged_by_the_lesser_of_two_noises(level, white, judged):
    """Averaged over four samples: white noise of 1e-6 in each wave; what is slow is no less than that.

    Front sqrt(2), back 1: half of their root sum of squares, over sqrt(4), times 5: 2.17 times the noise,
    which is the lesser of `white` and sqrt(4) 1e-6.
    """
    n = 50
    half, names = np.full(n, 0.5 * level), ("incident", "reflected", "transmitted")
    faces = FaceWaves(
        1e-6 * np.arange(n), half, half, 2 * half, dict.fromkeys(names, 1e-6), CARRIED_BAR, CARRIED_BAR,
        white=dict.fromkeys(names, white),
    )  # fmt: skip
    found = reduce(faces, CARRIED_SPECIMEN)
    assert np.isfinite(found.imbalance[10:40]).all() == judged
    assert np.isinf(found.imbalance[10:40]).all() == (not judged)
