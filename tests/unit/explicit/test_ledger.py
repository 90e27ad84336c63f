"""The energy ledger is made where it is asked for, and making it changes nothing else."""

from dataclasses import fields, replace

import numpy as np
import pytest

from explicit import Model, PlatenMotion, Samples, Sampling, cylinder, run
from explicit.materials import neo_hookean

TIMES = np.linspace(0.0, 4e-4, 24)[1:]


def model() -> Model:
    """A specimen pressed at 2.6 m/s from the start."""
    motion = PlatenMotion.sampled(lambda t: 2.6 * t, lambda t: np.full_like(t, 2.6), start=0.0, end=TIMES[-1])
    mesh = cylinder(4.75e-3, 6.5e-3, n_radial=4, n_axial=6)
    return Model(mesh=mesh, density=870.0, materials=(neo_hookean(27e3),), motions=(motion,))


@pytest.mark.parametrize("n", [1, 8])
def test_entries_left_out_are_nan_and_the_others_keep_their_bits(n: int) -> None:
    samples = Samples.of(stiffness_factor=np.linspace(0.9, 1.1, n), poisson=0.49, damping=2.5e-5)
    every = Sampling(force_times=TIMES, surface_times=TIMES)
    full, thin = run(model(), samples, every), run(model(), samples, replace(every, ledger_every=5))
    kept = (np.arange(len(TIMES)) % 5 == 0) | (np.arange(len(TIMES)) == len(TIMES) - 1)
    for field in fields(full.energy):
        whole, part = getattr(full.energy, field.name), getattr(thin.energy, field.name)
        assert np.isfinite(whole).all()
        assert np.array_equal(whole[:, kept], part[:, kept])
        assert np.isnan(part[:, ~kept]).all()
    assert np.array_equal(full.force_transmission, thin.force_transmission)
    assert np.array_equal(full.surface_r, thin.surface_r)
    assert np.isfinite(thin.energy.imbalance()).all()


def test_a_ledger_needs_a_positive_distance() -> None:
    with pytest.raises(ValueError, match=r"ledger_every must be >= 1, got 0"):
        Sampling(force_times=TIMES, surface_times=TIMES, ledger_every=0)
