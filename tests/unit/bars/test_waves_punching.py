"""Punching: limits in closed form, the size of the correction, and unchanged quantities."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from elastic_layer import ALUMINIUM, STEEL, Layer
from scipy.special import j0, j1, jn_zeros

from kolsky.bars.records import ANALYSES
from kolsky.bars.reduction.separation import face_waves
from kolsky.bars.reduction.stress_strain import correct_punching, punching_compliance, reduce
from kolsky.bars.reduction.windows import find_windows


def spreading(ratio, terms=4000):
    """Mean sinking of a bar whose side slides in a rigid sleeve, in (1 - nu^2) F / (E a): a Dini series.

    The half-space's response 2 (1 - nu^2) / (E k) to a pressure J0(k r), with J1(k b) = 0, which is the
    series of a constriction's thermal resistance.
    """
    k = jn_zeros(1, terms)
    return 8 * np.sum(j1(k * ratio) ** 2 / (k**3 * j0(k) ** 2)) / (pi * ratio)


def in_half_space_units(ratio, bar=STEEL):
    a = ratio * bar.diameter / 2
    return punching_compliance(bar, a) * bar.youngs_modulus * a / (1 - bar.poisson**2)


def test_a_small_specimen_sinks_as_into_a_half_space():
    """Love: the mean under an even pressure over a circle on a half-space is 16 / (3 pi^2)."""
    near, nearer = in_half_space_units(0.02), in_half_space_units(0.01)
    assert 2 * nearer - near == pytest.approx(16 / (3 * pi**2), rel=1e-3)  # what is left is of order ratio^2


@pytest.mark.parametrize("ratio", [0.1, 0.3, 0.5, 0.7, 0.9])
def test_a_free_side_gives_way_more_than_a_sleeve(ratio):
    """By 1 % of it for a small specimen, whose field the side hardly sees, up to a third near the edge."""
    more = in_half_space_units(ratio) / spreading(ratio)
    assert 1.0 < more < 1.0 + 0.2 * ratio + 0.25 * ratio**4


def test_a_specimen_as_wide_as_the_bar_does_not_punch():
    assert punching_compliance(STEEL, STEEL.diameter / 2) == 0.0


@pytest.mark.parametrize("radius", [0.0, -1e-3, 0.008, float("nan")])
def test_a_radius_outside_its_range_is_refused(radius):
    with pytest.raises(ValueError, match=r"must be > 0 and not exceed the bar's, 0\.0075 m"):
        punching_compliance(STEEL, radius)


def reduction_of(scene):
    first, second = scene.signals()
    faces = face_waves(first, second, find_windows(first, second))
    return reduce(faces, scene.specimen)


def test_the_correction_makes_the_specimen_stiffer_by_both_faces():
    scene = Layer(first=ALUMINIUM, gauges=(0.7, 0.5))
    r = reduction_of(scene)
    bars = (scene.first, scene.second)
    corrected, entry = correct_punching(r, scene.specimen, *bars)
    c1, c2 = (punching_compliance(bar, scene.specimen.radius) for bar in bars)
    both = c1 * r.front_force.value + c2 * r.back_force.value
    change = r.strain["three waves"].value - corrected.strain["three waves"].value
    np.testing.assert_allclose(change * scene.specimen.length, both, atol=1e-15)
    assert entry.size == pytest.approx(np.abs(change).max())
    assert entry.applied
    assert entry.key == "punching"
    for key in ANALYSES:
        assert corrected.stress[key] is r.stress[key]
        # The rate's correction integrates to the strain's, but for the averaging over 3.5 us at the end.
        step = r.time[1] - r.time[0]
        lost = np.sum(r.rate[key].value - corrected.rate[key].value) * step
        drop = r.strain[key].value - corrected.strain[key].value
        assert lost == pytest.approx(drop[-1], abs=0.02 * np.abs(drop).max())


def test_left_out_it_is_listed_with_its_size():
    scene = Layer()
    r = reduction_of(scene)
    same, entry = correct_punching(r, scene.specimen, scene.first, scene.second, apply=False)
    assert same is r
    assert not entry.applied
    assert "would shorten" in entry.reason
    assert entry.size == correct_punching(r, scene.specimen, scene.first, scene.second)[1].size > 0


def test_sigmas_grow_by_the_forces_noise():
    """Scatter of the corrected rate over 300 noisy records against the sigma that is said."""
    scene = Layer(hold=40e-6)
    clean = scene.signals()
    windows = find_windows(*clean)
    rng = np.random.default_rng(2)
    rates = []
    for _ in range(300):
        noisy = [
            replace(
                s,
                strain=replace(
                    s.strain, value=s.strain.value + 8e-6 * rng.normal(size=s.strain.value.size), sigma=8e-6
                ),
            )
            for s in clean
        ]
        r = reduce(face_waves(*noisy, windows), scene.specimen)
        corrected, _ = correct_punching(r, scene.specimen, scene.first, scene.second)
        rates.append((corrected.rate["three waves"].value - r.rate["three waves"].value)[500])
    said = np.sqrt(corrected.rate["three waves"].sigma[500] ** 2 - r.rate["three waves"].sigma[500] ** 2)
    assert np.std(rates) == pytest.approx(said, rel=0.15)  # 4 % scatter of a standard deviation of 300
