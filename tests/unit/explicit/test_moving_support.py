"""A support whose motion is prescribed: the mirrored test, the bar's own path, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from explicit import CharacteristicBar, Model, MovingSupport, PlatenMotion, Samples, Sampling, cylinder, run
from explicit.materials import neo_hookean

LENGTH, END = 6.5e-3, 0.8e-3
TIMES = np.linspace(0.0, END, 161)[1:]
KNOTS = 2049


def stroke(size: float) -> PlatenMotion:
    """A platen that moves smoothly by `size` [m]."""
    return PlatenMotion.sampled(
        lambda t: size * np.clip(t / END, 0, 1) ** 3 * (4.0 - 3.0 * np.clip(t / END, 0, 1)),
        lambda t: size / END * 12.0 * np.clip(t / END, 0, 1) ** 2 * (1.0 - np.clip(t / END, 0, 1)),
        start=0.0,
        end=END,
        n_knots=KNOTS,
    )


def model(flyer: float) -> Model:
    mesh = cylinder(4.75e-3, LENGTH, n_radial=6, n_axial=8)
    return Model(mesh, 870.0, (neo_hookean(27e3),), (stroke(flyer),))


def test_the_mirrored_test_has_the_mirrored_forces() -> None:
    """Which platen is called the flyer cannot matter: the specimen has a plane of symmetry."""
    stroked = 0.4 * LENGTH
    sampling = Sampling(TIMES, TIMES)
    one = run(model(stroked), Samples.of(poisson=0.495), sampling)
    still = replace(model(0.0), support=MovingSupport((stroke(stroked),)))
    other = run(still, Samples.of(poisson=0.495), sampling)
    assert one.completed.all()
    assert other.completed.all()
    scale = np.abs(one.force_flyer).max()
    # 1e-8: round-off of sums in another order, grown along a chain of some 1000 steps.
    np.testing.assert_allclose(other.force_transmission, one.force_flyer, rtol=0, atol=1e-8 * scale)
    np.testing.assert_allclose(other.force_flyer, one.force_transmission, rtol=0, atol=1e-8 * scale)
    assert other.energy.external[0, -1] == pytest.approx(one.energy.external[0, -1], rel=1e-7)


def test_a_batch_with_a_motion_for_each_sample() -> None:
    """The path that a bar's face took, prescribed, gives the bar's force, in a pack and alone."""
    samples = Samples.of(poisson=0.495, stiffness_factor=np.linspace(0.8, 1.2, 9))
    knots = np.linspace(0.0, END, KNOTS)
    on_bar = replace(model(0.25 * LENGTH), support=CharacteristicBar(impedance=200.0, round_trip=0.3e-3))
    bar = run(on_bar, samples, Sampling(TIMES, knots))
    motions = tuple(
        PlatenMotion(start=0.0, step=END / (KNOTS - 1), position=path, velocity=np.gradient(path, knots))
        for path in bar.surface_y[:, :, 0]
    )
    moved = run(replace(on_bar, support=MovingSupport(motions)), samples, Sampling(TIMES, TIMES))
    rigid = run(model(0.25 * LENGTH), samples, Sampling(TIMES, TIMES))
    # rms: a node that lands one step later makes a spike of one step.
    difference = np.sqrt(np.mean((moved.force_transmission - bar.force_transmission) ** 2, axis=1))
    effect = np.sqrt(np.mean((rigid.force_transmission - bar.force_transmission) ** 2, axis=1))
    assert (difference < 0.02 * effect).all()  # the path is a cubic between knots at half a time step
    assert (effect > 5e-3).all()  # [N], of some 1 N: what the bar does at all


def test_impossible_supports_are_refused() -> None:
    with pytest.raises(ValueError, match="got none"):
        MovingSupport(())
    with pytest.raises(ValueError, match="must start at"):
        replace(model(1e-3), support=MovingSupport((replace(stroke(1e-3), start=1e-3),)))
    sampling = Sampling(TIMES, TIMES)
    two = replace(model(1e-3), support=MovingSupport((stroke(1e-3), stroke(1e-3))))
    with pytest.raises(ValueError, match="one for each of 3 samples, got 2"):
        run(two, Samples.of(stiffness_factor=[1.0, 1.1, 1.2]), sampling)
    short = PlatenMotion(start=0.0, step=END, position=np.zeros(2), velocity=np.zeros(2))
    with pytest.raises(ValueError, match="equally many knots, with those of its support, got"):
        run(replace(model(1e-3), support=MovingSupport((short,))), Samples.of(), sampling)
