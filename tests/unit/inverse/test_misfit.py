"""Misfit terms compared with closed forms and cases by hand of Eqs. (M.3)-(M.8)."""

from dataclasses import replace
from time import perf_counter

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from explicit import EnergyLedger, Outcome, Response
from kolsky.bars.signals.transducers import ForceBins, bin_force
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.inverse.observations import Observations, Prediction, free_part, observe, predict, radius_at
from kolsky.inverse.run_table import residuals, terms

RADIUS, LENGTH = 4.75e-3, 6.5e-3
FRAMES = 1e-4 * np.arange(6)
SAMPLES = 1e-6 * np.arange(501)
WINDOW = (0.0, 5e-4)
BULGE = np.array([1.0, 1.1])
LOAD = np.array([1.0, 0.9])


def height(t):
    return LENGTH - 4.0 * np.asarray(t)


def outline(y, t, bulge=1.0):
    """A parabola between the platens [m]."""
    return RADIUS + bulge * 2.0 * np.asarray(t) * (1.0 - (2.0 * y / height(t) - 1.0) ** 2)


def force(t, load=1.0):
    return load * (20.0 * t / 5e-4 + 1e9 * t**3)


def impulse(t, load=1.0):
    return load * (10.0 * t**2 / 5e-4 + 0.25e9 * t**4)


def response(n_nodes=23, outcomes=(Outcome.COMPLETED, Outcome.COMPLETED)):
    """Two simulations whose bulge and force differ by +10 % and -10 %."""
    y = np.linspace(0.0, 1.0, n_nodes) * height(FRAMES)[:, None]
    r = np.stack([outline(y, FRAMES[:, None], b) for b in BULGE])
    F = np.stack([force(SAMPLES, a) for a in LOAD])
    nothing = np.zeros((2, FRAMES.size))
    return Response(
        force_times=SAMPLES,
        force_flyer=F,
        force_transmission=F,
        impulse_flyer=np.zeros_like(F),
        impulse_transmission=np.stack([impulse(SAMPLES, a) for a in LOAD]),
        surface_times=FRAMES,
        surface_r=r,
        surface_y=np.stack([y, y]),
        energy=EnergyLedger(*[nothing] * 9),
        outcomes=outcomes,
        failed_elements=np.array([-1 if outcome.ok else 17 for outcome in outcomes]),
        failed_places=np.array([(np.nan, np.nan) if o.ok else (4.6e-3, 0.2e-3) for o in outcomes]),
        end_times=np.full(2, FRAMES[-1]),
        steps=np.ones(2, dtype=np.int64),
        smallest_step=np.full(2, 1e-7),
        extrapolated_share=np.zeros(2),
        largest_strain_measure=np.ones(2),
    )


def centre_line(eta=(0.13, 0.37, 0.5, 0.81), frames=FRAMES):
    """Exact points of the first simulation, at the same shares of the height in every frame."""
    frame, share = (a.ravel() for a in np.meshgrid(np.arange(frames.size), eta, indexing="ij"))
    t = frames[frame]
    y = share * height(t)
    return CentreLine(time=t, frame=frame.astype(np.int64), y=y, Z=outline(y, t), sigma=np.full(y.size, 4e-6))


def measured_force():
    return ForceHistory(time=SAMPLES, force=force(SAMPLES), sigma=np.full(SAMPLES.size, 0.05))


def seen(line=None, bin_width=1e-5):
    return observe(measured_force(), line or centre_line(), window=WINDOW, bin_width=bin_width)


def test_observe_keeps_the_window_and_orders_the_frames():
    line = centre_line(frames=FRAMES)
    turned = CentreLine(*(getattr(line, n)[::-1] for n in ("time", "frame", "y", "Z", "sigma")))
    kept = observe(measured_force(), turned, window=(0.9995e-4, 3.005e-4), bin_width=1e-5)
    np.testing.assert_array_equal(kept.frame_times, FRAMES[1:4])
    assert kept.centre_line.time.size == 12
    assert (np.diff(kept.centre_line.time) >= 0.0).all()
    np.testing.assert_allclose(kept.force.time[[0, -1]], [1e-4, 3.0e-4])
    assert kept.force.time.size == 201
    np.testing.assert_array_equal(kept.bins.edges[[0, -1]], kept.force.time[[0, -1]])


def test_a_perfect_model_has_no_misfit():
    observations = seen()
    result = terms(predict(response(), observations), observations, 0)
    # A parabola is exact for the interpolation, what remains is round-off and y solved to 1e-12 m.
    assert result.phi_shape < 1e-9
    assert result.phi_force < 1e-9
    assert result.chi2_shape < 1e-9
    assert (result.n_force, result.n_shape, result.n_outside) == (50, 24, 0)
    # The force's t^3 is averaged exactly by the model and by trapezoids in the data:
    # h^2 F'' / 12 <= 1e-12 x 3e6 / 12 N, far below sigma 0.015 N.
    assert result.chi2_force < 1e-6


def test_closed_forms_of_a_wrong_model():
    """Simulation 1 bulges 10 % more and pushes 10 % less than the data."""
    observations = seen()
    prediction = predict(response(), observations)
    result = terms(prediction, observations, 1)
    line = observations.centre_line
    excess = 0.1 * (line.Z - RADIUS)
    np.testing.assert_allclose(prediction.Z[1], line.Z + excess, atol=1e-11)
    by_frame = [np.mean((excess / line.Z)[line.frame == f]) for f in range(6)]
    assert result.phi_shape == pytest.approx(np.mean(by_frame), rel=1e-6)
    # Phi_F = 0.1 sum (4e4 t + 1e9 t^3) over t = j us, j = 0 ... 500: sums of powers.
    n = 500
    total = 0.1 * (4e4 * 1e-6 * n * (n + 1) / 2 + 1e9 * 1e-18 * (n * (n + 1) / 2) ** 2)
    assert result.phi_force == pytest.approx(total, rel=1e-10)
    assert result.phi == pytest.approx(total / 1000 + np.mean(by_frame) / 0.001, rel=1e-6)
    assert result.sigma_phi_force == pytest.approx(501 * 0.05)  # Eq. (M.7)
    weight = (line.Z + excess) * 4e-6 / line.Z**2  # Eq. (M.6); all frames have 4 points
    assert result.sigma_phi_shape == pytest.approx(weight.mean(), rel=1e-6)
    assert result.chi2_shape == pytest.approx(np.sum((excess / 4e-6) ** 2), rel=1e-6)
    # Bin means of 0.1 F, exact, against sigma sqrt(9.5) / 10 x 0.05 N of 10 intervals.
    edges = 1e-5 * np.arange(51)
    means = np.diff(impulse(edges)) / 1e-5
    np.testing.assert_allclose(prediction.force_bins[1], 0.9 * means, rtol=1e-9)
    sigma = 0.05 * np.sqrt(9.5) / 10
    assert result.chi2_force == pytest.approx(np.sum((0.1 * means / sigma) ** 2), rel=1e-4)  # trapezoids
    assert result.chi2 == result.chi2_force + result.chi2_shape


def by_hand():
    """Frames 5 and 8 with 2 and 3 points, one of them outside; 3 samples, 1 bin; one simulation."""
    time = np.array([0.0, 0.0, 1.0, 1.0, 1.0])
    line = CentreLine(
        time=time, frame=np.array([5, 5, 8, 8, 8]), y=np.arange(5.0), Z=np.array([2.0, 4.0, 5.0, 8.0, 10.0]),
        sigma=np.array([0.1, 0.2, 0.5, 0.4, 1.0]),
    )  # fmt: skip
    history = ForceHistory(
        time=np.array([0.0, 1.0, 2.0]), force=np.array([1.0, 2.0, 4.0]), sigma=np.array([0.3, 0.2, 0.1])
    )
    bins = ForceBins(
        edges=np.array([0.0, 2.0]), mean=np.array([2.25]), sigma=np.array([0.5]), n=np.array([3])
    )
    prediction = Prediction(
        force=np.array([[2.0, 0.5, 4.25]]),
        force_bins=np.array([[1.0]]),
        Z=np.array([[3.0, 3.0, 6.0, np.nan, 5.0]]),
        inside=np.array([[True, True, True, False, True]]),
    )
    return prediction, Observations(force=history, bins=bins, centre_line=line)


def test_terms_by_hand():
    result = terms(*by_hand(), 0)
    # Frame 5: (1/2 + 1/4) / 2 = 3/8; frame 8: (1/5 + 5/10) / 2 = 7/20; their mean 29/80. Eq. (M.3)
    assert result.phi_shape == pytest.approx(29 / 80)
    assert result.phi_force == pytest.approx(1.0 + 1.5 + 0.25)  # Eq. (M.4)
    assert result.phi == pytest.approx(2.75 / 1000 + 29 / 80 / 0.001)  # Eq. (M.5)
    # Z_FEA sigma / Z^2: 3 x 0.1 / 4, 3 x 0.2 / 16, 6 x 0.5 / 25, 5 x 1 / 100. Eq. (M.6)
    shape = ((0.075 + 0.0375) / 2 + (0.12 + 0.05) / 2) / 2
    assert result.sigma_phi_shape == pytest.approx(shape)
    assert result.sigma_phi_force == pytest.approx(0.6)  # Eq. (M.7), sigmas that differ
    assert result.sigma_phi == pytest.approx(np.sqrt((0.6 / 1000) ** 2 + (shape / 0.001) ** 2))  # (M.8)
    assert result.chi2_force == pytest.approx((1.25 / 0.5) ** 2)
    assert result.chi2_shape == pytest.approx(10.0**2 + 5.0**2 + 2.0**2 + 5.0**2)
    assert (result.n_force, result.n_shape, result.n_outside) == (1, 4, 1)


def test_a_frame_without_counted_points_is_left_out():
    prediction, observations = by_hand()
    half = replace(prediction, inside=np.array([[True, True, False, False, False]]))
    assert terms(half, observations, 0).phi_shape == pytest.approx(3 / 8)
    none = replace(prediction, inside=np.zeros((1, 5), dtype=bool))
    with pytest.raises(ValueError, match="none of the 5 outline points"):
        terms(none, observations, 0)


def test_uncertainties_of_the_papers_table_1():
    """delta Z = 0.01 mm at Z = 4.75 mm, 200 samples of 0.25 N: 0.002, 50 N and 2.0 in the paper."""
    n = 1000
    line = CentreLine(
        time=np.zeros(n), frame=np.zeros(n, dtype=np.int64), y=np.zeros(n), Z=np.full(n, 0.00475),
        sigma=np.full(n, 1e-5),
    )  # fmt: skip
    t = np.arange(200.0)
    history = ForceHistory(time=t, force=np.zeros(200), sigma=np.full(200, 0.25))
    bins = bin_force(history, window=(0.0, 199.0), width=10.0)
    prediction = Prediction(
        force=np.zeros((1, 200)),
        force_bins=np.zeros((1, bins.mean.size)),
        Z=line.Z[None],
        inside=np.ones((1, n), dtype=bool),
    )
    result = terms(prediction, Observations(force=history, bins=bins, centre_line=line), 0)
    assert result.sigma_phi_force == pytest.approx(50.0)
    assert result.sigma_phi_shape == pytest.approx(0.002, abs=0.0005)  # printed with one digit
    assert result.sigma_phi == pytest.approx(2.0, abs=0.15)  # rounded from 2.1 by the 0.002 before


def test_residuals_by_hand():
    force_residual, shape_residual, force_time, shape_time = residuals(*by_hand(), 0)
    np.testing.assert_allclose(force_residual, [-2.5])
    np.testing.assert_allclose(shape_residual, [10.0, -5.0, 2.0, -5.0])
    np.testing.assert_array_equal(force_time, [1.0])
    np.testing.assert_array_equal(shape_time, [0.0, 0.0, 1.0, 1.0])


def test_points_beyond_the_platens_are_outside_and_never_extrapolated():
    line = centre_line(eta=(-0.01, 0.0, 0.4, 1.0, 1.02))
    observations = seen(line)
    prediction = predict(response(), observations)
    expected = np.tile([False, True, True, True, False], 6)
    np.testing.assert_array_equal(prediction.inside, [expected, expected])
    np.testing.assert_array_equal(np.isnan(prediction.Z), ~prediction.inside)
    result = terms(prediction, observations, 0)
    assert (result.n_shape, result.n_outside) == (18, 12)
    assert result.phi_shape < 1e-9


def test_force_between_the_models_times_is_linear():
    coarse = np.arange(0, 501, 10)  # the bin edges alone
    full = response()
    thin = replace(
        full,
        force_times=SAMPLES[coarse],
        force_transmission=full.force_transmission[:, coarse],
        impulse_transmission=full.impulse_transmission[:, coarse],
    )
    prediction = predict(thin, seen())
    # Between 10 and 20 us at 13 us: 0.7 F(10) + 0.3 F(20).
    assert prediction.force[0, 13] == pytest.approx(0.7 * force(1e-5) + 0.3 * force(2e-5), rel=1e-12)
    np.testing.assert_allclose(prediction.force_bins, predict(full, seen()).force_bins, rtol=1e-12)


def test_what_the_response_does_not_cover_is_refused():
    observations, full = seen(), response()
    with pytest.raises(ValueError, match=r"simulation 1 of 2 did not complete \(INVERTED at .*select"):
        predict(response(outcomes=(Outcome.COMPLETED, Outcome.INVERTED)), observations)
    fewer = replace(
        full, surface_times=FRAMES[:-1], surface_r=full.surface_r[:, :-1], surface_y=full.surface_y[:, :-1]
    )
    with pytest.raises(ValueError, match=r"no surface_times entry at the frame 0.0005 s \(4 of 24 missing\)"):
        predict(fewer, observations)
    with pytest.raises(ValueError, match="no surface_times entry at the frame 0 s"):
        predict(replace(full, surface_times=FRAMES + 5e-9), observations)
    shifted = observations.bins.edges + 4e-7 * (np.arange(51) == 3)
    between = replace(observations, bins=replace(observations.bins, edges=shifted))
    with pytest.raises(ValueError, match="no force_times entry at the bin edge"):
        predict(full, between)
    with pytest.raises(ValueError, match=r"the simulated force spans 0 to 0\.0005 s"):
        predict(full, replace(observations, force=replace(observations.force, time=SAMPLES + 1e-6)))


@pytest.mark.parametrize(
    ("line", "window", "message"),
    [
        (centre_line(), (1.1e-4, 1.5e-4), "no outline point lies in the window"),
        (replace(centre_line(), Z=-centre_line().Z), WINDOW, "every Z in the window must be > 0"),
        (replace(centre_line(), sigma=0 * centre_line().Z), WINDOW, "every sigma of Z"),
    ],
)
def test_observations_that_cannot_be_used_are_refused(line, window, message):
    with pytest.raises(ValueError, match=message):
        observe(measured_force(), line, window=window, bin_width=1e-5)


def steep(y):
    """A barrel of 3.9 mm, from 4.75 to 6.3 mm, steep near the platens [m]."""
    q = 2.0 * y / 3.9e-3 - 1.0
    return 4.75e-3 + 0.775e-3 * (2.0 - q**2 - q**4)


@pytest.mark.parametrize(("n_nodes", "limit"), [(23, 0.3e-6), (45, 0.05e-6)])
def test_interpolation_error_on_a_barrel(n_nodes, limit):
    s = np.linspace(0.0, 1.0, n_nodes)
    y = 3.9e-3 * (s - 0.08 * np.sin(2.0 * np.pi * s))  # nodes crowd toward both platens, as they do
    at = np.linspace(0.0, 3.9e-3, 3001)
    r, inside = radius_at(steep(y)[None], y[None], np.zeros(at.size, dtype=np.intp), at)
    assert inside.all()
    # Three-point slopes: third order, 8 times less per halving. The noise of a point is 4 um.
    assert np.abs(r - steep(at)).max() < limit
    assert np.abs(r - CubicSpline(y, steep(y))(at)).max() < limit


def rolled():
    """45 nodes; 3 extra lie on the lower platen at y = 0, 2 on the upper one, r growing toward the edge."""
    y = np.linspace(0.0, 3.9e-3, 40)
    r = steep(y)
    low = 4.75e-3 - np.array([0.3e-3, 0.2e-3, 0.08e-3])
    high = 4.75e-3 - np.array([0.1e-3, 0.25e-3])
    round_off = 1e-10 * np.array([0.0, 1.0, -1.0])
    return np.concatenate([low, r, high]), np.concatenate([round_off, y, np.full(2, 3.9e-3)])


def test_a_surface_rolled_onto_both_platens():
    r, y = rolled()
    first, last = free_part(y[None])
    assert (first[0], last[0]) == (3, 42)  # the last node on one platen, the first on the other
    at = np.array([0.0, 1e-6, 0.05e-3, 2e-3, 3.8e-3, 3.9e-3, -1e-9, 3.9e-3 + 1e-9])
    got, inside = radius_at(r[None], y[None], np.zeros(8, dtype=np.intp), at)
    np.testing.assert_array_equal(inside, [True] * 6 + [False] * 2)
    np.testing.assert_allclose(got[:6], steep(at[:6]), atol=0.2e-6)  # one-sided slopes at the ends
    assert np.isnan(got[6:]).all()


def test_a_node_about_to_land_does_not_disturb_its_neighbours():
    """Node 1 comes down onto the platen: r(y) gets infinitely steep there, the rest must not move."""
    y = np.linspace(0.0, 3.9e-3, 40)
    at = np.linspace(y[4], y[-1], 300)
    rows = np.zeros(at.size, dtype=np.intp)
    far, _ = radius_at(steep(y)[None], y[None], rows, at)
    for gap in (5e-6, 5e-7, 1.5e-7, 1e-9):
        landing_y, landing_r = y.copy(), steep(y)
        landing_y[1], landing_r[0] = gap, landing_r[1] - 0.15e-3
        near, inside = radius_at(landing_r[None], landing_y[None], rows, at)
        assert inside.all()
        np.testing.assert_allclose(near, far, atol=1e-12)
        # Between nodes 1 and 3 the radius stays between its neighbours': no overshoot.
        between, _ = radius_at(landing_r[None], landing_y[None], rows[:50], np.linspace(gap, y[3], 50))
        assert (np.diff(between) > 0.0).all()


def test_a_surface_without_a_free_part_or_with_nan_is_refused():
    rows, at = np.zeros(1, dtype=np.intp), np.array([1e-3])
    with pytest.raises(ValueError, match="no free part"):
        radius_at(np.full((1, 5), 5e-3), np.zeros((1, 5)), rows, at)
    with pytest.raises(ValueError, match="not finite"):
        radius_at(np.full((1, 5), np.nan), np.linspace(0, 1, 5)[None], rows, at)
    for row in (-1, 1):
        with pytest.raises(ValueError, match=rf"frame must be in \[0, 0\], got {row} at 0"):
            radius_at(np.full((1, 5), 5e-3), np.linspace(0, 1, 5)[None], rows + row, at)


def test_a_hundred_simulations_take_no_time():
    """100 samples x 186 frames x 14 points on 45 nodes, 3 s at most."""
    eta = np.linspace(0.0, 1.0, 45)
    y = eta * np.linspace(6.5e-3, 3e-3, 186)[:, None]
    r = RADIUS + 1e-3 * np.sin(np.pi * eta) + 0.0 * y
    frame = np.repeat(np.arange(186), 14)
    at = np.tile(np.linspace(0.3e-3, 2.9e-3, 14), 186)
    begin = perf_counter()
    for _ in range(100):
        radius_at(r, y, frame, at)
    assert perf_counter() - begin < 3.0  # about 0.1 s on an idle core
