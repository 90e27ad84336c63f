"""Waves at the faces and their combination with bars as waveguides: dispersion, viscoelasticity, noise."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from elastic_layer import ALUMINIUM, Layer, elastic

from kolsky.bars.guides.propagation import propagation
from kolsky.bars.guides.waveguide import ElasticWaveguide, PronyModulus, ViscoelasticWaveguide
from kolsky.bars.records import ANALYSES, BarSignal, FaceWaves, Signal
from kolsky.bars.reduction.separation import face_waves
from kolsky.bars.reduction.stress_strain import BarWaves, reduce
from kolsky.bars.reduction.windows import find_windows
from kolsky.base.apparatus import Bar


class Rounded(Layer):
    """Flanks of a raised cosine: kinks would have to leave their gauge long before the pulse."""

    def pulse(self, time):
        up, down = (np.clip((time - at) / self.rise, 0, 1) for at in (0.0, self.rise + self.hold))
        return self.sign * self.peak * 0.5 * (np.cos(pi * down) - np.cos(pi * up))

    def impulse(self, time):
        def flank(t):
            u = np.clip(t / self.rise, 0, 1)
            return self.rise * (0.5 * u - np.sin(pi * u) / (2 * pi)) + np.maximum(t - self.rise, 0)

        return self.sign * self.peak * (flank(time) - flank(time - self.rise - self.hold))


SCENE = Rounded(first=ALUMINIUM, gauges=(0.7, 0.5), rise=20e-6, modulus=20e9)
GUIDES = (ElasticWaveguide(SCENE.first), ElasticWaveguide(SCENE.second))


def dispersed_signals(scene, guides, interval=0.1e-6):
    """Gauge strains of a scene whose waves disperse on their way between face and gauge."""
    time = -300e-6 + interval * np.arange(int(700e-6 / interval))
    x1, x2 = scene.gauges
    stations = []
    for side, bar, x, parts in (
        ("incident", scene.first, x1, ((scene.pulse, guides[0], -x1), (scene.reflected, guides[0], x1))),
        ("transmission", scene.second, x2, ((scene.transmitted, guides[1], x2),)),
    ):
        total = np.zeros(time.size)
        for wave, guide, way in parts:
            face = Signal(time[0], interval, wave(time) / elastic(bar), 0.0, "1")
            total += propagation(face, guide, way, start=time[0], samples=time.size).signal.value
        kept = (time > -270e-6) & (time < 340e-6)  # nothing returns from the far ends
        strain = Signal(float(time[kept][0]), interval, total[kept], 0.0, "1", f"{side} gauge")
        stations.append(BarSignal(strain, bar, x, side))
    return tuple(stations)


def test_dispersion_is_taken_out():
    """Waves sent through dispersive bars and back: strain and forces are the exact solution's again."""
    signals = dispersed_signals(SCENE, GUIDES)
    windows = find_windows(*signals)
    arrival = -SCENE.gauges[0] / SCENE.first.wave_speed
    right = reduce(face_waves(*signals, windows, guides=GUIDES, arrival=arrival), SCENE.specimen)
    plain = reduce(face_waves(*signals, windows, arrival=arrival), SCENE.specimen)
    inside = (right.time > 0.0) & (right.time < 140e-6)  # the pulse
    t = right.time[inside]
    front = SCENE.pulse(t) + SCENE.reflected(t)

    def off(r):
        return np.abs(r.front_force.value[inside] - front).max() / SCENE.peak

    # What the band's end, omega a / c0 = 2, leaves out of flanks of 20 us, and the fades of the windows.
    assert off(right) < 3e-3
    assert off(plain) > 0.03
    strain, exact = right.strain["three waves"].value[inside], SCENE.strain(t)
    assert np.abs(strain - exact).max() < 1e-3 * exact.max()


def test_guides_without_dispersion_change_nothing():
    signals = SCENE.signals()
    windows = find_windows(*signals)
    still = tuple(ElasticWaveguide(bar, dispersive=False) for bar in (SCENE.first, SCENE.second))
    a = reduce(face_waves(*signals, windows), SCENE.specimen)
    faces = face_waves(*signals, windows, guides=still, band=np.inf)
    b = reduce(faces, SCENE.specimen, guides=still)
    for key in ANALYSES:
        for kind in ("stress", "rate", "strain"):
            one, other = getattr(a, kind)[key], getattr(b, kind)[key]
            # Kinks ring by 1e-4 of the peak at the interpolation, in both, over other lengths.
            np.testing.assert_allclose(other.value, one.value, atol=3e-4 * np.abs(one.value).max())


def test_forces_of_a_viscoelastic_bar():
    """A ramp of strain in a Zener bar: its force in closed form, by the relaxation modulus."""
    bar = Bar(diameter=0.02, length=1.5, youngs_modulus=4e9, density=1190.0, poisson=0.35)
    zener = PronyModulus(3e9, (1e9,), (12e-6,))
    guide = ViscoelasticWaveguide(bar, zener, dispersive=False)
    step, rate, late = 0.1e-6, 50.0, 20e-6
    time = step * np.arange(2000)
    t = np.maximum(time - late, 0.0)
    zero = np.zeros(time.size)
    faces = FaceWaves(
        time=time,
        incident=zero,
        reflected=zero,
        transmitted=rate * t,
        sigma=dict.fromkeys(("incident", "reflected", "transmitted"), 0.0),
        incident_bar=bar,
        transmission_bar=bar,
    )
    waves = BarWaves(faces, (guide, guide))
    force = waves.combined((0.0, 0.0, waves.stiffness_2), "N").value
    area = pi * bar.diameter**2 / 4
    exact = area * rate * (3e9 * t + 1e9 * 12e-6 * (1 - np.exp(-t / 12e-6)))
    # The ramp's kink at a step of 0.1 us; and the record's end, where the fade-out begins.
    np.testing.assert_allclose(force[:1900], exact[:1900], atol=1e-3 * exact.max())
    # The elastic formula with the instantaneous modulus is 20 % off.
    assert abs(elastic(bar) * rate * t[1900] / exact[1900] - 1) > 0.2
    # Force is momentum: for equal bars one wave's rate is -2 v_r / L, whatever the bar.
    mirrored = replace(faces, reflected=-faces.transmitted, transmitted=zero)
    both = BarWaves(mirrored, (guide, guide))
    speed = both.combined((0.0, both.stiffness_1 / both.impedance_1, 0.0), "m/s").value
    reduced = reduce(mirrored, SCENE.specimen, guides=(guide, guide))
    np.testing.assert_allclose(reduced.rate["one wave"].value, -2 * speed / SCENE.specimen.length, atol=1e-6)


@pytest.mark.slow
def test_noise_below_a_band():
    """Scatter of 120 noisy records through dispersive bars: samples and strains against their sigmas."""
    clean = dispersed_signals(replace(SCENE, hold=60e-6), GUIDES, interval=0.2e-6)
    windows = find_windows(*clean)
    rng = np.random.default_rng(4)
    kept = []
    for _ in range(120):
        noisy = [
            replace(
                s,
                strain=replace(
                    s.strain, value=s.strain.value + 8e-6 * rng.normal(size=s.strain.value.size), sigma=8e-6
                ),
            )
            for s in clean
        ]
        faces = face_waves(*noisy, windows, guides=GUIDES)
        r = reduce(faces, SCENE.specimen, guides=GUIDES)
        kept.append([r.stress["three waves"].value[300], r.strain["three waves"].value[450]])
    said = [r.stress["three waves"].sigma[300], r.strain["three waves"].sigma[450]]
    # 6.5 % scatter of a standard deviation of 120. The first mode's slow waves near the band's end leave the
    # window, so that the noise of a sample is somewhat smaller than that of an endless record.
    found = np.std(kept, axis=0)
    assert 0.7 < found[0] / said[0] < 1.2
    assert 0.8 < found[1] / said[1] < 1.2
    assert max(faces.sigma.values()) < 0.5 * 8e-6  # of 2.5 MHz a band of 180 kHz is left
