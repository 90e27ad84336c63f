"""Drift after the baseline, and a baseline in motion, compared with closed forms and random walks."""

from types import SimpleNamespace

import numpy as np
import pytest
from elastic_layer import Layer

from kolsky.bars.reduction.windows import check_baselines
from kolsky.bars.signals import baseline

N, STEP = 400, 1e-6
T = N * STEP
PHASE = np.pi * (np.arange(N) + 0.5) / N


def test_without_noise_the_strength_is_that_of_the_three_slowest_parts():
    """a_k of cosines; the posterior of D is then an inverse gamma of shape 3 / 2 and its mean sum a^2 / g."""
    a = np.array([3.0, -2.0, 0.5])
    value = 7.0 + np.sqrt(2.0) * (a @ np.cos(np.outer([1, 2, 3], PHASE))) + 4.0 * np.cos(4 * PHASE)
    expected = float((a**2 * (np.arange(1, 4) * np.pi) ** 2).sum()) / T
    assert baseline.CONTRASTS == 3
    assert baseline.diffusion(value, STEP, sigma=1e-9, memory=1.0) == pytest.approx(
        expected, rel=0.02
    )  # its tail is cut


def test_with_noise_alone_the_strength_is_that_of_the_prior():
    """No slow part at all: the mean of (1 + D/D0)^-1 prod (D g_k + s^2)^(-1/2), by quadrature."""
    from scipy.integrate import quad

    sigma, memory = 2.0, 5.0
    s2 = sigma**2 * memory / N
    gain = T / (np.arange(1, 4) * np.pi) ** 2
    weakest = s2 / gain[0]

    def density(x, power):
        D = weakest * np.exp(x)
        return D ** (1 + power) / (1.0 + D / weakest) / np.sqrt(np.prod(D * gain + s2))

    first, zeroth = (quad(density, -30, 45, args=(power,), limit=500)[0] for power in (1, 0))
    found = baseline.diffusion(np.full(N, 3.0), STEP, sigma=sigma, memory=memory)
    assert found == pytest.approx(first / zeroth, rel=0.02)


def test_the_strength_of_walks_is_found():
    """Of 200 walks without noise the sum of a^2 / g has the mean 3 D."""
    rng = np.random.default_rng(3)
    walks = np.cumsum(rng.standard_normal((200, N)), axis=1) * np.sqrt(5.0 * STEP)
    found = [baseline.diffusion(walk, STEP, sigma=1e-6, memory=1.0) for walk in walks]
    assert np.mean(found) == pytest.approx(3.0 * 5.0, rel=0.25)  # 6 % of scatter, three of them and the tail


def test_the_modes_are_a_random_walks():
    """Variance D t of their sum up to the ripple of four modes, D L^2 / 2 over the time exactly."""
    quantities = baseline.drift_quantities("incident gauge", 3.0, 2.0)
    assert [q.name for q in quantities] == [f"incident gauge, drift {k}" for k in (1, 2, 3, 4)]
    assert all(q.name.rstrip("1234567890 ").endswith(baseline.DRIFTING) for q in quantities)
    time = np.linspace(5.0, 7.0, 20001)
    variance = sum(
        (q.sigma * baseline.drift_at(time, 5.0, 2.0, np.eye(4)[k])) ** 2 for k, q in enumerate(quantities)
    )
    assert np.trapezoid(variance, time) == pytest.approx(3.0 * 2.0**2 / 2.0, rel=1e-3)
    share = 2.0 / ((np.arange(1, 5) - 0.5) * np.pi) ** 2
    assert [q.sigma for q in quantities] == pytest.approx(np.sqrt(3.0 * 2.0 * share / share.sum()))
    np.testing.assert_allclose(variance[3000:], 3.0 * (time[3000:] - 5.0), rtol=0.2)


def test_there_is_no_drift_before_the_baselines_end_and_it_stays_at_its_end():
    shape = baseline.drift_at(np.array([0.0, 5.0, 6.0, 7.0, 9.0]), 5.0, 2.0, np.array([2.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(shape, [0.0, 0.0, 2.0 * np.sin(np.pi / 4), 2.0, 2.0], atol=1e-12)


def rest(value):
    baseline.check_rest(value, 10, name="gauge", times=(0.0, T - STEP))


def test_noise_hum_and_steady_drift_are_rest():
    rng = np.random.default_rng(5)
    for seed in range(50):
        noise = np.random.default_rng(seed).standard_normal(N)
        rest(noise)
        rest(np.round(0.2 * noise))
        rest(noise + 0.1 * np.arange(N))
        rest(noise + 10.0 * np.sin(2 * np.pi * np.arange(N) / rng.uniform(100, 1000)))


@pytest.mark.parametrize(("parts", "refused"), [(7.5, False), (8.5, True)])
def test_a_pulse_that_begins_in_the_baseline_is_refused(parts, refused):
    """Means of -1 and +1 in turn: their scaled median deviation is 1.4826."""
    value = np.repeat(np.where(np.arange(40) % 2, 1.0, -1.0), 10) + 1e-6 * np.linspace(0.0, 1.0, N)
    value[-10:] = parts * 1.4826
    if refused:
        with pytest.raises(ValueError, match=r"from 0\.00039 s on .* Cure: end the baseline before"):
            rest(value)
    else:
        rest(value)


def test_one_part_alone_within_the_baseline_is_a_spike_and_two_are_a_disturbance():
    value = np.repeat(np.where(np.arange(40) % 2, 1.0, -1.0), 10) + 1e-6 * np.linspace(0.0, 1.0, N)
    value[200:210] = 100.0
    rest(value)
    value[210:220] = 100.0
    with pytest.raises(ValueError, match=r"from 0\.0002 s on"):
        rest(value)
    rest(np.repeat([0.0, 9.0], 35))  # seven parts are too few for a median


SCENE = Layer()
"""Steel bars; time 0 when the wave meets the specimen; gauges 0.75 m before it and 0.5 m behind."""
FIRST = -0.75 / SCENE.first.wave_speed
SECOND = 0.5 / SCENE.second.wave_speed


def test_baselines_end_before_their_pulse():
    """The first rise is 5 % of a flank of 20 us after the foot: 1 us."""
    signals = SCENE.signals(noise=1e-6)

    def checked(incident, transmission):
        ends = {"incident": FIRST + incident, "transmission": SECOND + transmission}
        stations = {side: SimpleNamespace(baseline=(-1e-3, end)) for side, end in ends.items()}
        check_baselines(SimpleNamespace(stations=stations), *signals)

    checked(0.5e-6, 0.5e-6)
    with pytest.raises(
        ValueError, match=r"incident gauge: the baseline ends .* Cure: end the baseline before"
    ):
        checked(2e-6, 0.0)
    with pytest.raises(ValueError, match=r"transmission gauge: the baseline ends"):
        checked(0.0, 2e-6)
