"""Faults of the search with several parameters: priors, valleys, steps, what is held, offsets of a mesh."""

from tests.mutants.fault import Fault

PRIOR = ("tests/unit/inverse/test_prior.py",)
SEVERAL = ("tests/unit/inverse/test_several_parameters.py",)
VALLEYS = ("tests/unit/inverse/test_valleys.py",)
WHITENING = ("tests/unit/doe/test_whitening.py",)
FREE = ("tests/unit/inverse/test_free_parameters.py",)
NUMERICAL = ("tests/unit/uncertainty/test_numerical.py",)

FAULTS = (
    Fault(
        name="a prior's precision of sigma, not of its square",
        file="kolsky/inverse/prior.py",
        right="return np.diag(self.sigma**-2.0)",
        wrong="return np.diag(self.sigma**-1.0)",
        tests=PRIOR,
    ),
    Fault(
        name="a prior's residual with the wrong sign of its mean",
        file="kolsky/inverse/prior.py",
        right="((points - self.mean) / self.sigma)",
        wrong="((points + self.mean) / self.sigma)",
        tests=PRIOR,
    ),
    Fault(
        name="the prior left out of the normal matrix",
        file="kolsky/inverse/objective.py",
        right="self.information(jacobian, part) + self.prior_precision(jacobian.shape[1], part)",
        wrong="self.information(jacobian, part)",
        tests=PRIOR,
    ),
    Fault(
        name="the prior's share of the covariance left out",
        file="kolsky/inverse/objective.py",
        right="return np.asarray(inverse @ precision @ inverse)",
        wrong="return np.asarray(0.0 * inverse @ precision @ inverse)",
        tests=PRIOR,
    ),
    Fault(
        name="a step that pulls away from the prior",
        file="kolsky/inverse/gauss_newton.py",
        right="right = np.concatenate([right, -weighed.prior.residuals(x)])",
        wrong="right = np.concatenate([right, weighed.prior.residuals(x)])",
        tests=PRIOR,
    ),
    Fault(
        name="a step that is not scaled back to the parameters",
        file="kolsky/inverse/gauss_newton.py",
        right="return Step(np.clip(found, low, high) * sigma, sigma, weighed)",
        wrong="return Step(np.clip(found, low, high), sigma, weighed)",
        tests=PRIOR,
    ),
    Fault(
        name="a step against the gradient",
        file="kolsky/inverse/gauss_newton.py",
        right="weighed.whitened(weighed.data - vector)",
        wrong="weighed.whitened(vector - weighed.data)",
        tests=PRIOR,
    ),
    Fault(
        name="any step confirms the optimum",
        file="kolsky/inverse/gauss_newton.py",
        right="return self.step.moved <= CONFIRMED",
        wrong="return self.step.moved >= 0.0",
        tests=SEVERAL,
    ),
    Fault(
        name="the other point moved against the meshes' shift",
        file="kolsky/inverse/gauss_newton.py",
        right="moved[i] += shift[i]",
        wrong="moved[i] -= shift[i]",
        tests=SEVERAL,
    ),
    Fault(
        name="a value on a plateau is called identified",
        file="kolsky/inverse/estimates.py",
        right='elif computed.get("roughness", 0.0) > total:',
        wrong='elif computed.get("roughness", 0.0) > 2.0 * total:',
        tests=("tests/unit/inverse/test_estimates.py",),
    ),
    Fault(
        name="a plateau half as wide",
        file="kolsky/uncertainty/warnings/answer.py",
        right="low, high = e.value - 2.0 * rough, e.value + 2.0 * rough",
        wrong="low, high = e.value - rough, e.value + rough",
        tests=("tests/unit/uncertainty/test_warnings.py",),
    ),
    Fault(
        name="levels of Poisson's ratio evenly spaced",
        file="kolsky/inverse/valleys.py",
        right="np.interp(np.linspace(number[0], number[-1], n), number, values)",
        wrong="np.linspace(values[0], values[-1], n)",
        tests=VALLEYS,
    ),
    Fault(
        name="a minimum that is below one neighbour",
        file="kolsky/inverse/valleys.py",
        right="(padded[1:-1] < padded[:-2]) & (padded",
        wrong="(padded[1:-1] < padded[:-2]) | (padded",
        tests=VALLEYS,
    ),
    Fault(
        name="the wave's passage one way",
        file="kolsky/inverse/valleys.py",
        right="/ density) / (2.0 * length)",
        wrong="/ density) / length",
        tests=VALLEYS,
    ),
    Fault(
        name="every outline point a witness where valleys are compared",
        file="kolsky/inverse/objective.py",
        right='self.deviance(vectors, "shape") / self.points_per_frame',
        wrong='self.deviance(vectors, "shape")',
        tests=VALLEYS,
    ),
    Fault(
        name="the flyer's noise left out where valleys are compared",
        file="kolsky/inverse/valleys.py",
        right="seen = replace(stages.observations, front_noise=modes)",
        wrong="seen = stages.observations",
        tests=VALLEYS,
    ),
    Fault(
        name="the prior left out where valleys are compared",
        file="kolsky/inverse/valleys.py",
        right="objective.balanced_deviance(vector)[0] + objective.prior_chi2(points[row])",
        wrong="objective.balanced_deviance(vector)[0]",
        tests=VALLEYS,
    ),
    Fault(
        name="a short step lengthened by its whole share",
        file="kolsky/inverse/gauss_newton.py",
        right="share = float((before - now) @ taken)",
        wrong="share = float(before @ taken)",
        tests=SEVERAL,
    ),
    Fault(
        name="the root of a common error forgotten",
        file="doe/whitening.py",
        right="1.0 / np.sqrt(1.0 + size**2) - 1.0",
        wrong="1.0 / (1.0 + size**2) - 1.0",
        tests=WHITENING,
    ),
    Fault(
        name="a common error's precision as its square",
        file="doe/whitening.py",
        right="size**2 / (1.0 + size**2)",
        wrong="size / (1.0 + size)",
        tests=WHITENING,
    ),
    Fault(
        name="the determinant without common errors",
        file="doe/whitening.py",
        right=" + np.log1p(size**2).sum())",
        wrong=")",
        tests=WHITENING,
    ),
    Fault(
        name="a common error left out of the spread",
        file="kolsky/inverse/objective.py",
        right=" + (gain @ self.front_noise.T) @ self.front_noise)",
        wrong=")",
        tests=("tests/unit/inverse/test_objective.py",),
    ),
    Fault(
        name="the offset of a mesh taken off",
        file="kolsky/inverse/staged_runs.py",
        right="np.clip(points + self.offsets[mesh], low, high)",
        wrong="np.clip(points - self.offsets[mesh], low, high)",
        tests=SEVERAL,
    ),
    Fault(
        name="earlier runs left where they were when a mesh is shifted",
        file="kolsky/inverse/staged_runs.py",
        right="[(points - change, prediction) for points, prediction in self._coarse]",
        wrong="[(points, prediction) for points, prediction in self._coarse]",
        tests=SEVERAL,
    ),
    Fault(
        name="a mesh's shift not taken back along the slopes",
        file="kolsky/uncertainty/numerical.py",
        right="- fine.jacobian @ offset",
        wrong="+ fine.jacobian @ offset",
        tests=NUMERICAL,
    ),
    Fault(
        name="a width for what nobody declared",
        file="kolsky/inverse/free_parameters.py",
        right="shot.uncertainty.get(name, 0.0) > 0.0",
        wrong="shot.uncertainty.setdefault(name, 1.0) > 0.0",
        tests=FREE,
    ),
    Fault(
        name="a value that is declared exact is freed",
        file="kolsky/inverse/free_parameters.py",
        right="if shot.uncertainty.get(name) == 0.0:",
        wrong="if shot.uncertainty.get(name) == -1.0:",
        tests=FREE,
    ),
    Fault(
        name="a parameter counts as told when two sigma fill its range",
        file="kolsky/inverse/search.py",
        right="SEEN = 4.0",
        wrong="SEEN = 2.0",
        tests=FREE,
    ),
)
