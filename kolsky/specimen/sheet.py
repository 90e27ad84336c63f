"""A sheet pulled between two pads: its model, and the measured field on its nodes.

The pads move rigidly with known displacements, the rest of the edge is free (Sutula and others 2020, Sec. 6).
Plane stress is what a sheet in the air is in; their text says so and their program solves plane strain, and
the two differ, so both are offered.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from implicit.conditions import Fixed, Prescribed
from implicit.laws.solid import Solid
from implicit.meshes import Mesh
from implicit.model import Model
from implicit.sensitivity import Sensitivities, direct
from implicit.solution import Solution
from implicit.solve import solve
from kolsky.base.arrays import BoolArray, FloatArray, IntArray
from kolsky.specimen.constants import COUPLED, Constants
from kolsky.specimen.tractions import boundary_edges, traction_force

ENDS = "pad"
"""Name of the history of the pad's displacement."""


@dataclass(frozen=True)
class Sheet:
    """A flat specimen with two pads."""

    mesh: Mesh
    """Its mesh, with the pads as sets."""
    kinematics: Literal["plane_stress", "plane_strain"]
    """What the thickness does."""
    thickness: float
    """[m]."""
    moving: str
    """Set of the moving pad."""
    fixed: str
    """Set of the pad at rest."""
    axis: int = 0
    """Direction of the pull."""
    regions: IntArray | None = None
    """Region of each cell; 0 is fitted, the others are held, shape [m]. None: one material."""
    held: Mapping[int, Solid] = field(default_factory=dict)
    """Materials of the held regions."""
    force_from: Literal["reactions", "tractions"] = "reactions"
    """Sum of the nodal reactions, or the integral of the elements' tractions; see `tractions`."""
    device: str = "cpu"
    """Where the element kernels run."""

    def model(self, solid: Solid) -> Model:
        """The sheet of a material."""
        other = 1 - self.axis
        conditions = (
            Fixed(self.fixed),
            Prescribed(self.moving, self.axis, ENDS),
            Fixed(self.moving, (other,)),
        )
        return Model(
            self.mesh,
            solid,
            conditions,
            kinematics=self.kinematics,
            thickness=self.thickness,
            regions=self.regions,
            device=self.device,
        )

    def parameters(self, solid: Solid) -> FloatArray:
        """Constants of all regions, shape [n_regions, n_parameters]."""
        n = 1 if self.regions is None else int(self.regions.max()) + 1
        return np.array([self.held.get(r, solid).parameters() for r in range(n)])

    def simulate(self, solid: Solid, pad: FloatArray) -> Solution:
        """Equilibria at displacements of the moving pad [m], shape [n]."""
        return solve(self.model(solid), {ENDS: pad}, self.parameters(solid))

    def force(self, solution: Solution) -> FloatArray:
        """Force on the body at the moving pad along the pull [N], shape [n]."""
        return np.asarray(solution.reaction(self.moving)[:, self.axis])


@dataclass(frozen=True)
class SheetState:
    """A sheet simulated at some constants, with derivatives by the free ones."""

    solution: Solution
    """Equilibria."""
    displacements: FloatArray
    """[m], shape [n, nodes, 2]."""
    by_constants: FloatArray
    """du/dm, shape [n, p, nodes, 2]."""
    force: FloatArray
    """[N], shape [n]."""
    force_by_constants: FloatArray
    """df/dm, shape [n, p]."""
    slopes: Sensitivities
    """Derivatives by the constants of all regions' energies."""


def sheet_state(sheet: Sheet, constants: Constants, free: FloatArray, pad: FloatArray) -> SheetState | str:
    """Simulate a sheet and differentiate it, or say why it cannot be done."""
    try:
        solid = constants.solid(free)
    except ValueError as error:
        return str(error)
    solution = sheet.simulate(solid, pad)
    if not solution.outcome.ok:
        at = 1e3 * pad[solution.reached]
        return f"the sheet at {at:.4g} mm: {solution.outcome.cause}; {solution.outcome.cure}"
    slopes = direct(solution)
    chain = constants.chain(free)
    n_own = len(chain)  # region 0 comes first
    by = np.einsum("npai,pq->nqai", slopes.displacements[:, :n_own], chain)
    if sheet.force_from == "tractions":
        force, by_force = _tractions(sheet, constants.law, solution, slopes, n_own)
    else:
        force = sheet.force(solution)
        by_force = slopes.reaction(sheet.moving)[:, :n_own, sheet.axis]
    return SheetState(solution, solution.displacements, by, force, by_force @ chain, slopes)


def _tractions(
    sheet: Sheet, law: str, solution: Solution, slopes: Sensitivities, n_own: int
) -> tuple[FloatArray, FloatArray]:
    if law != COUPLED or sheet.kinematics != "plane_strain":
        raise ValueError(f'tractions are known of "{COUPLED}" in plane strain only: take the reactions')
    edges = boundary_edges(sheet.mesh, sheet.moving)
    mu, lam = (float(value) for value in solution.parameters[0])
    force, by = [], []
    for u, du in zip(solution.displacements, slopes.displacements[:, :n_own], strict=True):
        whole, parts = traction_force(sheet.mesh, edges, (mu, lam), u, du)
        force.append(sheet.thickness * whole[sheet.axis])
        by.append(sheet.thickness * parts[:, sheet.axis])
    return np.array(force), np.array(by)


def mass_matrix(mesh: Mesh, cells: BoolArray) -> csr_matrix:
    """Integral of products of shape functions over some cells [m^2], shape [nodes, nodes].

    One displacement component; the other has the same.
    """
    element = mesh.element
    points, weights = element.rule(element.gauss + 1)
    values, gradients = element.values(points), element.gradients(points)
    own = mesh.cells[cells]
    jacobian = np.einsum("gkj,mki->mgij", gradients, mesh.points[own])
    area = np.abs(np.linalg.det(jacobian)) * weights
    each = np.einsum("mg,ga,gb->mab", area, values, values)
    k = own.shape[1]
    rows, columns = np.repeat(own, k, axis=1).ravel(), np.tile(own, (1, k)).ravel()
    n = len(mesh.points)
    return coo_matrix((each.ravel(), (rows, columns)), shape=(n, n)).tocsr()


def cells_inside(mesh: Mesh, low: FloatArray, high: FloatArray) -> BoolArray:
    """Cells whose points all lie inside a rectangle, shape [m]."""
    inside = np.asarray(((mesh.points > low) & (mesh.points < high)).all(axis=1))
    return np.asarray(inside[mesh.cells].all(axis=1))
