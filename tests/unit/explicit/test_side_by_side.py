"""Batches of different models that share the cores: the same bits as each alone, failures apart."""

from dataclasses import replace

import numpy as np

import explicit
from explicit.materials import neo_hookean

TIMES = np.linspace(1e-6, 1e-4, 20)


def problem(mesh: tuple[int, int], density: float, damping: np.ndarray) -> explicit.Problem:
    motion = explicit.PlatenMotion.sampled(lambda t: 5e4 * t**2, lambda t: 1e5 * t, start=0.0, end=TIMES[-1])
    cylinder = explicit.cylinder(4.75e-3, 6.5e-3, n_radial=mesh[0], n_axial=mesh[1], grading=2.0)
    model = explicit.Model(cylinder, density, (neo_hookean(27e3),), (motion,))
    return explicit.Problem(model, explicit.Samples.of(damping=damping), explicit.Sampling(TIMES, TIMES))


def test_models_that_share_the_cores_have_the_bits_of_each_alone() -> None:
    """A pack and a simulation that does not fill one; another mesh; another density; one that ends early."""
    many = [
        problem((5, 6), 870.0, np.linspace(1e-5, 3e-5, 9)),
        problem((6, 8), 870.0, np.array([2.5e-5])),
        problem((5, 6), 900.0, np.array([2.5e-5, 1e-5])),
    ]
    many.append(replace(many[1], stepping=explicit.Stepping(max_steps=10)))
    together = explicit.run_side_by_side(many, threads=2)
    assert together[3].outcomes[0] is explicit.Outcome.STEP_LIMIT
    for one, found in zip(many[:3], together, strict=False):
        alone = explicit.run(one.model, one.samples, one.sampling)
        assert found.completed.all()
        assert np.array_equal(found.force_transmission, alone.force_transmission)
        assert np.array_equal(found.surface_r, alone.surface_r)
    assert explicit.run_side_by_side([]) == []
