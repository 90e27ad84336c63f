"""A sheet pulled between two pads: its model, and the projection of the measured field on its nodes.

The projection is a local quadratic by weighted least squares. Outliers are rejected first.

Image correlation gives displacements at the points of a grid. The cost of Sutula and others (2020, Sec. 6)
needs them at the nodes of the mesh. At a node x0, the nine nearest points are fitted by

    p(x) = a0 + a1 x + a2 y + a3 x^2 + a4 x y + a5 y^2,   x, y from x0,
    weights w = e + (1 - e)(1 - r/r_max)^2

and the node's value is a0 (Belytschko and others 1996). Points that differ from the prediction of their
neighbours are rejected first.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from dic.basics import MAD
from kolsky.base.arrays import BoolArray, FloatArray, IntArray
from kolsky.bodies.specimen_constants import Constants
from kolsky.equilibrium.linear.base import Pattern
from kolsky.equilibrium.meshes import Mesh
from kolsky.equilibrium.model import Fixed, Model, Prescribed
from kolsky.equilibrium.points import geometry
from kolsky.equilibrium.sensitivity import Sensitivities, direct
from kolsky.equilibrium.solid import Solid
from kolsky.equilibrium.solution import Solution
from kolsky.equilibrium.solve import solve

NEIGHBOURS = 9
"""Number of points of a local fit. At least six are needed."""
LEAST_WEIGHT = 1e-4
"""Weight e of the farthest point."""
_CONDITION = 1e-6
"""Smallest determinant of the normal matrix, divided by the product of its diagonal. Below it, the points lie
on a conic and the weighted mean is used."""
_GATE_NEIGHBOURS = 20
"""Number of neighbours that predict one point in the outlier test."""
NOISE_POINTS = _GATE_NEIGHBOURS + 1
"""Smallest number of points for an estimate of the noise: one point and its neighbours."""
GATE = 6.0
"""Largest deviation from the prediction, in robust standard deviations of all points."""
_GATE_PASSES = 5
"""Maximum number of repetitions of the outlier test without the rejected points."""


def project(points: FloatArray, values: FloatArray, targets: FloatArray) -> FloatArray:
    """Project point values to targets by local quadratics, shape [n_targets, k].

    ``points``: positions of the values [m], shape [n, 2]. ``values``: any number of fields, in any unit,
    shape [n, k]. ``targets``: positions of the results [m], shape [n_targets, 2]. Raises ValueError if there
    are fewer than `NEIGHBOURS` points, or if a value is not finite.
    """
    if len(points) < NEIGHBOURS:
        raise ValueError(f"a quadratic takes at least {NEIGHBOURS} points, got {len(points)}")
    if not np.isfinite(values).all():
        raise ValueError("values must be finite: leave out the points that image correlation lost")
    tree = cKDTree(points)
    distance, near = tree.query(targets, k=NEIGHBOURS)
    return np.asarray(
        np.einsum("nk,nkf->nf", _weights(points[near] - targets[:, None], distance), values[near])
    )


def spacing(points: FloatArray) -> float:
    """Median distance between neighbours [m]."""
    return float(np.median(cKDTree(points).query(points, k=2)[0][:, 1]))


def outliers(points: FloatArray, values: FloatArray, *, gate: float = GATE) -> NDArray[np.bool_]:
    """Find the outliers: points that differ from the prediction of their neighbours.

    Each point is predicted by a quadratic through its `_GATE_NEIGHBOURS` nearest neighbours. Its deviation is
    divided by the noise of the prediction, and by the robust standard deviation of all points of the field.
    The latter comes from the median, which outliers do not affect. The result must be at most `gate`. The
    test is repeated without the rejected points, because an outlier disturbs the predictions of its
    neighbours.

    ``points``, ``values``: as in `project`; finite. ``gate``: limit in standard deviations, > 0.
    """
    bad = np.zeros(len(points), dtype=np.bool_)
    for _ in range(_GATE_PASSES):
        good = np.flatnonzero(~bad)
        if len(good) <= _GATE_NEIGHBOURS + 1:
            break
        own, field = points[good], values[good]
        near, deviation = _deviations(own, field)
        scale = MAD * np.median(deviation, axis=0)
        ratio = np.divide(deviation, scale, out=np.zeros_like(deviation), where=scale > 0.0).max(axis=1)
        if not (ratio > gate).any():
            break
        # Neighbouring outliers disturb each other. The worst one is rejected first.
        worst = (ratio > gate) & (ratio >= ratio[near[:, :8]].max(axis=1))
        bad[good[worst]] = True
    return bad


def point_noise(points: FloatArray, values: FloatArray) -> float:
    """Standard deviation of a value from its prediction by neighbours, for all fields [unit of values]. A
    field that is smooth over `_GATE_NEIGHBOURS` points does not contribute. A rough field counts as noise."""
    return float(MAD * np.median(_deviations(points, values)[1]))


def _deviations(points: FloatArray, values: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Nearest neighbours [n, k] and deviations from their prediction over its noise, shape [n, fields]."""
    distance, near = cKDTree(points).query(points, k=_GATE_NEIGHBOURS + 1)
    distance, near = distance[:, 1:], near[:, 1:]
    weights = _weights(points[near] - points[:, None], distance)
    expected = np.einsum("nk,nkf->nf", weights, values[near])
    return near, np.abs(values - expected) / np.sqrt(1.0 + (weights**2).sum(axis=1))[:, None]


def _weights(offsets: FloatArray, distance: FloatArray) -> FloatArray:
    """Weights c of the local fit, shape [n, k]. Its value at the target is sum c_k f_k."""
    length = np.maximum(distance.max(axis=1), np.finfo(float).tiny)
    x, y = np.moveaxis(offsets / length[:, None, None], -1, 0)
    weight = LEAST_WEIGHT + (1.0 - LEAST_WEIGHT) * (1.0 - distance / length[:, None]) ** 2
    basis = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    weighed = basis * weight[..., None]
    normal = np.einsum("nka,nkb->nab", weighed, basis)
    flat = np.linalg.det(normal) <= _CONDITION * np.prod(np.einsum("naa->na", normal), axis=1)
    normal[flat] = np.eye(6)
    constant = np.zeros((len(normal), 6, 1))
    constant[:, 0] = 1.0
    found = np.einsum("nka,na->nk", weighed, np.linalg.solve(normal, constant)[..., 0])
    found[flat] = (weight / weight.sum(axis=1, keepdims=True))[flat]
    return np.asarray(found)


ENDS = "pad"
"""Name of the displacement history of the pad."""


@dataclass(frozen=True)
class Sheet:
    """A plane specimen with two pads."""

    mesh: Mesh
    """Its mesh, with the pads as sets."""
    kinematics: Literal["plane_stress", "plane_strain"]
    """Kinematics across the thickness."""
    thickness: float
    """Thickness of the sheet [m]."""
    moving: str
    """Set of the moving pad."""
    fixed: str
    """Set of the fixed pad."""
    axis: int = 0
    """Direction of the pull."""
    regions: IntArray | None = None
    """Region of each cell, the fitted ones first, shape [m]. None: one material."""
    held: Mapping[int, Solid] = field(default_factory=dict)
    """Materials of the regions with fixed constants."""
    device: str = "cpu"
    turned: int = 0
    """Number of cells with clockwise node order in the mesh file. This order was reversed."""

    def model(self, solid: Solid) -> Model:
        """The model of the sheet with given materials."""
        other = 1 - self.axis
        conditions = (
            Fixed(self.fixed),
            Prescribed(self.moving, self.axis, ENDS),
            Fixed(self.moving, (other,)),
        )
        return Model(
            self.mesh, solid, conditions, kinematics=self.kinematics, thickness=self.thickness,
            regions=self.regions, device=self.device,
        )  # fmt: skip

    def simulate(
        self, solid: Solid, *further: Solid, pad: FloatArray, near: "SheetState | None" = None
    ) -> Solution:
        """Equilibria at displacements of the moving pad [m], shape [n].

        ``solid``: the material of the first region. ``further``: the materials of the other fitted regions.
        ``near``: a solution with other constants and the same pad displacements. Its derivatives predict
        these equilibria.
        """
        n = 1 if self.regions is None else int(self.regions.max()) + 1
        fitted = dict(enumerate((solid, *further)))
        rows = np.array([self.held.get(r, fitted.get(r, solid)).parameters() for r in range(n)])
        if near is None:
            return solve(self.model(solid), {ENDS: pad}, rows)
        change = (rows - near.solution.parameters).ravel()
        guess = near.displacements + np.einsum("npai,p->nai", near.slopes.displacements, change)
        return solve(near.solution.model, {ENDS: pad}, rows, guess=guess, like=near.solution)

    def force(self, solution: Solution) -> FloatArray:
        """Force on the body at the moving pad along the pull [N], shape [n]."""
        return np.asarray(solution.reaction(self.moving)[:, self.axis])


@dataclass(frozen=True)
class SheetState:
    """A sheet simulated at given constants, with derivatives by the free constants."""

    solution: Solution
    displacements: FloatArray
    """[m], shape [n, nodes, 2]."""
    by_constants: FloatArray
    """du/dm, shape [n, p, nodes, 2]."""
    force: FloatArray
    """[N], shape [n]."""
    force_by_constants: FloatArray
    """df/dm, shape [n, p]."""
    slopes: Sensitivities
    """Derivatives by the energy constants of all regions."""


def sheet_state(
    sheet: Sheet, constants: Constants, free: FloatArray, pad: FloatArray, near: SheetState | None = None
) -> SheetState:
    """Simulate a sheet with derivatives. `near`: as in `Sheet.simulate`. Raises ValueError with the reason if
    the constants are invalid or the simulation fails."""
    solution = sheet.simulate(*constants.solids(free), pad=pad, near=near)
    if not solution.outcome.ok:
        solution.outcome.require(f"the sheet at {1e3 * pad[solution.reached]:.4g} mm")
    slopes = direct(solution, keep=True)
    chain = constants.chain(free)
    n_own = len(chain)  # the fitted regions come first
    by = np.einsum("npai,pq->nqai", slopes.displacements[:, :n_own], chain)
    force = sheet.force(solution)
    by_force = slopes.reaction(sheet.moving)[:, :n_own, sheet.axis]
    return SheetState(solution, solution.displacements, by, force, by_force @ chain, slopes)


def mass_matrix(mesh: Mesh, cells: BoolArray) -> csr_array:
    """Integral of products of shape functions over some cells [m^2], shape [nodes, nodes]. This is for one
    displacement component. The other component has the same integral."""
    # products of shape functions have twice their degree
    whole = geometry(mesh, kinematics="plane_strain", thickness=1.0, gauss=mesh.element.gauss + 1)
    each = np.einsum("mg,ga,gb->mab", whole.volumes[cells], whole.values, whole.values)
    n = len(mesh.points)
    return Pattern(mesh.cells[cells], np.arange(n), n).matrix(each)


def cells_inside(mesh: Mesh, low: FloatArray, high: FloatArray) -> BoolArray:
    """Cells with all points inside a rectangle, shape [m]."""
    inside = np.asarray(((mesh.points > low) & (mesh.points < high)).all(axis=1))
    return np.asarray(inside[mesh.cells].all(axis=1))
