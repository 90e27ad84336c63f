"""Elastic platens, transducer and bar; figures and tolerances as on the page (`elastic_bar.py`)."""

import elastic_bar as topic
import elastic_checks as checks
import numpy as np
import pytest
from bars_scene import RADIUS, part
from order import assert_order

from explicit.bars import elastic_bar
from explicit.bars.mesh import mesh_of, pressed_share


def test_uniform_compression_is_exact() -> None:
    assert checks.static_error() < topic.STATIC_TOLERANCE


def test_phase_velocities_are_those_of_pochhammer_and_chree() -> None:
    exact, found = checks.phase_velocities()
    error = np.abs(found / exact - 1.0)
    assert error[-1].max() < topic.PHASE_TOLERANCE
    assert_order(checks.SIZES, error[:, 3], 2.0, 0.2)  # a / wavelength = 0.2; 0.2: three sizes
    assert 1.0 - exact[-1] > 20.0 * topic.PHASE_TOLERANCE  # the mesh disperses as it must


@pytest.mark.parametrize("name", list(checks.STEPS))
def test_impulse_at_a_step_of_the_impedance(name: str) -> None:
    found, exact, imbalance = checks.impedance_step(name)
    np.testing.assert_allclose(found, exact, rtol=0, atol=topic.STEP_TOLERANCE)
    assert imbalance < topic.ENERGY_TOLERANCE


def test_loads_of_a_patch_are_consistent() -> None:
    """Total force and the first moment of an even pressure, closed form."""
    mesh = mesh_of([part(0.01)], size=1.5e-3)
    lines = mesh.nodes[mesh.face, 0]
    radius = np.array([1e-4, 1.5e-3, 4.75e-3, RADIUS])
    share = pressed_share(mesh, radius)
    np.testing.assert_allclose(share.sum(axis=1), 1.0, rtol=1e-12)  # round-off
    np.testing.assert_allclose(share @ lines, 2.0 * radius / 3.0, rtol=1e-12)  # mean of r over the patch


def test_what_cannot_be_is_refused() -> None:
    bar = elastic_bar([part(0.02)], size=2.5e-3)
    times = np.array([0.0, 1e-5])
    with pytest.raises(ValueError, match=r"pressed radius must be in \(0, 0.0075\] m, got 0.008"):
        bar.march(times, np.zeros(2), 8e-3)
    with pytest.raises(ValueError, match="finite at each of 2 times"):
        bar.march(times, np.array([0.0, np.nan]), RADIUS)
    with pytest.raises(ValueError, match=r"safety must be in \(0, 1\], got 1.5"):
        bar.march(times, np.zeros(2), RADIUS, safety=1.5)
    with pytest.raises(ValueError, match="must lie inside the parts, got depth 0"):
        elastic_bar([part(0.02)], size=2.5e-3, depths=[0.0])
    with pytest.raises(ValueError, match=r"depth must be in \[0, 0.02\] m, got 0.03"):
        elastic_bar([part(0.02)], size=2.5e-3, depths=[0.03])
    with pytest.raises(ValueError, match="at least one section"):
        elastic_bar([], size=2.5e-3)
    with pytest.raises(ValueError, match=r"poisson of a section must be in \(-1, 0.5\), got 0.5"):
        type(part(1.0))(1.0, 1.0, 1.0, 1.0, poisson=0.5)


@pytest.mark.slow
def test_force_on_the_specimen_is_that_on_the_characteristic_bar() -> None:
    result = topic.case()
    _, worst = result.bands(result.face_difference["characteristic bar"])["raw"]
    assert worst < topic.FORCE_LIMIT
    assert worst < topic.SHARE_LIMIT * result.face.max()
    assert result.travel[0] == pytest.approx(result.travel[1], rel=0.01)  # local indentation of the platen
    assert result.imbalance < topic.ENERGY_TOLERANCE
    # A rigid support would not pass.
    assert result.bands(result.face_difference["rigid support"])["raw"][1] > topic.FORCE_LIMIT


@pytest.mark.slow
def test_every_pass_leaves_a_small_share_of_the_error() -> None:
    change = topic.case().change
    # Specimen over bar, 1e-4, times what resonances at 10 to 20 kHz amplify it by.
    assert (change[1:] < 0.05 * change[:-1]).all()


@pytest.mark.slow
def test_transducer_shows_the_force_at_its_place() -> None:
    result = topic.case()
    limit = min(topic.FORCE_LIMIT, topic.SHARE_LIMIT * result.face.max())
    for name in ("sections in one dimension", "uniform bar, at its place"):
        assert result.bands(result.sensor_difference[name])["5 kHz"][1] < limit
    # At 20 kHz the place matters: the front's force misses what the mass before the transducer adds.
    front = result.bands(result.sensor_difference["uniform bar, at its front"])["20 kHz"]
    place = result.bands(result.sensor_difference["uniform bar, at its place"])["20 kHz"]
    assert front[0] > 5.0 * place[0]
