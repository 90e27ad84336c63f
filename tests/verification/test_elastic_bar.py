"""Elastic platens, transducer and bar; figures and tolerances as on the page (`elastic_bar.py`)."""

import elastic_bar as topic
import numpy as np
import pytest
from bars_scene import RADIUS, part
from coupled_parts import contact_radius, couple
from order import assert_order
from scene import speed_after_rise

from explicit import Model, Samples, Sampling, cylinder, run
from explicit.bars import elastic_bar
from explicit.bars.elastic import mesh_of, pressed_share
from explicit.materials import neo_hookean


def test_uniform_compression_is_exact() -> None:
    assert topic.static_error() < topic.STATIC_TOLERANCE


def test_phase_velocities_are_those_of_pochhammer_and_chree() -> None:
    exact, found = topic.phase_velocities()
    error = np.abs(found / exact - 1.0)
    assert error[-1].max() < topic.PHASE_TOLERANCE
    assert_order(topic.SIZES, error[:, 3], 2.0, 0.2)  # a / wavelength = 0.2; 0.2: three sizes
    assert 1.0 - exact[-1] > 20.0 * topic.PHASE_TOLERANCE  # the mesh disperses as it must


@pytest.mark.parametrize("name", list(topic.STEPS))
def test_impulse_at_a_step_of_the_impedance(name: str) -> None:
    found, exact, imbalance = topic.impedance_step(name)
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
        bar.integrate(times, np.zeros(2), 8e-3)
    with pytest.raises(ValueError, match="finite at each of 2 times"):
        bar.integrate(times, np.array([0.0, np.nan]), RADIUS)
    with pytest.raises(ValueError, match=r"safety must be in \(0, 1\], got 1.5"):
        bar.integrate(times, np.zeros(2), RADIUS, safety=1.5)
    with pytest.raises(ValueError, match="must lie inside the parts, got depth 0"):
        elastic_bar([part(0.02)], size=2.5e-3, depths=[0.0])
    with pytest.raises(ValueError, match=r"depth must be in \[0, 0.02\] m, got 0.03"):
        elastic_bar([part(0.02)], size=2.5e-3, depths=[0.03])
    with pytest.raises(ValueError, match="at least one section"):
        elastic_bar([], size=2.5e-3)
    with pytest.raises(ValueError, match=r"poisson of a section must be in \(-1, 0.5\), got 0.5"):
        type(part(1.0))(1.0, 1.0, 1.0, 1.0, poisson=0.5)


def small_specimen(stroke: float) -> Model:
    motion = speed_after_rise(stroke / 0.4e-3, 50e-6, end=0.5e-3, n_knots=513)
    mesh = cylinder(4.75e-3, 6.5e-3, n_radial=4, n_axial=6)
    return Model(mesh, 870.0, (neo_hookean(27e3),), (motion,))


def test_a_batch_is_coupled_sample_by_sample() -> None:
    parts = elastic_bar([part(0.1)], size=3.75e-3)
    model = small_specimen(2e-3)
    both = couple(model, Samples.of(poisson=0.49, stiffness_factor=[0.8, 1.2]), parts)
    alone = couple(model, Samples.of(poisson=0.49, stiffness_factor=1.2), parts)
    assert len(both.parts) == 2
    difference = np.abs(both.response.force_transmission[1] - alone.response.force_transmission[0])
    assert difference.max() < 1e-3  # [N], the iteration's tolerance: it may end one pass apart
    # A short free bar is a rigid body for slow forces: its path is the integral of impulse over mass.
    times, impulse = alone.response.force_times, alone.response.impulse_transmission[0]
    path = np.trapezoid(impulse, times) / part(0.1).mass
    assert alone.parts[0].path[-1] == pytest.approx(path, rel=0.05)  # its waves: 41 us a round trip


def test_a_coupling_that_fails_says_why() -> None:
    parts = elastic_bar([part(0.1)], size=3.75e-3)
    samples = Samples.of(poisson=0.49)
    with pytest.raises(RuntimeError, match=r"still changes by .* N after 2 passes, tolerance 1e-12 N"):
        couple(small_specimen(2e-3), samples, parts, max_passes=2, tolerance=1e-12)
    with pytest.raises(RuntimeError, match=r"simulation 0 ended at .* us: .*; "):
        couple(small_specimen(8e-3), samples, parts)
    with pytest.raises(ValueError, match=r"max_passes >= 2, got 0\.001 and 1"):
        couple(small_specimen(2e-3), samples, parts, max_passes=1)


def test_contact_radius_is_that_of_the_outermost_node_on_the_platen() -> None:
    model = small_specimen(4e-3)
    times = np.linspace(1e-5, 0.5e-3, 20)
    response = run(model, Samples.of(poisson=0.49), Sampling(times, times))
    radius = contact_radius(response, model.mesh.length)[0]
    assert radius[0] == pytest.approx(4.75e-3, rel=1e-12)  # the bonded face, nothing rolled on yet
    assert radius[-1] > 4.8e-3
    touching = response.surface_y[0, -1] < 1e-9
    assert radius[-1] == response.surface_r[0, -1, touching].max()


@pytest.mark.slow
def test_force_on_the_specimen_is_that_on_the_characteristic_bar() -> None:
    result = topic.case()
    _, worst = result.bands(result.face_difference["characteristic bar"])["raw"]
    assert worst < topic.FORCE_LIMIT
    assert worst < topic.SHARE_LIMIT * result.face.max()
    assert max(result.lengths.values()) < topic.SHARE_LIMIT * result.face.max()  # the length is an assumption
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
