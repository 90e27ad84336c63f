"""Sums over Gauss points: the kernels of a GPU against BLAS, and a model on a GPU against the CPU."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.implicit.models import PULL, TIGHT, clamped

from explicit.device import select_device
from kolsky.equilibrium.equations import Equations
from kolsky.equilibrium.points import Points
from kolsky.equilibrium.sensitivity import direct
from kolsky.equilibrium.solve import solve

MODELS = {
    "plane stress": clamped(),
    "axisymmetric": clamped("quad8", "axisymmetric"),
    "3d": clamped("hex8", "3d"),
}


@pytest.mark.slow  # compiles kernels that a CPU has no other use for
@pytest.mark.parametrize("name", ["plane stress", "3d"])
def test_kernels_sum_what_blas_sums(name, monkeypatch):
    model = MODELS[name]
    equations = Equations(model, model.parameters())
    u = np.random.default_rng(2).normal(scale=0.02, size=model.n_dofs)
    by_blas = equations.evaluate(u, {"pull": 0.0})
    stiffness = equations.stiffness(by_blas)
    monkeypatch.setattr(Points, "_by_blas", Points._on_device)
    by_kernels = equations.evaluate(u, {"pull": 0.0})
    np.testing.assert_allclose(by_kernels.body.forces, by_blas.body.forces, atol=1e-9)
    np.testing.assert_allclose(equations.stiffness(by_kernels), stiffness, rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(stiffness, np.swapaxes(stiffness, 1, 2), atol=1e-8)


def test_stiffness_is_the_derivative_of_the_forces():
    model = MODELS["plane stress"]
    equations = Equations(model, model.parameters())
    rng = np.random.default_rng(4)
    u, du = rng.normal(scale=0.02, size=(2, model.n_dofs))
    state, h = equations.evaluate(u, {"pull": 0.0}), 1e-5
    moved = [equations.evaluate(u + sign * h * du, {"pull": 0.0}).body.forces for sign in (1.0, -1.0)]
    by = (moved[0] - moved[1]) / (2.0 * h)
    np.testing.assert_allclose(
        equations.times(equations.stiffness(state), du), by, atol=1e-6 * np.abs(by).max()
    )


@pytest.fixture(scope="module")
def cuda() -> str:
    """Name of the first GPU."""
    try:
        select_device("cuda")
    except ValueError as absent:
        pytest.skip(str(absent))
    return "cuda"


@pytest.mark.parametrize("name", MODELS)
def test_a_gpu_gives_the_same(name, cuda):
    model = MODELS[name]
    own, other = (
        direct(solve(replace(model, device=device), PULL, newton=TIGHT)) for device in ("cpu", cuda)
    )
    np.testing.assert_allclose(other.solution.forces, own.solution.forces, atol=1e-6)
    np.testing.assert_allclose(other.forces, own.forces, atol=1e-6 * np.abs(own.forces).max())
