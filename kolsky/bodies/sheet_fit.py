"""Constants fitted to a displacement field and a pad's force (Sutula and others 2020, Secs. 3 and 4).

The sensitivity of the constants to a measured displacement or force follows from the same derivatives.

Newton's method, Eq. (K.17), on the cost of `field_problem`: far from the minimum with the curvature of Gauss
and Newton, near it with the exact second derivatives, which the sensitivities of Eq. (K.19) need as well.

    J(m) = sum_k 1/2 int |u_k(m) - u_msr,k|^2 dA + w/2 sum_k (f_k(m) - f_msr,k)^2           (K.3-K.6)

of Sutula and others (2020), with its gradient by du/dm, and its second
derivatives. Their w is a matter of taste. Here it makes both parts count by their noise: with one
independent point for the area a and the deviations sigma_u and sigma_f, w = a sigma_u^2 / sigma_f^2, and 2 J
/ (a sigma_u^2) is a chi-square.

Where the camera moves and no mark of the fixed pad is measured, each field has an unknown translation t_k.
The best one for any m is the mean of u_msr - u over the measured region, so that in all integrals above

    u_k(m) - u_msr,k  becomes  u_k(m) - u_msr,k - mean(u_k(m) - u_msr,k).                   (F.1)

At the minimum of the cost J(m, v) over the constants m a changed measurement v moves them by

    dm/dv = -[d2J/dm2]^-1 d2J/dm dv                                                         (K.18, K.19)

which gives variances (K.20-25), sensitivity fields on the mesh (K.26, K.27), and before any test has been
made a map of where a displacement would tell most (K.28-36).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import splu

from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.bodies.sheet import Sheet, SheetState, mass_matrix, sheet_state
from kolsky.bodies.specimen_constants import Constants
from kolsky.equilibrium.sensitivity import second


@dataclass(frozen=True)
class FieldData:
    """A measured field on the nodes of a mesh, and the pad's motion and force."""

    pad: FloatArray
    """Displacement of the moving pad [m], shape [n]."""
    force: FloatArray
    """Force on it [N], shape [n]."""
    displacements: FloatArray
    """Measured displacements at the nodes [m], shape [n, nodes, 2]; zero where there are none."""
    cells: BoolArray
    """Cells inside the measured region, shape [m]."""
    sigma_displacement: float
    """Standard deviation of a point's displacement [m]."""
    sigma_force: float
    """Standard deviation of a force [N]."""
    area: float
    """Area of one independent point [m^2]."""
    floating: bool = False
    """Whether each step's field has a translation that is not measured."""

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
    """The cost and its derivatives at some constants."""

    displacement: FloatArray
    """1/2 int |u - u_msr|^2 of each step [m^4], shape [n]."""
    force: FloatArray
    """1/2 (f - f_msr)^2 of each step [N^2], shape [n]."""
    value: float
    """J [m^4]."""
    gradients: FloatArray
    """dJ/dm of each step, shape [n, p]."""
    curvature_displacement: FloatArray
    """int du/dm_I . du/dm_J of all steps [m^4 per unit], shape [p, p]."""
    curvature_force: FloatArray
    """w df/dm_I df/dm_J of all steps, shape [p, p]."""
    state: SheetState
    """The simulation."""

    @property
    def gauss_newton(self) -> FloatArray:
        """Second derivatives of J without those of u and f, shape [p, p]."""
        return self.curvature_displacement + self.curvature_force


class FieldProblem:
    """A sheet, its data and what is free."""

    def __init__(self, sheet: Sheet, data: FieldData, constants: Constants) -> None:
        self.sheet, self.data, self.constants = sheet, data, constants

    @cached_property
    def mass(self) -> csr_matrix:
        """Mass matrix of the measured region, one component, shape [nodes, nodes]."""
        return mass_matrix(self.sheet.mesh, self.data.cells)

    def mean(self, fields: FloatArray) -> FloatArray:
        """Mean of nodal fields over the measured region, shape [..., 1, 2] of [..., nodes, 2]."""
        weights = np.asarray(self.mass.sum(axis=0)).ravel()
        return np.asarray((weights @ fields / weights.sum())[..., None, :])

    def loaded(self, fields: FloatArray) -> FloatArray:
        """Mass matrix times nodal fields of shape [..., nodes, 2].

        Where the translation of a field is not measured, the one that fits best is taken out (F.1).
        """
        if self.data.floating:
            fields = fields - self.mean(fields)
        flat = fields.reshape(-1, *fields.shape[-2:])
        return np.stack([self.mass @ one for one in flat]).reshape(fields.shape)

    def cost(self, free: FloatArray) -> Cost | str:
        """Eqs. (K.3-K.6) with derivatives from du/dm, or why there are none."""
        state = sheet_state(self.sheet, self.constants, free, self.data.pad)
        if isinstance(state, str):
            return state
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

    def hessian(self, free: FloatArray) -> FloatArray:
        """Second derivatives of J, those of u and f included, shape [p, p].

        They are exact (`kolsky.equilibrium.sensitivity`).

        Raises ValueError if a simulation fails.
        """
        cost = self.cost(free)
        if isinstance(cost, str):
            raise ValueError(f"second derivatives need a simulation: {cost}")
        state, data = cost.state, self.data
        chain, bent = self.constants.chain(free), self.constants.chain_changes(free)
        own = len(chain)  # the fitted regions come first
        twice = second(state.slopes, first=own)
        # of u and f by the energy's constants, then by what is fitted
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
"""Least eigenvalue over the largest, of the curvature by relative constants, that counts as not zero."""


def parameter_change(hessian: FloatArray, mixed: FloatArray) -> FloatArray:
    """Change of the fitted constants by a measurement, Eq. (K.19)."""
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


def variance(change: FloatArray, sigma: FloatArray | float) -> FloatArray:
    """Variance of each constant from uncorrelated noise, Eqs. (K.20-23).

    ``change``: dm/dv, shape [p, n]. ``sigma``: standard deviation of each measurement, one number or shape
    [n].
    """
    return np.asarray(((change * np.asarray(sigma)) ** 2).sum(axis=1))


def relative_deviation(change: FloatArray, sigma: FloatArray | float, constants: FloatArray) -> FloatArray:
    """Standard deviation of each constant over its size [-], Eqs. (K.24, K.25), shape [p]."""
    if not (constants != 0.0).all():
        raise ValueError("a constant is zero: a deviation relative to it has no meaning")
    return np.asarray(np.sqrt(variance(change, sigma)) / np.abs(constants))


def smoothed(mass: csr_matrix, change: FloatArray) -> FloatArray:
    """Sensitivity as a field, so that its integral with a disturbance is the change, Eqs. (K.26, K.27).

    ``mass``: mass matrix of the region with measurements, sparse, [n, n]; rows without mass belong to nodes
    outside it. ``change``: dm/dv of the nodal values, shape [p, n].
    """
    inside = np.flatnonzero(mass.diagonal() > 0.0)
    field = np.zeros_like(change)
    solver = splu(csc_matrix(mass[inside][:, inside]))
    field[:, inside] = solver.solve(np.ascontiguousarray(change[:, inside].T)).T
    return field


@dataclass(frozen=True)
class BeforeTest:
    """What displacements of the whole domain would tell, before any has been measured."""

    directions: FloatArray
    """Combinations of relative constants that displacements see, one a row, shape [k, p]. The identity where
    they see every constant apart."""
    eigenvalues: FloatArray
    """Of the curvature by relative constants, descending [m^4], shape [p]."""
    change: FloatArray
    """Change of each by a nodal displacement, Eq. (K.32) or (K.35) [1/m], shape [k, n]."""
    field: FloatArray
    """The same as a field, Eq. (K.36) [1/m^3], shape [k, n]."""
    singular: bool
    """Whether some combination of constants moves no displacement, so that eigenvectors stand in."""


def before_test(slopes: FloatArray, mass: csr_matrix, constants: FloatArray) -> BeforeTest:
    """Map where a displacement would tell most of the constants, Eqs. (K.28-36).

    The model is taken as right, u = u_msr, so that the curvature is that of Eq. (K.30). The constants are
    taken relative to their values: with Pa and pure numbers beside each other an eigenvector has no meaning.

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
        return BeforeTest(directions, values, inverse @ loaded, inverse @ relative, False)
    vectors = vectors[seen]
    vectors *= np.sign(vectors[np.arange(len(vectors)), np.abs(vectors).argmax(axis=1)])[:, None]
    weights = vectors / values[seen][:, None]  # Eqs. (K.34, K.35)
    return BeforeTest(vectors, values, weights @ loaded, weights @ relative, True)


MOST_STEPS = 30
"""Most steps of Newton's method."""
STEP_TOLERANCE = 1e-9
"""Relative step of the constants at which it has ended."""
LONGEST = 0.3
"""Longest relative step of a constant."""
NEAR = 0.02
"""Relative step below which the exact second derivatives take over."""
EXPLAINED_SHARE = 0.05
"""Largest misfit of displacements or forces over their size, beyond their noise, that counts as explained."""
TESTABLE_SHARE = 0.5
"""Noise of the forces over their size above which they test nothing: their sign alone is then in doubt."""


@dataclass(frozen=True)
class FieldFit:
    """Constants of a sheet, and what the data say of them."""

    problem: FieldProblem
    constants: Constants
    """The law with the fitted values in place."""
    cost: Cost
    """The cost there."""
    hessian: FloatArray
    """Second derivatives of J there, shape [p, p]."""
    by_displacement: FloatArray
    """dm/du_msr of every step, Eq. (K.19), shape [n, p, nodes, 2]."""
    by_force: FloatArray
    """dm/df_msr of every step [1/N], shape [n, p]."""
    converged: bool
    """Whether Newton's method came to rest."""
    at_bound: tuple[bool, ...]
    """Constants that lie on a bound with the cost falling beyond it: nothing else is said of them."""
    simulations: int
    """Simulations of the search, those for second derivatives not counted."""

    @property
    def values(self) -> FloatArray:
        """The free constants, SI, shape [p]."""
        return self.constants.start

    @property
    def misfit(self) -> FloatArray:
        """Displacements' misfit over their size, of each step [-], shape [n]."""
        return np.asarray(np.sqrt(2.0 * self.cost.displacement / self._sizes))

    @property
    def translation(self) -> FloatArray:
        """Translation of the measured field of each step that fits best, Eq. (F.1) [m], shape [n, 1, 2]."""
        apart = self.problem.data.displacements - self.cost.state.displacements
        return self.problem.mean(apart) * float(self.problem.data.floating)

    @property
    def _sizes(self) -> FloatArray:
        """int u . u dA of the measured field of each step, less its translation [m^4], shape [n]."""
        mass, own = self.problem.mass, self.problem.data.displacements - self.translation
        return np.array([np.einsum("ai,ai->", mass @ one, one) for one in own])

    @property
    def noise(self) -> FloatArray:
        """The misfit that the noise of the points alone would make [-], shape [n]."""
        area, sigma = float(self.problem.mass.sum()), self.problem.data.sigma_displacement
        return np.asarray(np.sqrt(2.0 * area) * sigma / np.sqrt(self._sizes))

    @property
    def scales(self) -> tuple[float, float]:
        """Variance of the misfit over that of noise, at least 1: of the displacements and of the force
        [-]."""
        data = self.problem.data
        displacements = 2.0 * len(data.pad) * float(self.problem.mass.sum()) / data.area
        displacements -= 2.0 * len(data.pad) * data.floating
        of_field = 2.0 * self.cost.displacement.sum() / (data.area * data.sigma_displacement**2)
        of_force = 2.0 * self.cost.force.sum() / data.sigma_force**2
        field = max(1.0, float(of_field) / max(displacements - len(self.values), 1.0))
        return field, max(1.0, float(of_force) / max(len(data.pad) - 1.0, 1.0))

    @property
    def force_misfit(self) -> float:
        """Misfit of the forces of all steps over their size [-]."""
        data = self.problem.data
        return _share(self.cost.state.force - data.force, data.force)

    @property
    def force_noise(self) -> float:
        """The misfit that the declared noise of the forces alone would make [-]."""
        data = self.problem.data
        return _share(np.full(len(data.force), data.sigma_force), data.force)

    @property
    def adequate(self) -> bool:
        """Whether the model explains the field: its misfit beyond noise is at most `EXPLAINED_SHARE`."""
        beyond = np.sqrt(np.maximum(self.misfit**2 - self.noise**2, 0.0))
        return bool(beyond.max() <= EXPLAINED_SHARE)

    @property
    def force_testable(self) -> bool:
        """Whether the forces are larger than their noise, so that they can contradict a model."""
        return self.force_noise <= TESTABLE_SHARE

    @property
    def force_explained(self) -> bool:
        """Whether the model explains the forces: their misfit beyond noise is at most `EXPLAINED_SHARE`."""
        return self.force_misfit**2 - self.force_noise**2 <= EXPLAINED_SHARE**2

    @property
    def explained(self) -> bool:
        """Whether the model explains the field and the forces."""
        return self.adequate and self.force_explained

    @property
    def covariance(self) -> FloatArray:
        r"""Of the constants, shape [p, p].

        H^-1 a sigma_u^2 (s_u^2 A_u + s_f^2 A_f) H^-1, A_u and A_f the two parts of the curvature: with s = 1
        that of the noise; a part that the model does not explain counts by its misfit. Rows of constants
        at a bound are zero.
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

    def relative_by_displacement(self, sigma: float) -> FloatArray:
        """Relative deviation of each constant from noise of the nodal displacements of each step (K.24)."""
        n, p = self.by_force.shape
        flat = self.by_displacement.reshape(n, p, -1)
        return np.array([self._relative(one, sigma) for one in flat])

    def relative_by_force(self, sigma: float) -> FloatArray:
        """Relative deviation of each constant from noise of the force of each step (K.25), shape [n, p]."""
        return np.array([self._relative(one[:, None], sigma) for one in self.by_force])

    def _relative(self, change: FloatArray, sigma: float) -> FloatArray:
        free = ~np.array(self.at_bound)
        found = np.zeros(len(free))
        found[free] = relative_deviation(change[free], sigma, self.values[free])
        return found

    @property
    def warnings(self) -> list[str]:
        """What to know before using the constants."""
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
    """Size of a vector over that of another; infinite where the other is zero."""
    size = float(np.linalg.norm(whole))
    return float(np.linalg.norm(part)) / size if size > 0.0 else np.inf


def fit_field(problem: FieldProblem) -> FieldFit:
    """Fit a sheet by Newton's method, Eq. (K.17)."""
    low, high = problem.constants.bounds
    free = problem.constants.start
    here = problem.cost(free)
    if isinstance(here, str):
        raise ValueError(f"the simulation at the start failed: {here}")
    runs, converged, exact = 1, False, False
    hessian = here.gauss_newton
    for _ in range(MOST_STEPS):
        gradient = here.gradients.sum(axis=0)
        held = _at_bounds(free, gradient, low, high)
        if held.all():
            converged = True
            break
        step = _newton_step(hessian, gradient, held)
        if not (step @ gradient < 0.0):  # the second derivatives are of a saddle
            hessian, exact = here.gauss_newton, False
            step = _newton_step(hessian, gradient, held)
        size = np.maximum(np.abs(free), 1e-3)
        step *= min(1.0, LONGEST / float(np.abs(step / size).max()))
        if float(np.abs(step / size).max()) <= STEP_TOLERANCE:
            converged = True
            break
        length = 1.0
        while True:
            trial = np.clip(free + length * step, low, high)
            found = problem.cost(trial)
            runs += 1
            if not isinstance(found, str) and found.value <= here.value * (1.0 + 1e-13):
                break
            length *= 0.5
            if length < 1e-4:
                break
        if isinstance(found, str) or found.value > here.value * (1.0 + 1e-13):
            converged = float(np.abs(length * step / size).max()) <= 1e3 * STEP_TOLERANCE
            break
        near = float(np.abs((trial - free) / size).max()) < NEAR
        free, here = trial, found
        if near and not exact:
            hessian, exact = problem.hessian(free), True
        elif not near:
            hessian = here.gauss_newton
    fitted = replace(problem.constants, values=problem.constants.all(free))
    own = FieldProblem(problem.sheet, problem.data, fitted)
    final = own.hessian(free)
    held = _at_bounds(free, here.gradients.sum(axis=0), low, high)
    seen = np.flatnonzero(~held)
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
        own, fitted, here, final, by_displacement.reshape(shape), by_force, converged, at_bound, runs
    )


def _at_bounds(free: FloatArray, gradient: FloatArray, low: FloatArray, high: FloatArray) -> BoolArray:
    """Constants on a bound with the cost falling beyond it, shape [p]."""
    return np.asarray(((free <= low) & (gradient >= 0.0)) | ((free >= high) & (gradient <= 0.0)))


def _newton_step(hessian: FloatArray, gradient: FloatArray, held: BoolArray) -> FloatArray:
    """Newton's step of the constants that are not held, shape [p]."""
    free = np.flatnonzero(~held)
    step = np.zeros_like(gradient)
    step[free] = -np.linalg.solve(hessian[np.ix_(free, free)], gradient[free])
    return step


def fit_steps(problem: FieldProblem) -> list[FieldFit | str]:
    """Fit every step alone: constants that drift with the load show that the law is not the material's."""
    fits: list[FieldFit | str] = []
    for step in range(len(problem.data.pad)):
        try:
            fits.append(fit_field(FieldProblem(problem.sheet, problem.data.only(step), problem.constants)))
        except ValueError as error:
            fits.append(str(error))
    return fits
