"""What relaxes as a part of a model: what is refused, and what a model without it is spared."""

from dataclasses import replace

import numpy as np
import pytest

from explicit import Model, PlatenMotion, Samples, Sampling, Stepping, cylinder, run
from explicit.adjoint.plan import plan
from explicit.materials import neo_hookean
from explicit.relaxation import BergstromBoyce, PronySeries

TIMES = np.linspace(0.0, 2e-4, 5)
SAMPLING = Sampling(TIMES, TIMES)
MOTION = PlatenMotion.sampled(lambda t: 2e4 * t**2, lambda t: 4e4 * t, start=0.0, end=2e-4, n_knots=65)
MODEL = Model(cylinder(4.75e-3, 6.5e-3, n_radial=2, n_axial=3), 870.0, (neo_hookean(20e3),), (MOTION,))
SERIES = PronySeries((0.5,), (1e-4,))


def test_a_branch_of_no_strength_changes_nothing_but_round_off() -> None:
    plain = run(MODEL, Samples.of(poisson=0.49, damping=1e-5), SAMPLING)
    idle = run(
        replace(MODEL, relaxation=(PronySeries((0.0,), (1e-4,)),)),
        Samples.of(poisson=0.49, damping=1e-5),
        SAMPLING,
    )
    np.testing.assert_allclose(idle.force_transmission, plain.force_transmission, rtol=1e-12, atol=1e-14)
    assert (plain.energy.viscous == 0.0).all()
    assert np.abs(idle.energy.viscous).max() < 1e-15 * plain.energy.external.max()


def test_the_step_is_that_of_the_instantaneous_modulus() -> None:
    samples = Samples.of(poisson=0.49)
    stiff = run(replace(MODEL, relaxation=(PronySeries((3.0,), (1e3,)),)), samples, SAMPLING)
    plain = run(MODEL, Samples.of(stiffness_factor=4.0, poisson=0.49), SAMPLING)
    # nothing relaxes within 1e-7 of its time, so the run is that of a law four times as stiff
    np.testing.assert_allclose(stiff.force_flyer, plain.force_flyer, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(stiff.smallest_step, plain.smallest_step, rtol=1e-5)


def test_what_makes_no_sense_is_refused() -> None:
    with pytest.raises(ValueError, match="all of one class"):
        replace(MODEL, relaxation=(SERIES, BergstromBoyce(1.0, 1e3)))
    with pytest.raises(ValueError, match="names relaxation 1, the model has 0 to 0"):
        run(replace(MODEL, relaxation=(SERIES,)), Samples.of(relaxation=1), SAMPLING)
    with pytest.raises(ValueError, match="adjoint knows no branches"):
        plan(replace(MODEL, relaxation=(SERIES,)), Samples.of(), Stepping(), 8)
