"""The adjoint: the maps it transposes, independence of its segments, identities, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from explicit import CharacteristicBar, Model, PlatenMotion, Samples, Sampling, Stepping, cylinder
from explicit.adjoint import StepSequence, by_curve_stress, by_table, forward_run, gradient
from explicit.adjoint.passes import ForceSampling
from explicit.adjoint.perturbed_runs import Histories
from explicit.materials import marlow_from_curve, neo_hookean

TIMES = np.linspace(0.0, 9e-4, 13)[1:]
SAMPLING = Sampling(force_times=TIMES, surface_times=TIMES[5::6])
STRETCH = np.linspace(0.97, 0.4, 12)
STRESS = 27e3 * (STRETCH - STRETCH**-2) * (1.0 + 0.3 * (STRETCH**2 + 2.0 / STRETCH - 3.0))
POINT = Samples.of(stiffness_factor=1.2, poisson=0.49, damping=2.5e-5)


def model(**changes: object) -> Model:
    """A specimen pressed at up to 2.6 m/s, bonded."""
    motion = PlatenMotion.sampled(
        lambda t: 2.6 * t**2 / 18e-4, lambda t: 2.6 * t / 9e-4, start=0.0, end=TIMES[-1]
    )
    mesh = cylinder(4.75e-3, 6.5e-3, n_radial=4, n_axial=6)
    law = marlow_from_curve(STRETCH, STRESS, n_knots=17)
    base = Model(mesh=mesh, density=870.0, materials=(law,), motions=(motion,))
    return replace(base, **changes)  # type: ignore[arg-type]


def half_force(found: Histories) -> tuple[float, Histories]:
    """Half the sum of squares of the transmission force."""
    force = found.force_transmission
    return 0.5 * float(force @ force), replace(found.map(np.zeros_like), force_transmission=force)


def test_the_sampling_of_forces_is_transposed() -> None:
    rng = np.random.default_rng(2)
    steps = StepSequence(start=1e-4, dt=rng.uniform(1e-6, 3e-6, 40))
    times = np.sort(rng.uniform(steps.time[0], steps.time[-1], 15))
    sampled = ForceSampling(steps, np.concatenate([[1e-4], times]))
    forces, a, b = rng.standard_normal(40), rng.standard_normal(16), rng.standard_normal(16)
    there = a @ sampled.force(forces) + b @ sampled.impulse(forces)
    # The same sum in another order: round-off of 40 terms.
    assert sampled.transposed(a, b) @ forces == pytest.approx(there, rel=1e-12)


@pytest.mark.parametrize("every", [1, 7, 1000])
def test_the_gradient_does_not_depend_on_the_checkpoints(every: int) -> None:
    usual = gradient(model(), POINT, SAMPLING, half_force)
    found = gradient(model(), POINT, SAMPLING, half_force, checkpoint_every=every)
    assert np.array_equal(found.histories.force_flyer, usual.histories.force_flyer)
    # Segments sum the same numbers in the same order but for where the sums are interrupted.
    assert np.allclose(found.law, usual.law, rtol=1e-12, atol=1e-12 * np.abs(usual.law).max())
    assert found.damping == pytest.approx(usual.damping, rel=1e-12)


def test_scaling_the_whole_table_is_scaling_the_stiffness() -> None:
    found = gradient(model(), POINT, SAMPLING, half_force)
    law = model().materials[0]
    by_quotient, by_slope = by_table(found, law)
    by_factor = 1.2 * found.stiffness_factor
    # An identity of the discrete equations: round-off.
    assert by_quotient @ law.quotient + by_slope @ law.slope == pytest.approx(by_factor, rel=1e-11)
    by_stress = by_curve_stress(found, STRETCH, STRESS, n_knots=17)
    assert by_stress @ STRESS == pytest.approx(by_factor, rel=1e-7)  # differences of the table leave 1e-9


def test_given_steps_are_repeated_bit_by_bit() -> None:
    first, steps = forward_run(model(), POINT, SAMPLING)
    again, repeated = forward_run(model(), POINT, SAMPLING, steps=steps)
    assert np.array_equal(steps.dt, repeated.dt)
    for name, values in first.items():
        assert np.array_equal(values, getattr(again, name)), name


def test_the_memory_is_that_of_the_checkpoints_and_one_segment() -> None:
    few, many = (gradient(model(), POINT, SAMPLING, half_force, checkpoint_every=n).memory for n in (5, 50))
    assert few < many  # a run of so few steps is mostly its segment


def wrong_shape(found: Histories) -> tuple[float, Histories]:
    """A cotangent of a single time."""
    return 0.0, replace(found, force_flyer=np.zeros(1))


BAR = CharacteristicBar(impedance=5.0, round_trip=1e-4)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"samples": Samples.of(damping=np.array([0.0, 1e-5]))}, r"samples must be one sample.*got 2"),
        ({"samples": Samples.of(material=1)}, r"names material 1, the model has 0 to 0"),
        (
            {"model": model(support=BAR), "checkpoint_every": 1000},
            r"within a segment of 1000 steps \(round trip 0.0001 s\); use a smaller checkpoint_every",
        ),
        ({"stepping": Stepping(precision="fp32")}, r"runs in 'fp64', got precision 'fp32'"),
        ({"stepping": Stepping(max_steps=3)}, r"max_steps was used up. Cure: raise max_steps"),
        ({"objective": wrong_shape}, r"force_flyer must have shape \(12,\), got \(1,\)"),
        ({"checkpoint_every": 0}, r"checkpoint_every must be >= 1 step, got 0"),
        ({"steps": StepSequence(0.0, np.full(4, 1e-6))}, r"the 4 recorded steps end at"),
        ({"sampling": Sampling(TIMES - 1e-3, TIMES)}, r"is before the model's start"),
        ({"model": model(materials=(neo_hookean(1.0),))}, r"Cure:"),
        ({"steps": StepSequence(0.0, np.full(18, 5e-5))}, r"Cure:"),  # far above the stable step
    ],
)
def test_what_cannot_be_differentiated_is_refused(changes, message) -> None:
    arguments = {
        "model": model(),
        "samples": POINT,
        "sampling": SAMPLING,
        "objective": half_force,
        **changes,
    }
    with pytest.raises(ValueError, match=message):
        gradient(**arguments)


def test_a_gradient_of_another_law_is_refused() -> None:
    found = gradient(model(), POINT, SAMPLING, half_force)
    with pytest.raises(ValueError, match=r"the gradient has 89 constants of a law, this law has 19"):
        by_table(found, neo_hookean(27e3))
