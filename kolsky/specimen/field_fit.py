r"""Constants fitted to a measured displacement field and the force on a pad (Sutula and others 2020, Secs.
2-4).

Newton's method, Eq. (K.17), on the cost of `field_problem`: far from the minimum with the curvature of Gauss
and Newton, near it with the exact second derivatives, which the sensitivities of Eq. (K.19) need as well.
"""

from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.specimen.constants import Constants
from kolsky.specimen.field_problem import Cost, FieldProblem
from kolsky.specimen.field_sensitivity import parameter_change, relative_deviation

MOST_STEPS = 30
"""Most steps of Newton's method."""
AT_REST = 1e-9
"""Relative step of the constants at which it has ended."""
LONGEST = 0.3
"""Longest relative step of a constant."""
NEAR = 0.02
"""Relative step below which the exact second derivatives take over."""
ADEQUATE = 0.05
"""Largest misfit of the displacements over their size, beyond their noise, with which the model is called
adequate."""


@dataclass(frozen=True)
class FieldFit:
    """Constants of a sheet, and what the data say of them."""

    problem: FieldProblem
    """What was fitted."""
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
        mass, data = self.problem.mass, self.problem.data
        size = np.array([np.einsum("ai,ai->", mass @ one, one) for one in data.displacements])
        return np.asarray(np.sqrt(2.0 * self.cost.displacement / size))

    @property
    def noise(self) -> FloatArray:
        """The misfit that the noise of the points alone would make [-], shape [n]."""
        mass, data = self.problem.mass, self.problem.data
        size = np.array([np.einsum("ai,ai->", mass @ one, one) for one in data.displacements])
        area = float(mass.sum())
        return np.asarray(np.sqrt(2.0 * area) * data.sigma_displacement / np.sqrt(size))

    @property
    def scales(self) -> tuple[float, float]:
        """Variance of the misfit over that of noise, at least 1: of the displacements and of the force
        [-]."""
        data = self.problem.data
        displacements = 2.0 * len(data.pad) * float(self.problem.mass.sum()) / data.area
        of_field = 2.0 * self.cost.displacement.sum() / (data.area * data.sigma_displacement**2)
        of_force = 2.0 * self.cost.force.sum() / data.sigma_force**2
        field = max(1.0, float(of_field) / max(displacements - len(self.values), 1.0))
        return field, max(1.0, float(of_force) / max(len(data.pad) - 1.0, 1.0))

    @property
    def adequate(self) -> bool:
        """Whether the model explains the field: its misfit beyond noise is at most `ADEQUATE`."""
        beyond = np.sqrt(np.maximum(self.misfit**2 - self.noise**2, 0.0))
        return bool(beyond.max() <= ADEQUATE)

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
        said = [] if self.converged else ["the search did not come to rest"]
        said += [
            f"{name} is at its bound: the data ask for a value outside"
            for name, held in zip(self.constants.free, self.at_bound, strict=True)
            if held
        ]
        if not self.adequate:
            said.append(
                f"the model does not explain the displacement field: its misfit is "
                f"{100.0 * self.misfit.min():.3g} to {100.0 * self.misfit.max():.3g} % of the displacements, "
                f"noise alone would make {100.0 * self.noise.max():.2g} %; the constants are those of the "
                "nearest such sheet, and differ from step to step"
            )
        return said


def fit_field(problem: FieldProblem) -> FieldFit:
    """Fit a sheet by Newton's method, Eq. (K.17).

    Raises
    ------
    ValueError
        If the simulation at the start fails, or the data do not determine the constants.
    """
    low, high = problem.constants.bounds
    free = problem.constants.start
    here = problem.cost(free)
    if isinstance(here, str):
        raise ValueError(f"the simulation at the start failed: {here}")
    runs, converged, exact = 1, False, False
    hessian = here.gauss_newton
    for _ in range(MOST_STEPS):
        gradient = here.gradients.sum(axis=0)
        held = _held(free, gradient, low, high)
        if held.all():
            converged = True
            break
        step = _newton_step(hessian, gradient, held)
        if not (step @ gradient < 0.0):  # the second derivatives are of a saddle
            hessian, exact = here.gauss_newton, False
            step = _newton_step(hessian, gradient, held)
        size = np.maximum(np.abs(free), 1e-3)
        step *= min(1.0, LONGEST / float(np.abs(step / size).max()))
        if float(np.abs(step / size).max()) <= AT_REST:
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
            converged = float(np.abs(length * step / size).max()) <= 1e3 * AT_REST
            break
        near = float(np.abs((trial - free) / size).max()) < NEAR
        free, here = trial, found
        if near and not exact:
            hessian, exact = problem.hessian(free), True
        elif not near:
            hessian = here.gauss_newton
    fitted = Constants(problem.constants.law, problem.constants.all(free), problem.constants.free)
    own = FieldProblem(problem.sheet, problem.data, fitted)
    final = own.hessian(free)
    held = _held(free, here.gradients.sum(axis=0), low, high)
    seen = np.flatnonzero(~held)
    own_final = final[np.ix_(seen, seen)]
    n, p, nodes, d = here.state.by_constants.shape
    mixed = -np.stack([[own.mass @ one for one in by] for by in here.state.by_constants])
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


def _held(free: FloatArray, gradient: FloatArray, low: FloatArray, high: FloatArray) -> BoolArray:
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
    found: list[FieldFit | str] = []
    for step in range(len(problem.data.pad)):
        try:
            found.append(fit_field(FieldProblem(problem.sheet, problem.data.only(step), problem.constants)))
        except ValueError as error:
            found.append(str(error))
    return found
