"""A small sheet with two pads at its ends, and its synthetic data, for tests."""

import numpy as np

from kolsky.bodies.sheet import Sheet, sheet_state
from kolsky.bodies.sheet_fit import FieldData, FieldProblem
from kolsky.bodies.specimen_constants import Constants
from kolsky.equilibrium.meshes import Mesh, rectangle

TRUE = {"E": 3.0e4, "poisson": 0.3}
PAD = np.array([1e-3, 2e-3])


def small_mesh() -> Mesh:
    """12 x 6 triangulated cells of 40 mm x 20 mm; the pads are inner pieces of the ends."""
    mesh = rectangle((0.04, 0.02), (6, 4), kind="tri3")
    left = mesh.with_set("moving", lambda x: (x[:, 0] < 1e-9) & (np.abs(x[:, 1] - 0.01) < 0.006))
    return left.with_set("rest", lambda x: (x[:, 0] > 0.04 - 1e-9) & (np.abs(x[:, 1] - 0.01) < 0.006))


def constants(**start: float) -> Constants:
    """The coupled law, both constants free."""
    return Constants("neo_hookean_coupled", {**TRUE, **start}, ("E", "poisson"))


def made(
    sheet: Sheet, *, noise: float = 0.0, force_noise: float = 0.0, seed: int = 1, start: object = None
) -> FieldProblem:
    """A problem whose data are the sheet's own with the constants `TRUE`."""
    rng = np.random.default_rng(seed)
    state = sheet_state(sheet, constants(), constants().start, -PAD)
    mesh = sheet.mesh
    middle = mesh.points[mesh.cells].mean(axis=1)
    cells = np.abs(middle[:, 0] - 0.02) < 0.014
    u = state.displacements + noise * rng.standard_normal(state.displacements.shape)
    f = state.force + force_noise * rng.standard_normal(len(state.force))
    data = FieldData(-PAD, f, u, cells, max(noise, 1e-6), max(force_noise, 1e-5), 1e-5)
    return FieldProblem(sheet, data, start or constants(E=2.2e4, poisson=0.2))  # type: ignore[arg-type]
