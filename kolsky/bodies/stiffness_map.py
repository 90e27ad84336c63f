r"""A stiffness factor for each block of a sheet.

It is for fields that one set of constants does not explain.

If one law with one set of constants does not explain the field, the stiffness may vary over the sheet. Each
block r of a grid over the sheet has a factor s_r of all its moduli, and

    minimise  chi^2(s) + tau sum_{r,q neighbours} l_rq sqrt((ln s_r - ln s_q)^2 + e^2)          (H.1)

with the length l_rq of their common side over a block's size. Total variation preserves plateaus and sharp
borders. It suppresses variations that the data do not require (Rudin, Osher and Fatemi 1992). The gradient
needs one adjoint system per step for any number of blocks (Eqs. K.13-K.16). tau is the largest value with
which the field is explained within its noise (Morozov's discrepancy principle). The map therefore contains no
variation that noise could cause.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.bodies.sheet import ENDS
from kolsky.bodies.sheet_fit import FieldProblem
from kolsky.equilibrium.sensitivity import adjoint
from kolsky.equilibrium.solve import solve

SMOOTHING = 1e-3
"""e: smaller differences of ln s than this are not a border."""
LARGEST = np.log(30.0)
"""Largest magnitude of ln s."""
WEIGHTS = (1e4, 1e3, 1e2, 10.0, 1.0)
"""tau, from the smoothest map on."""
MOST_STEPS = 60
"""Maximum number of steps of the search at one weight."""
EXPLAINED = 1.1
"""Largest chi-square within the noise, divided by its degrees of freedom."""
FAILED = 1e30
"""Value of a point with a failed simulation. The line search then steps back."""


@dataclass(frozen=True)
class StiffnessMap:
    """Factors of stiffness over a sheet."""

    factors: FloatArray
    """Factors on the problem's constants, one per block [-], shape [blocks]."""
    regions: IntArray
    """Block of each cell, shape [m]."""
    weight: float
    """Weight of the regularisation, tau."""
    chi2: float
    """Chi-square of displacements and forces [-]."""
    degrees: float
    """Independent data [-]."""
    uniform: float
    """Chi-square with one factor for all blocks [-]."""

    @property
    def explained(self) -> bool:
        """True if the map explains the data within their noise."""
        return self.chi2 <= EXPLAINED * self.degrees


def blocks_of(problem: FieldProblem, counts: tuple[int, int]) -> tuple[IntArray, FloatArray]:
    """Number the cells by blocks of a grid, and find which blocks touch.

    Returns: block of each cell, numbered without gaps, shape [m]. Returns: pairs of blocks with the length of
    their common side over the mean size of a block, shape [n, 3].
    """
    mesh = problem.sheet.mesh
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    middle = mesh.points[mesh.cells].mean(axis=1)
    place = np.minimum(((middle - low) / (high - low) * counts).astype(np.int64), np.array(counts) - 1)
    kept, regions = np.unique(place[:, 0] * counts[1] + place[:, 1], return_inverse=True)
    number = {int(k): i for i, k in enumerate(kept)}
    size = (high - low) / np.array(counts)
    mean = float(np.sqrt(size.prod()))
    pairs = []
    for k, i in number.items():
        a, b = divmod(k, counts[1])
        if a + 1 < counts[0] and k + counts[1] in number:
            pairs.append((i, number[k + counts[1]], size[1] / mean))
        if b + 1 < counts[1] and k + 1 in number:
            pairs.append((i, number[k + 1], size[0] / mean))
    return regions.astype(np.int64), np.array(pairs, dtype=np.float64).reshape(-1, 3)


def total_variation(logs: FloatArray, touching: FloatArray) -> tuple[float, FloatArray]:
    """The second part of Eq. (H.1) without tau, and its gradient, shape [blocks]."""
    i, j, length = touching[:, 0].astype(int), touching[:, 1].astype(int), touching[:, 2]
    apart = logs[i] - logs[j]
    root = np.sqrt(apart**2 + SMOOTHING**2)
    gradient = np.zeros_like(logs)
    np.add.at(gradient, i, length * apart / root)
    np.add.at(gradient, j, -length * apart / root)
    return float((length * (root - SMOOTHING)).sum()), gradient


class _Blocks:
    """Chi-square of a sheet by blocks and its gradient."""

    def __init__(self, problem: FieldProblem, regions: IntArray) -> None:
        self.problem = problem
        self.solid = problem.constants.solid(problem.constants.start)
        self.sheet = replace(problem.sheet, regions=regions, held={})
        self.n = int(regions.max()) + 1

    def chi2(self, logs: FloatArray) -> tuple[float, FloatArray]:
        """Chi-square, and its gradient by ln s, shape [blocks]."""
        problem, data = self.problem, self.problem.data
        rows = np.exp(logs)[:, None] * self.solid.parameters()
        solution = solve(self.sheet.model(self.solid), {ENDS: data.pad}, rows)
        if not solution.outcome.ok:
            return FAILED, np.zeros(self.n)
        apart = solution.displacements - data.displacements
        loaded = problem.loaded(apart)
        misfit = self.sheet.force(solution) - data.force
        by_forces = np.zeros_like(loaded)
        moving = self.sheet.mesh.nodes(self.sheet.moving)
        by_forces[:, moving, self.sheet.axis] = (data.weight * misfit)[:, None]
        cost = 0.5 * float(np.einsum("nai,nai->", loaded, apart) + data.weight * (misfit @ misfit))
        slopes = (adjoint(solution, loaded, by_forces) * rows).sum(axis=1)
        unit = 2.0 / (data.area * data.sigma_displacement**2)
        return unit * cost, unit * slopes


def stiffness_map(
    problem: FieldProblem, counts: tuple[int, int], *, weights: Sequence[float] = WEIGHTS
) -> StiffnessMap:
    """Find the smoothest map of stiffness that explains a sheet's field.

    ``problem``: the sheet with its data. Its constants belong to factor 1. All parameters of the law must be
    moduli. ``counts``: number of blocks along x and y. ``weights``: trial values of tau, largest first. The
    first value that explains the data is used. If none does, the last value is used and
    `StiffnessMap.explained` is False.
    """
    regions, touching = blocks_of(problem, counts)
    blocks = _Blocks(problem, regions)
    data = problem.data
    degrees = len(data.pad) * (2.0 * float(problem.mass.sum()) / data.area + 1.0)
    logs = np.zeros(blocks.n)

    def shifted(one: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = blocks.chi2(np.full(blocks.n, one[0]))
        return value, np.array([gradient.sum()])

    def total(at: FloatArray, tau: float) -> tuple[float, FloatArray]:
        (value, gradient), (rough, slope) = blocks.chi2(at), total_variation(at, touching)
        return value + tau * rough, gradient + tau * slope

    shift = minimize(shifted, np.zeros(1), jac=True, method="L-BFGS-B", bounds=[(-LARGEST, LARGEST)])
    logs += float(shift.x[0])
    uniform, chi2, weight = float(shift.fun), float(shift.fun), float("inf")
    for weight in weights:
        minimum = minimize(
            total, logs, args=(weight,), jac=True, method="L-BFGS-B", bounds=[(-LARGEST, LARGEST)] * blocks.n,
            options={"maxiter": MOST_STEPS},
        )  # fmt: skip
        logs = np.asarray(minimum.x)
        chi2 = blocks.chi2(logs)[0]
        if chi2 <= EXPLAINED * degrees:
            break
    return StiffnessMap(np.exp(logs), regions, weight, chi2, degrees, uniform)
