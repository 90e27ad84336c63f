"""Mass-proportional damping in a shot: the drag alpha M v is the difference of flyer and transmission forces.

Along the axis the specimen's momentum p obeys dp/dt = F_flyer - F_transmission - alpha p, whatever the
material does, so that the impulses differ by p + alpha \\int p dt. The momentum is that of the recorded node
positions with the lumped masses; the faces' nodes move with their platens, and their share is in it.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from explicit.arguments import nodal_mass
from kolsky.inverse.problem import prepare_shot
from kolsky.inverse.settings import Numerics
from kolsky.shot.load import load_shot

OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"


@pytest.mark.parametrize("alpha", [0.0, 400.0])
def test_the_impulses_of_a_shot_differ_by_momentum_and_drag(alpha: float) -> None:
    shot = load_shot(OPEN_01)
    first = shot.window[0]
    short = replace(shot, window=(first, first + 0.4 * (shot.window[1] - first)))
    short = replace(short, model=replace(short.model, mass_damping=alpha, poisson=0.49))
    prepared = prepare_shot(short)
    times = np.linspace(*short.window, 801)[1:]
    sampling = replace(prepared.forward.sampling, force_times=times, surface_times=times)
    forward = replace(prepared.forward, sampling=sampling)
    numerics = Numerics(mesh=(4, 6), threads=1)
    response = forward.run({}, numerics, all_nodes=True)
    assert response.nodes is not None
    mesh = forward.mesh(numerics)
    mass = nodal_mass(mesh, short.specimen.density)
    assert mass.sum() == pytest.approx(
        short.specimen.density * np.pi * short.specimen.radius**2 * short.specimen.length, rel=1e-9
    )
    down = mesh.nodes[:, 1] - response.nodes[0, :, :, 1]
    moved = down @ mass  # \int p dt [kg m], shape [times]
    impulse = response.impulse_flyer[0] - response.impulse_transmission[0]
    # Once more over the time: positions are known at the solver's steps alone, their rates are not.
    balance = cumulative_trapezoid(impulse - alpha * moved, times, initial=0.0)
    change, scale = moved - moved[0], np.ptp(moved)
    np.testing.assert_allclose(balance, change, atol=0.005 * scale)
    if alpha:  # without the drag the balance is off by far more than it holds with it
        without = cumulative_trapezoid(impulse, times, initial=0.0)
        assert np.abs(without - change).max() > 0.05 * scale
