"""Gauges to strain and stress, against the exact waves of an elastic specimen between bars."""

from dataclasses import replace

import numpy as np
import pytest
from elastic_layer import ALUMINIUM, Layer, elastic

from kolsky.bars.records import ANALYSES, History, Signal
from kolsky.bars.reduction.separation import face_waves, sampled_from
from kolsky.bars.reduction.stress_strain import cauchy_stress, hencky_strain, integrated, reduce
from kolsky.bars.reduction.summary import energy_balance, spread_of, summarise
from kolsky.bars.reduction.validity import balanced_span, imbalance
from kolsky.bars.reduction.windows import find_windows, incident_arrival
from kolsky.base.apparatus import Specimen

SCENES = {"steel": Layer(), "two materials": Layer(first=ALUMINIUM, gauges=(0.7, 0.5))}


def reduced(scene: Layer, **noise):
    """Faces and reduction of a scene, by its own windows, time 0 the wave's true arrival."""
    tension = scene.sign < 0
    first, second = scene.signals(**noise)
    windows = find_windows(first, second, tension=tension)
    faces = face_waves(first, second, windows, arrival=-scene.gauges[0] / scene.first.wave_speed)
    return faces, reduce(faces, scene.specimen)


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_strain_and_forces_are_those_of_the_exact_solution(scene):
    """A trapezoid of 20 us rise; ringing of the specimen (2.7 us a transit) is in every wave."""
    _, r = reduced(scene)
    t = r.time
    back = scene.transmitted(t)
    front = scene.pulse(t) + scene.reflected(t)
    # Kinks of the trapezoids are not band-limited: interpolation by a part of a sample rings at them, by up
    # to an eighth of a sample's rise (0.1 us of 20 us), 6e-4 of the peak.
    atol = 7e-4 * scene.peak
    np.testing.assert_allclose(r.front_force.value, front, atol=atol)
    np.testing.assert_allclose(r.back_force.value, back, atol=atol)
    exact = scene.strain(t)
    # The trapezoidal sum misses a kink by a quarter of its change of slope times a step squared.
    np.testing.assert_allclose(r.strain["three waves"].value, exact, atol=1e-4 * exact.max())
    velocity = (scene.pulse(t) - scene.reflected(t)) / scene.first.impedance
    np.testing.assert_allclose(r.front_velocity.value, velocity, atol=7e-4 * velocity.max())


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_the_analyses_agree_in_equilibrium(scene):
    """While the pulse is held and the specimen has rung down, all stresses are equal, and all rates."""
    slow = replace(scene, modulus=20e9, rise=40e-6)
    _, r = reduced(slow)
    held = (r.time > slow.rise + 30 * slow.transit) & (r.time < slow.rise + slow.hold)
    assert held.sum() > 200
    for kind in (r.stress, r.rate):
        three = kind["three waves"].value
        for key in ("one wave", "two waves"):
            # The rise takes 33 transits, of which each leaves the share r = 0.9 (steel), 0.8 of the rest.
            np.testing.assert_allclose(kind[key].value[held], three[held], atol=5e-4 * np.abs(three).max())


def test_analyses_differ_as_the_theory_says_before_equilibrium():
    """In the first transit nothing has passed: no back force, one-wave stress 0, R = 2."""
    scene = Layer(rise=2e-6, modulus=1e9)
    first, second = scene.signals()
    faces = face_waves(first, second, find_windows(first, second), arrival=-0.75 / scene.first.wave_speed)
    r = reduce(faces, scene.specimen, average=0.1e-6)
    early = (r.time > 2.5e-6) & (r.time < 0.9 * scene.transit)
    assert early.sum() > 10
    np.testing.assert_allclose(r.imbalance[early], 2.0, rtol=0.02)  # kinks, as above, on a rise of 2 us
    np.testing.assert_allclose(
        r.stress["three waves"].value[early] * 2, r.stress["two waves"].value[early], rtol=0.02
    )


def test_tension_mirrors_compression():
    push, pull = Layer(), Layer().pulled()
    (_, a), (_, b) = reduced(push), reduced(pull)
    for key in ANALYSES:
        np.testing.assert_allclose(b.strain[key].value, -a.strain[key].value, rtol=0, atol=1e-12)
        np.testing.assert_allclose(b.stress[key].value, -a.stress[key].value, rtol=0, atol=1.0)  # Pa of 1e8
    assert b.strain["three waves"].value.min() < -0.01
    assert a.balanced == pytest.approx(b.balanced)


def test_energy_balance_is_that_of_the_exact_waves():
    scene = Layer(modulus=60e9)
    faces, r = reduced(scene)
    end = float(r.time[-1])
    found = energy_balance(r, faces, scene.specimen)

    times = np.linspace(0.0, end, 20_001)  # 7 ns, so that no kink matters

    def energy(wave, bar):
        return np.trapezoid(wave(times) ** 2, times) / bar.impedance

    exact = [
        energy(scene.pulse, scene.first),
        energy(scene.reflected, scene.first),
        energy(scene.transmitted, scene.second),
    ]
    np.testing.assert_allclose([found.incident, found.reflected, found.transmitted], exact, rtol=1e-4)
    # An elastic specimen gives back what it took, but for what still rings in it at the end.
    assert abs(found.absorbed) < 2e-3 * found.incident
    # What the faces do differs from the deformation's work by that on the specimen's motion as a whole.
    motion = np.trapezoid(
        (r.front_force.value - r.back_force.value) * 0.5 * (r.front_velocity.value + r.back_velocity.value),
        r.time,
    )
    assert found.absorbed == pytest.approx(found.deformation + motion, abs=1e-9 * found.incident)


def test_noise_is_carried_through_exactly():
    """Scatter of 400 noisy records against the sigmas; a standard deviation of 400 has 3.5 % scatter."""
    scene = Layer(hold=40e-6)
    clean = scene.signals()
    windows = find_windows(*clean)
    rng = np.random.default_rng(7)
    sigma = (8e-6, 5e-6)
    kept = {"strain": [], "rate": [], "stress": [], "front": []}
    for _ in range(400):
        noisy = [
            replace(
                s,
                strain=replace(
                    s.strain, value=s.strain.value + q * rng.normal(size=s.strain.value.size), sigma=q
                ),
            )
            for s, q in zip(clean, sigma, strict=True)
        ]
        r = reduce(face_waves(*noisy, windows), scene.specimen)
        kept["strain"].append([r.strain[k].value[-1] for k in ANALYSES])
        kept["rate"].append([r.rate[k].value[500] for k in ANALYSES])
        kept["stress"].append([r.stress[k].value[500] for k in ANALYSES])
        kept["front"].append([r.front_force.value[500]] * 3)
    said = {
        "strain": [r.strain[k].sigma[-1] for k in ANALYSES],
        "rate": [r.rate[k].sigma[500] for k in ANALYSES],
        "stress": [r.stress[k].sigma[500] for k in ANALYSES],
        "front": [r.front_force.sigma[500]] * 3,
    }
    for name, values in kept.items():
        np.testing.assert_allclose(np.std(values, axis=0), said[name], rtol=0.12)  # 3.5 standard deviations


def test_trapezoidal_sum_of_white_noise():
    """Against the weights written out: 1/2, 1, ..., 1, 1/2."""
    step, n, s = 2e-7, 50, 3.0
    rate = History(np.linspace(0.0, 7.0, n) ** 2, np.full(n, s), "1/s")
    found = integrated(rate, step)
    for k in (0, 1, 2, 30):
        weight = np.ones(k + 1)
        weight[[0, -1]] = 0.5
        weight *= step * (k > 0)
        assert found.value[k] == pytest.approx(weight @ rate.value[: k + 1], rel=1e-12)
        assert found.sigma[k] == pytest.approx(s * np.linalg.norm(weight), rel=1e-12)


def test_true_quantities_have_the_right_signs():
    """Compressed, true stress is below the nominal one; stretched, above. ln of stretches 0.6 and 1.5."""
    e, zero = np.array([0.4, -0.5]), np.zeros(2)
    strain, stress = History(e, zero + 1e-3, "1"), History(np.array([1e8, -1e8]), zero + 1e5, "Pa")
    np.testing.assert_allclose(hencky_strain(strain).value, [0.5108256237659907, -0.4054651081081644])
    true = cauchy_stress(stress, strain)
    np.testing.assert_allclose(true.value, [0.6e8, -1.5e8])
    np.testing.assert_allclose(true.sigma, [np.hypot(0.6e5, 1e5), np.hypot(1.5e5, 1e5)])
    np.testing.assert_allclose(hencky_strain(strain).sigma, [1e-3 / 0.6, 1e-3 / 1.5])
    with pytest.raises(ValueError, match=r"nominal compression reaches 1\.2; it must stay below 1"):
        hencky_strain(History(np.array([0.0, 1.2]), zero, "1"))


def elastic_transits(beta, allowance=0.05):
    """Transits after which an elastic layer under a step stays in equilibrium, Eq. (R.11)."""
    r, m = (1.0 - beta) / (1.0 + beta), np.arange(1000)
    return int(np.flatnonzero(2 * r**m * (1 - r) / (2 - r**m * (1 + r)) > allowance)[-1]) + 1


@pytest.mark.parametrize("beta", [0.05, 0.2, 0.6])
def test_transits_to_equilibrium_under_a_step(beta):
    """R of the exact solution in the middle of each transit against the closed form's count."""
    scene = Layer(rise=1e-12, hold=1.0)
    area = beta * scene.first.impedance / (scene.modulus * scene.specimen.density) ** 0.5
    scene = replace(scene, specimen=Specimen(np.sqrt(4 * area / np.pi), 0.005, 1200.0))
    m = np.arange(200)
    t = (m + 0.5) * scene.transit
    r = imbalance(scene.pulse(t) + scene.reflected(t), scene.transmitted(t), 0.0, 0.0)
    for allowance in (0.1, 0.05, 0.01):
        assert elastic_transits(beta, allowance=allowance) == np.flatnonzero(np.abs(r) > allowance)[-1] + 1


def test_no_equilibrium_is_said():
    scene = Layer(modulus=2e6, hold=60e-6)  # 122 us a transit, a pulse of 100 us
    _, r = reduced(scene)
    assert r.balanced is None
    summary = summarise(r, *_faces_and_specimen(scene))
    assert summary.mean_stress is None
    assert summary.modulus is None
    assert "not in equilibrium" in summary.modulus_reason


def _faces_and_specimen(scene):
    return reduced(scene)[0], scene.specimen


def test_modulus_of_an_elastic_specimen_with_slow_loading():
    scene = Layer(rise=100e-6, hold=20e-6)
    faces, r = reduced(scene, noise=0.2e-6)
    summary = summarise(r, faces, scene.specimen)
    # Specimen inertia: the mean force and the shortening of a ringing bar differ by the waves' rest, 1 %.
    assert summary.modulus.value == pytest.approx(scene.modulus, rel=0.01)
    assert summary.modulus.sigma < 0.01 * scene.modulus
    # A triangle of strain in an elastic specimen: neither stress nor rate stands.
    assert summary.mean_rate is None
    assert spread_of(r.strain) < 0.05


def test_no_modulus_before_equilibrium():
    """Aluminium loaded by a step: in equilibrium after 7 transits, with 1 - r^7 = 87 % of the stress."""
    scene = Layer(rise=1e-6, modulus=60e9, specimen=Specimen(0.010, 0.005, 2700.0))
    faces, _ = reduced(scene)
    r = reduce(faces, scene.specimen, average=0.2e-6)
    summary = summarise(r, faces, scene.specimen)
    assert summary.modulus is None
    assert "equilibrium begins at" in summary.modulus_reason


def test_spans_bridge_short_excursions_only():
    time = np.arange(12) * 1e-6
    ratio = np.array([2, 0.01, 0.01, 0.2, 0.01, 0.01, 0.2, 0.2, 0.2, 0.01, 0.01, np.inf])
    assert balanced_span(time, ratio) == pytest.approx((1e-6, 2e-6))
    assert balanced_span(time, ratio, bridge=2e-6) == pytest.approx((1e-6, 5e-6))
    assert balanced_span(time, np.full(12, 0.3)) is None
    with pytest.raises(ValueError, match=r"allowance of R = 0\.0 must be greater"):
        balanced_span(time, ratio, allowance=0.0)


def test_forces_in_the_noise_are_not_judged():
    zero = np.zeros(100)
    assert np.isinf(imbalance(zero + 1.0, zero + 1.0, 1.0, 1.0)).all()
    assert np.isfinite(imbalance(zero + 1.0, zero + 0.9, 1.0, 1.0, width=64)[40:60]).all()


def test_interpolation_by_a_part_of_a_sample_is_exact_for_a_band_limited_signal():
    step = 1e-7
    t = 3e-6 + step * np.arange(4000)
    f = lambda t: np.exp(-(((t - 200e-6) / 8e-6) ** 2)) * np.cos(2e6 * (t - 200e-6))  # noqa: E731
    start = t[1000] + 0.37 * step
    found = sampled_from(Signal(t[0], step, f(t), 0.0, "1"), start, 2000)
    # Spectrum of the Gaussian at the Nyquist frequency: below round-off.
    np.testing.assert_allclose(found, f(start + step * np.arange(2000)), atol=1e-11)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"specimen": Specimen(0.02, 0.005, 1200.0)}, r"diameter = 0\.02 m must not exceed the incident bar"),
        ({"specimen": Specimen(0.01, 0.0, 1200.0)}, r"length = 0\.0 m and diameter = 0\.01 m must be > 0"),
    ],
)
def test_refusals_of_the_specimen(change, message):
    faces, _ = reduced(Layer())
    with pytest.raises(ValueError, match=message):
        reduce(faces, change["specimen"])


def test_refusals_of_the_signals():
    scene = Layer()
    first, second = scene.signals()
    windows = find_windows(first, second)
    other = replace(second, strain=replace(second.strain, interval=2e-7))
    with pytest.raises(ValueError, match=r"sampling intervals .* must be equal\. Cure: resample"):
        face_waves(first, other, windows)
    with pytest.raises(ValueError, match="leave the record"):
        sampled_from(first.strain, first.strain.end, 10)
    faces, r = reduced(scene)
    with pytest.raises(ValueError, match="analysis = 'four waves' must be one of 'one wave'"):
        summarise(r, faces, scene.specimen, analysis="four waves")


def test_clock_of_the_faces_is_the_shots():
    scene = Layer()
    first, second = scene.signals()
    arrival = incident_arrival(first)
    faces = face_waves(first, second, find_windows(first, second), arrival=arrival.time)
    # Time 0 of the scene is the arrival at the specimen; a linear ramp's tangent has no bias.
    assert faces.origin == pytest.approx(0.0, abs=0.02e-6)
    assert elastic(scene.first) * faces.incident.max() == pytest.approx(scene.peak, rel=2e-3)
