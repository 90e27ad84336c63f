"""Fit constants to a displacement field and a pad's force (Sutula and others 2020, Secs. 3 and 4).

The same derivatives give the sensitivity of the constants to a measured displacement or force.

The search is Newton's method, Eq. (K.17). It uses the Gauss-Newton curvature and a secant estimate of the
remaining second derivatives (Dennis, Gay and Welsch 1981). The sensitivities of Eq. (K.19) use the exact
second derivatives. The cost is

    J(m) = sum_k 1/2 int |u_k(m) - u_msr,k|^2 dA + w/2 sum_k (f_k(m) - f_msr,k)^2           (K.3-K.6)

of Sutula and others (2020), with its gradient by du/dm, and its second derivatives. Their paper does not fix
w. Here w weights both parts by their noise. With one independent point per area a and the standard deviations
sigma_u and sigma_f, w = a sigma_u^2 / sigma_f^2. Then 2 J / (a sigma_u^2) is a chi-square.

If the camera moves and no mark of the fixed pad is measured, each field has an unknown translation t_k. The
best translation for any m is the mean of u_msr - u over the measured region. In all integrals above,
therefore,

    u_k(m) - u_msr,k  becomes  u_k(m) - u_msr,k - mean(u_k(m) - u_msr,k).                   (F.1)

At the minimum of the cost J(m, v) over the constants m, a change of the measurement v changes them by

    dm/dv = -[d2J/dm2]^-1 d2J/dm dv                                                         (K.18, K.19)

This gives variances (K.20-25) and sensitivity fields on the mesh (K.26, K.27). Before a test, it gives a map
that shows where a displacement would constrain the constants most (K.28-36).
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu

from doe.least_squares import newton_step
from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.bodies.sheet import Sheet, SheetState, mass_matrix, sheet_state
from kolsky.bodies.specimen_constants import Constants
from kolsky.equilibrium.sensitivity import second


@dataclass(frozen=True)
class FieldData:
    """A measured field at the nodes of a mesh, and the pad's motion and force."""

    pad: FloatArray
    """Displacement of the moving pad [m], shape [n]."""
    force: FloatArray
    """Force on it [N], shape [n]."""
    displacements: FloatArray
    """Measured displacements at the nodes [m], shape [n, nodes, 2]; zero at nodes without data."""
    cells: BoolArray
    """Cells inside the measured region, shape [m]."""
    sigma_displacement: float
    """Standard deviation of a point's displacement [m]."""
    sigma_force: float
    """Standard deviation of a force [N]."""
    area: float
    """Area of one independent point [m^2]."""
    floating: bool = False
    """True if each step's field has an unknown translation."""

    @property
    def weight(self) -> float:
        """w of Eq. (K.6) [m^4/N^2]."""
        return self.area * self.sigma_displacement**2 / self.sigma_force**2

    def only(self, step: int) -> "FieldData":
        """The data of one step."""
        chosen = slice(step, step + 1)
        return replace(
            self, pad=self.pad[chosen], force=self.force[chosen], displacements=self.displacements[chosen]
        )


@dataclass(frozen=True)
class Cost:
    """The cost and its derivatives at given constants."""

    displacement: FloatArray
    """1/2 int |u - u_msr|^2 of each step [m^4], shape [n]."""
    force: FloatArray
    """1/2 (f - f_msr)^2 of each step [N^2], shape [n]."""
    value: float
    """Cost J [m^4]."""
    gradients: FloatArray
    """dJ/dm of each step, shape [n, p]."""
    curvature_displacement: FloatArray
    """int du/dm_I . du/dm_J of all steps [m^4 per unit], shape [p, p]."""
    curvature_force: FloatArray
    """w df/dm_I df/dm_J of all steps, shape [p, p]."""
    state: SheetState

    @property
    def gauss_newton(self) -> FloatArray:
        """Second derivatives of J without the second derivatives of u and f, shape [p, p]."""
        return self.curvature_displacement + self.curvature_force


class FieldProblem:
    """A sheet, its data and its constants, some of which are free."""

    def __init__(self, sheet: Sheet, data: FieldData, constants: Constants) -> None:
        self.sheet, self.data, self.constants = sheet, data, constants

    @cached_property
    def mass(self) -> csr_array:
        """Mass matrix of the measured region, one component, shape [nodes, nodes]."""
        return mass_matrix(self.sheet.mesh, self.data.cells)

    def mean(self, fields: FloatArray) -> FloatArray:
        """Mean of nodal fields over the measured region, shape [..., 1, 2] of [..., nodes, 2]."""
        weights = np.asarray(self.mass.sum(axis=0)).ravel()
        return np.asarray((weights @ fields / weights.sum())[..., None, :])

    def loaded(self, fields: FloatArray) -> FloatArray:
        """Mass matrix times nodal fields of shape [..., nodes, 2]. If the translation of a field is unknown,
        the best-fit translation is removed (F.1)."""
        if self.data.floating:
            fields = fields - self.mean(fields)
        flat = fields.reshape(-1, *fields.shape[-2:])
        return np.stack([self.mass @ one for one in flat]).reshape(fields.shape)

    @property
    def last(self) -> "FieldProblem":
        """The problem with the last step only."""
        return FieldProblem(self.sheet, self.data.only(len(self.data.pad) - 1), self.constants)

    def cost(self, free: FloatArray, near: SheetState | None = None) -> Cost:
        """Eqs. (K.3-K.6) with derivatives from du/dm. `near`: a start state.

        Raises ValueError with the reason if the simulation fails.
        """
        return self._cost_of(sheet_state(self.sheet, self.constants, free, self.data.pad, near))

    def advance(self, cost: Cost, step: FloatArray) -> Cost:
        """The cost after a short step of the constants, with fields extrapolated by their derivatives."""
        state = cost.state
        moved = replace(
            state,
            displacements=state.displacements + np.einsum("npai,p->nai", state.by_constants, step),
            force=state.force + state.force_by_constants @ step,
        )
        return self._cost_of(moved)

    def _cost_of(self, state: SheetState) -> Cost:
        """Cost and derivatives of a simulated sheet."""
        data, w = self.data, self.data.weight
        apart = state.displacements - data.displacements
        apart = apart - self.mean(apart) if data.floating else apart
        loaded = self.loaded(apart)
        misfit = state.force - data.force
        moved = self.loaded(state.by_constants)
        gradients = np.einsum("nai,npai->np", loaded, state.by_constants)
        gradients += w * misfit[:, None] * state.force_by_constants
        curvature = np.einsum("npai,nqai->pq", moved, state.by_constants)
        by_force = w * state.force_by_constants.T @ state.force_by_constants
        displacement = 0.5 * np.einsum("nai,nai->n", loaded, apart)
        force = 0.5 * misfit**2
        value = float(displacement.sum() + w * force.sum())
        return Cost(displacement, force, value, gradients, curvature, by_force, state)

    def translation(self, state: SheetState) -> FloatArray:
        """Translation of the measured field of each step that fits best, Eq. (F.1) [m], shape [n, 1, 2]."""
        apart = self.data.displacements - state.displacements
        return self.mean(apart) * float(self.data.floating)

    def sizes(self, state: SheetState) -> FloatArray:
        """int u . u dA of the measured field of each step, without its translation [m^4], shape [n]."""
        own = self.data.displacements - self.translation(state)
        return np.array([np.einsum("ai,ai->", self.mass @ one, one) for one in own])

    def misfit(self, state: SheetState) -> FloatArray:
        """Misfit of the displacements divided by their size, for each step [-], shape [n]."""
        apart = state.displacements - self.data.displacements + self.translation(state)
        square = np.array([np.einsum("ai,ai->", self.mass @ one, one) for one in apart])
        return np.asarray(np.sqrt(square / self.sizes(state)))

    def hessian(self, free: FloatArray, cost: Cost | None = None) -> FloatArray:
        """Second derivatives of J, including the second derivatives of u and f, shape [p, p].

        They are exact (`kolsky.equilibrium.sensitivity`). ``cost``: the cost at these constants, if known.

        Raises ValueError if a simulation fails.
        """
        cost = self.cost(free) if cost is None else cost
        state, data = cost.state, self.data
        chain, bent = self.constants.chain(free), self.constants.chain_changes(free)
        own = len(chain)  # the fitted regions come first
        twice = second(state.slopes, first=own)
        # of u and f by the energy's constants, then by the fitted ones
        u_pq, u_p = twice.displacements, state.slopes.displacements[:, :own]
        u_ij = np.einsum("npqad,pi,qj->nijad", u_pq, chain, chain, optimize=True)
        u_ij += np.einsum("npad,pij->nijad", u_p, bent)
        axis, moving = self.sheet.axis, self.sheet.moving
        f_pq = twice.reaction(moving)[..., axis]
        f_p = state.slopes.reaction(moving)[:, :own, axis]
        f_ij = np.einsum("npq,pi,qj->nij", f_pq, chain, chain) + np.einsum("np,pij->nij", f_p, bent)
        loaded = self.loaded(state.displacements - data.displacements)
        left = np.einsum("nad,nijad->ij", loaded, u_ij)
        left += data.weight * np.einsum("n,nij->ij", state.force - data.force, f_ij)
        return np.asarray(cost.gauss_newton + left)


SMALLEST_EIGENVALUE = 1e-9
"""Smallest nonzero eigenvalue divided by the largest, for the curvature by relative constants."""


def parameter_change(hessian: FloatArray, mixed: FloatArray) -> FloatArray:
    """Derivative of the fitted constants by a measured value, Eq. (K.19)."""
    size = np.sqrt(np.abs(np.diag(hessian)))
    if not (size > 0.0).all():
        raise ValueError("the cost does not depend on one of the constants: hold it, or measure more")
    try:
        factor = cho_factor(hessian / np.outer(size, size))
    except np.linalg.LinAlgError:
        raise ValueError(
            "the cost has no minimum here: its second derivatives are not positive definite"
        ) from None
    return np.asarray(-cho_solve(factor, mixed / size[:, None]) / size[:, None])


def relative_deviation(change: FloatArray, constants: FloatArray) -> FloatArray:
    """Standard deviation of each constant divided by its size, for noise of 1 unit in each measured value,
    Eqs. (K.20-25), shape [..., p]. ``change``: dm/dv, shape [..., p, n]."""
    if not (constants != 0.0).all():
        raise ValueError("a constant is zero: a deviation relative to it has no meaning")
    return np.asarray(np.sqrt((change**2).sum(axis=-1)) / np.abs(constants))


def smoothed(mass: csr_array, change: FloatArray) -> FloatArray:
    """Sensitivity as a field, Eqs. (K.26, K.27).

    Its integral with a disturbance is the change of the constants.

    ``mass``: mass matrix of the region with measurements, sparse, [n, n]. Rows without mass belong to nodes
    outside it. ``change``: dm/dv of the nodal values, shape [p, n].
    """
    inside = np.flatnonzero(mass.diagonal() > 0.0)
    field = np.zeros_like(change)
    solver = splu(csc_array(mass[inside][:, inside]))
    field[:, inside] = solver.solve(np.ascontiguousarray(change[:, inside].T)).T
    return field


@dataclass(frozen=True)
class BeforeTest:
    """Sensitivity to displacements of the whole domain, before any measurement."""

    directions: FloatArray
    """Combinations of relative constants that displacements constrain, one per row, shape [k, p]. It is the
    identity if displacements constrain every constant separately."""
    change: FloatArray
    """Change of each combination by a nodal displacement, Eq. (K.32) or (K.35) [1/m], shape [k, n]."""
    field: FloatArray
    """This change as a field, Eq. (K.36) [1/m^3], shape [k, n]."""
    singular: bool
    """True if a combination of constants affects no displacement. Eigenvectors are then used."""


def before_test(slopes: FloatArray, mass: csr_array, constants: FloatArray) -> BeforeTest:
    """Map of the places at which a displacement would constrain the constants most, Eqs. (K.28-36).

    The model is assumed correct, u = u_msr. The curvature is then that of Eq. (K.30). The constants are
    relative to their values, because eigenvectors have no meaning for mixed units (Pa and pure numbers).

    ``slopes``: du/dm of every nodal displacement, shape [p, n]. ``mass``: mass matrix of the whole domain,
    sparse, [n, n]. ``constants``: the constants, none of them zero, shape [p].
    """
    if not (constants != 0.0).all():
        raise ValueError("a constant is zero: choose the value for which the test is planned")
    relative = slopes * np.abs(constants)[:, None]
    loaded = np.asarray((mass @ relative.T).T)
    curvature = relative @ loaded.T  # Eq. (K.30)
    values, vectors = np.linalg.eigh(0.5 * (curvature + curvature.T))
    values, vectors = values[::-1], vectors[:, ::-1].T
    if not values[0] > 0.0:
        raise ValueError("no constant moves a displacement: a force has to be measured")
    seen = values > SMALLEST_EIGENVALUE * values[0]
    if seen.all():
        directions = np.eye(len(values))
        inverse = np.linalg.inv(curvature)  # Eq. (K.32)
        return BeforeTest(directions, inverse @ loaded, inverse @ relative, False)
    vectors = vectors[seen]
    vectors *= np.sign(vectors[np.arange(len(vectors)), np.abs(vectors).argmax(axis=1)])[:, None]
    weights = vectors / values[seen][:, None]  # Eqs. (K.34, K.35)
    return BeforeTest(vectors, weights @ loaded, weights @ relative, True)


MOST_RUNS = 40
"""Maximum number of simulations in a search."""
STEP_TOLERANCE = 1e-4
"""A search ends if the step of the constants, divided by their sizes, is below this [-]. With exact second
derivatives and the slopes of the fields, the error after this last step is its square."""
ROUGH_TOLERANCE = 3e-3
"""The same limit for a search in the last step alone. If the constants drift with the load, it ends some per
cent away from the result."""
LONGEST = 0.5
"""Longest step of a constant divided by its size [-]."""
LEAST_SIZE = {"1": 0.5, "Pa": 1e-2}
"""Smallest size of a constant divided by its scale, by unit [-]. Numbers may pass through 0. A modulus
decreases by halves, because no sheet has an equilibrium near 0."""
OTHER_PLACES = (0.1, 0.9)
"""Positions of other starts in the range of a constant with two bounds [-]."""
APART = 0.05
"""Smallest distance of two different minima, divided by the size of a constant [-]. Rough searches scatter by
less."""
Progress = Callable[[int, int], None]
"""Called with the number of runs done and their maximum."""


def SILENT(done: int, most: int) -> None:
    """Progress function that does nothing."""


EXPLAINED_SHARE = 0.05
"""Largest relative misfit of displacements or forces, beyond their noise, that is explained [-]."""
TESTABLE_SHARE = 0.5
"""Noise of the forces divided by their size, above which forces are not a test [-]. Even their sign is then
uncertain."""


@dataclass(frozen=True)
class FieldFit:
    """Fitted constants of a sheet with their uncertainties and checks."""

    problem: FieldProblem
    constants: Constants
    """The law with the fitted values."""
    cost: Cost
    hessian: FloatArray
    """Second derivatives of J at the fitted constants, shape [p, p]."""
    by_displacement: FloatArray
    """dm/du_msr of every step, Eq. (K.19), shape [n, p, nodes, 2]."""
    by_force: FloatArray
    """dm/df_msr of every step [1/N], shape [n, p]."""
    converged: bool
    at_bound: tuple[bool, ...]
    """Constants at a bound if the cost decreases beyond it. They have no uncertainty."""
    simulations: int
    """Number of simulations in the search, not counting those for second derivatives."""
    rough: tuple[FloatArray, float]
    """Constants at the end of the search in the last step alone, and their cost."""
    minima: tuple["LocalMinimum", ...] = ()

    @property
    def values(self) -> FloatArray:
        """The free constants, SI, shape [p]."""
        return self.constants.start

    @property
    def misfit(self) -> FloatArray:
        """Misfit of the displacements divided by their size, for each step [-], shape [n]."""
        return self.problem.misfit(self.cost.state)

    @property
    def noise(self) -> FloatArray:
        """The misfit expected from the noise of the points alone [-], shape [n]."""
        area, sigma = float(self.problem.mass.sum()), self.problem.data.sigma_displacement
        return np.asarray(np.sqrt(2.0 * area) * sigma / np.sqrt(self.problem.sizes(self.cost.state)))

    @property
    def scales(self) -> tuple[float, float]:
        """Variance of the misfit divided by that of the noise, at least 1, for displacements and for force
        [-].
        """
        data = self.problem.data
        displacements = 2.0 * len(data.pad) * float(self.problem.mass.sum()) / data.area
        displacements -= 2.0 * len(data.pad) * data.floating
        of_field = 2.0 * self.cost.displacement.sum() / (data.area * data.sigma_displacement**2)
        of_force = 2.0 * self.cost.force.sum() / data.sigma_force**2
        field = max(1.0, float(of_field) / max(displacements - len(self.values), 1.0))
        return field, max(1.0, float(of_force) / max(len(data.pad) - 1.0, 1.0))

    @property
    def force_misfit(self) -> float:
        """Misfit of the forces of all steps divided by their size [-]."""
        data = self.problem.data
        return _share(self.cost.state.force - data.force, data.force)

    @property
    def force_noise(self) -> float:
        """The misfit expected from the declared noise of the forces alone [-]."""
        data = self.problem.data
        return _share(np.full(len(data.force), data.sigma_force), data.force)

    @property
    def adequate(self) -> bool:
        """True if the model explains the field: its misfit beyond noise is at most `EXPLAINED_SHARE`."""
        beyond = np.sqrt(np.maximum(self.misfit**2 - self.noise**2, 0.0))
        return bool(beyond.max() <= EXPLAINED_SHARE)

    @property
    def force_testable(self) -> bool:
        """True if the forces exceed their noise. They can then contradict a model."""
        return self.force_noise <= TESTABLE_SHARE

    @property
    def force_explained(self) -> bool:
        """True if the model explains the forces: their misfit beyond noise is at most `EXPLAINED_SHARE`."""
        return self.force_misfit**2 - self.force_noise**2 <= EXPLAINED_SHARE**2

    @property
    def explained(self) -> bool:
        """True if the model explains the field and the forces."""
        return self.adequate and self.force_explained

    @property
    def covariance(self) -> FloatArray:
        r"""Of the constants, shape [p, p].

        H^-1 a sigma_u^2 (s_u^2 A_u + s_f^2 A_f) H^-1, with the two parts A_u and A_f of the curvature. With s
        = 1 it is the covariance from noise. A part that the model does not explain is scaled by its misfit.
        Rows of constants at a bound are zero.
        """
        data = self.problem.data
        field, force = self.scales
        middle = field * self.cost.curvature_displacement + force * self.cost.curvature_force
        inverse = np.zeros_like(self.hessian)
        free = np.ix_(~np.array(self.at_bound), ~np.array(self.at_bound))
        inverse[free] = np.linalg.inv(self.hessian[free])
        return np.asarray(data.area * data.sigma_displacement**2 * inverse @ middle @ inverse)

    @property
    def sigma(self) -> FloatArray:
        """Standard uncertainty of the constants, shape [p]."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def relative_by_displacement(self) -> FloatArray:
        """Relative deviation of each constant over the noise of nodal displacements (K.24) [1/m], [n, p]."""
        return self._relative(self.by_displacement.reshape(*self.by_force.shape, -1))

    @property
    def relative_by_force(self) -> FloatArray:
        """Relative deviation of each constant over the noise of each step's force (K.25) [1/N], [n, p]."""
        return self._relative(self.by_force[..., None])

    def _relative(self, change: FloatArray) -> FloatArray:
        free, found = ~np.array(self.at_bound), np.zeros(change.shape[:2])
        found[:, free] = relative_deviation(change[:, free], self.values[free])
        return found

    @property
    def warnings(self) -> list[str]:
        """Warnings about the constants."""
        warnings = [] if self.converged else ["the search did not come to rest"]
        turned, cells = self.problem.sheet.turned, len(self.problem.sheet.mesh.cells)
        if turned:
            axis = "; one of its axes may be mirrored" if turned == cells else ""
            warnings.append(f"{turned} of {cells} cells of the mesh run clockwise and were turned{axis}")
        warnings += [
            f"{name} is at its bound: the data need a value outside"
            for name, held in zip(self.constants.free, self.at_bound, strict=True)
            if held
        ]
        names = self.constants.free
        for one in self.minima:
            ends = ", ".join(f"{n} = {v:.4g}" for n, v in zip(names, one.values, strict=True))
            begins = ", ".join(f"{n} = {v:.4g}" for n, v in zip(names, one.start, strict=True))
            warnings.append(
                f"the start matters: from {begins} the search in the last frame ends at {ends} (SI), with "
                f"{one.ratio:.3g} times the misfit of the answer; hold a constant that is known, or measure "
                "where the two differ"
            )
        if not self.adequate:
            warnings.append(
                f"the model does not explain the displacement field: its misfit is "
                f"{100.0 * self.misfit.min():.3g} to {100.0 * self.misfit.max():.3g} % of the displacements, "
                f"noise alone would make {100.0 * self.noise.max():.2g} %; the constants are those of the "
                "nearest such sheet, and differ from step to step"
            )
        if not self.force_explained:
            warnings.append(
                f"the model does not explain the force: its misfit is {100.0 * self.force_misfit:.3g} % of "
                f"the force, noise alone would make {100.0 * self.force_noise:.2g} %"
            )
        elif not self.force_testable:
            warnings.append(
                f"the force is not testable: its declared noise is {100.0 * self.force_noise:.3g} % of it; "
                "pull further, or use a finer load cell"
            )
        return warnings


def _share(part: FloatArray, whole: FloatArray) -> float:
    """Norm of a vector divided by that of another; infinite if the other is zero."""
    size = float(np.linalg.norm(whole))
    return float(np.linalg.norm(part)) / size if size > 0.0 else np.inf


@dataclass
class _Search:
    """State of a search of `fit_field`."""

    free: FloatArray
    """Constants, shape [p]."""
    cost: Cost
    """The cost at these constants."""
    remainder: FloatArray
    """Estimate of the second derivatives without the Gauss-Newton part, shape [p, p]."""
    runs: int = 1
    """Simulations of all steps so far."""
    converged: bool = False

    @property
    def gradient(self) -> FloatArray:
        """Gradient of the cost of all steps, shape [p]."""
        return np.asarray(self.cost.gradients.sum(axis=0))


def fit_field(problem: FieldProblem, *, progress: Progress = SILENT) -> FieldFit:
    """Fit a sheet: first a rough search in the last step alone, then a search in all steps.

    ``progress``: called with the number of the simulation and the maximum number.

    Raises ValueError if the simulation at the start fails.
    """
    start = problem.constants.start
    if len(problem.data.pad) == 1:
        ended = _search(problem, start, tolerance=STEP_TOLERANCE, progress=progress)
        return _fit_at(problem, ended, ended.runs, (ended.free, ended.cost.value))
    first = _search(problem.last, start, tolerance=ROUGH_TOLERANCE, progress=progress)
    remainder = first.remainder / first.cost.gauss_newton[0, 0]
    try:
        ended = _search(problem, first.free, tolerance=STEP_TOLERANCE, remainder=remainder, progress=progress)
    except ValueError:  # wrong data may lead the last step to a point where the others have no equilibrium
        ended = _search(problem, start, tolerance=STEP_TOLERANCE, progress=progress)
    return _fit_at(problem, ended, first.runs + ended.runs, (first.free, first.cost.value))


def _search(
    problem: FieldProblem,
    start: FloatArray,
    *,
    tolerance: float,
    remainder: FloatArray | None = None,
    progress: Progress,
) -> _Search:
    """Minimise the cost. `remainder`: of `_Search`, divided by the first Gauss-Newton second derivative."""
    low, high = problem.constants.bounds
    try:
        begun = problem.cost(start)
    except ValueError as error:
        raise ValueError(f"the simulation at the start failed: {error}") from None
    curved = begun.gauss_newton
    at = _Search(start, begun, np.zeros_like(curved) if remainder is None else curved[0, 0] * remainder)
    progress(at.runs, MOST_RUNS)
    while at.runs < MOST_RUNS:
        size = _sizes(problem.constants, at.free)
        near, far = np.maximum(low - at.free, -LONGEST * size), np.minimum(high - at.free, LONGEST * size)
        step = newton_step(at.cost.gauss_newton + at.remainder, at.gradient, near, far)
        if not step @ at.gradient < 0.0:  # the second derivatives are of a saddle
            at.remainder = np.zeros_like(at.remainder)
            step = newton_step(at.cost.gauss_newton, at.gradient, near, far)
        longest = float(np.abs(step / size).max())
        if longest <= tolerance:
            at.converged = True
            return at
        found, trial, length = None, at.free, 2.0
        while length * longest > tolerance and at.runs < MOST_RUNS:
            length *= 0.5
            trial = np.clip(at.free + length * step, low, high)
            with suppress(ValueError):  # no equilibrium at that step: a shorter one is tried
                found = problem.cost(trial, at.cost.state)
            at.runs += 1
            progress(at.runs, MOST_RUNS)
            if found is not None and found.value <= at.cost.value:
                break
        if found is None or found.value > at.cost.value:
            return at
        before, moved = at.gradient, trial - at.free
        at.free, at.cost = trial, found
        at.remainder = secant(at.remainder, moved, at.gradient - before - found.gauss_newton @ moved, size)
    return at


def secant(remainder: FloatArray, step: FloatArray, change: FloatArray, size: FloatArray) -> FloatArray:
    """Second derivatives updated for a step that changes the gradient by `change`. This is the symmetric
    update of rank one (Davidon 1991). It is left out if it is unbounded. ``size``: of the constants, shape
    [p]."""
    lacking = change - remainder @ step
    along = float(lacking @ step)
    if abs(along) <= 1e-8 * float(np.linalg.norm(lacking * size) * np.linalg.norm(step / size)):
        return remainder
    return np.asarray(remainder + np.outer(lacking, lacking) / along)


def _fit_at(problem: FieldProblem, ended: _Search, runs: int, rough: tuple[FloatArray, float]) -> FieldFit:
    """The result at the end of a search, with second derivatives and sensitivities."""
    free, here, (low, high) = ended.free, ended.cost, problem.constants.bounds
    final = problem.hessian(free, here)
    if ended.converged:
        step = newton_step(final, ended.gradient, low - free, high - free)
        if (np.abs(step) <= 10.0 * STEP_TOLERANCE * _sizes(problem.constants, free)).all():
            free, here = free + step, problem.advance(here, step)
    own = FieldProblem(problem.sheet, problem.data, problem.constants.with_free(free))
    slope = here.gradients.sum(axis=0)
    held = ((free <= low) & (slope >= 0.0)) | ((free >= high) & (slope <= 0.0))  # the cost falls beyond it
    seen = np.flatnonzero(~held)
    converged, relative = ended.converged, np.sqrt(np.abs(np.diag(final)))
    if len(seen) and not (
        (relative[seen] > 0.0).all()
        and np.linalg.eigvalsh((final / np.outer(relative, relative))[np.ix_(seen, seen)])[0] > 0.0
    ):
        final, converged = here.gauss_newton, False  # not a minimum: only its slopes are known
    own_final = final[np.ix_(seen, seen)]
    n, p, nodes, d = here.state.by_constants.shape
    mixed = -own.loaded(here.state.by_constants)
    by_displacement, by_force = np.zeros((n, p, nodes * d)), np.zeros((n, p))
    for k, (field, force) in enumerate(zip(mixed, here.state.force_by_constants, strict=True)):
        by_displacement[k, seen] = parameter_change(own_final, field.reshape(p, -1)[seen])
        pulled = -problem.data.weight * force[seen, None]
        by_force[k, seen] = parameter_change(own_final, pulled)[:, 0]
    shape = (n, p, nodes, d)
    at_bound = tuple(bool(one) for one in held)
    return FieldFit(
        own, own.constants, here, final, by_displacement.reshape(shape), by_force, converged, at_bound, runs,
        rough,
    )  # fmt: skip


@dataclass(frozen=True)
class LocalMinimum:
    """End of a search in the last step from another start."""

    start: FloatArray
    """Free constants at the start, shape [p]."""
    values: FloatArray
    """Free constants at the end, shape [p]."""
    ratio: float
    """Cost of the last step divided by that of the result [-]."""


def with_other_starts(fit: FieldFit, begun: FloatArray, *, progress: Progress = SILENT) -> FieldFit:
    """The best fit from several starts, with the other minima; `begun`: start of the first fit.

    Other starts are tried only if the model does not explain the data, or if a constant is at its bound. If
    the model explains the data, the cost at the result is that of noise, and no other minimum can be lower.
    Constants with two bounds start at `OTHER_PLACES` of their range, the others at their fitted values.
    """
    if not any(fit.at_bound) and fit.explained:
        return fit
    problem, constants = fit.problem, fit.constants
    low, high = constants.bounds
    between = np.isfinite(high - low)
    if not between.any():
        return fit
    best, runs, ends, home = fit, fit.simulations, [], fit.rough
    for place in OTHER_PLACES:
        start = np.where(between, low + place * np.where(between, high - low, 0.0), fit.values)
        try:
            ended = _search(problem.last, start, tolerance=ROUGH_TOLERANCE, progress=progress)
        except ValueError:
            continue  # no equilibrium at that start: it is left out
        runs += ended.runs
        ends.append((start, ended.free, ended.cost.value))
    lowest = min(ends, key=lambda one: one[2], default=None)
    if lowest is not None and lowest[2] < home[1] and _apart(constants, lowest[1], home[0]):
        again = _search(problem, lowest[1], tolerance=STEP_TOLERANCE, progress=progress)
        runs += again.runs
        if again.cost.value < fit.cost.value:
            best = _fit_at(problem, again, runs, lowest[1:])
            ends, home = [*ends, (begun, *home)], lowest[1:]
    minima = tuple(
        LocalMinimum(start, free, value / home[1])
        for start, free, value in ends
        if _apart(constants, free, home[0])
    )
    return replace(best, minima=minima, simulations=runs)


def _sizes(constants: Constants, free: FloatArray) -> FloatArray:
    """Sizes of the constants, by which steps are compared, shape [p]."""
    least = np.array([LEAST_SIZE[spec.unit] for spec in constants.free_specs])
    return np.asarray(np.maximum(np.abs(free), least * constants.scales))


def _apart(constants: Constants, one: FloatArray, other: FloatArray) -> bool:
    """True if the ends of two searches are different minima."""
    return bool((np.abs(one - other) > APART * _sizes(constants, other)).any())


def fit_steps(problem: FieldProblem) -> list[FieldFit | str]:
    """Fit every step separately. If the constants drift with the load, the law is inadequate."""
    fits: list[FieldFit | str] = []
    for step in range(len(problem.data.pad)):
        try:
            fits.append(fit_field(FieldProblem(problem.sheet, problem.data.only(step), problem.constants)))
        except ValueError as error:
            fits.append(str(error))
    return fits
