"""Faults of the inverse method: misfit, objective, estimates, the comparison of methods."""

from tests.mutants.fault import Fault

OBJECTIVE = ("tests/unit/inverse/test_objective.py",)
ESTIMATES = ("tests/unit/inverse/test_estimates.py",)
CONFIRMS = (
    "tests/unit/inverse/test_quadratic_fit.py::"
    "test_a_run_confirms_within_a_fifth_of_sigma_or_three_times_the_roughness",
)
MISFIT = ("tests/unit/inverse/test_misfit.py",)
EARLY = ("tests/unit/inverse/test_early_run.py",)
IDLE = ("tests/unit/inverse/test_idle_core.py",)

FAULTS = (
    Fault(
        name="noise and discrepancy added, not their squares",
        file="kolsky/inverse/objective.py",
        right="np.sqrt(self.noise**2 + tau**2 + self.pattern_variance)",
        wrong="self.noise + tau + self.pattern_variance",
        tests=OBJECTIVE,
    ),
    Fault(
        name="one degree of freedom too many in the sandwich",
        file="kolsky/inverse/objective.py",
        right="n_blocks / (n_blocks - d)",
        wrong="n_blocks / (n_blocks - d + 1)",
        tests=OBJECTIVE,
    ),
    Fault(
        name="a sandwich of four blocks a parameter",
        file="kolsky/inverse/objective.py",
        right="if n_blocks <= 4 * d:",
        wrong="if n_blocks < 4 * d:",
        tests=OBJECTIVE,
    ),
    Fault(
        name="the sandwich of the last block length, not the largest",
        file="kolsky/inverse/objective.py",
        right="if np.trace(sandwich / np.diag(best)) > np.trace(best / np.diag(best)):",
        wrong="if True:",
        tests=OBJECTIVE,
    ),
    Fault(
        name="the noise taken off the discrepancy once, not squared",
        file="kolsky/inverse/objective.py",
        right="excess = square - known**2",
        wrong="excess = square - known",
        tests=OBJECTIVE,
    ),
    Fault(
        name="a discrepancy that the most uncertain entries rule",
        file="kolsky/inverse/objective.py",
        right="left**2 + variance, own**-4",
        wrong="left**2 + variance, own**4",
        tests=OBJECTIVE,
    ),
    Fault(
        name="the deviance without the logarithm of the variance",
        file="kolsky/inverse/objective.py",
        right="chi2 + weighed.whitening(part).log_determinant",
        wrong="chi2",
        tests=OBJECTIVE,
    ),
    Fault(
        name="the scale of the force bends the outline too",
        file="kolsky/inverse/objective.py",
        right="np.where(transmitted, self.observations.force_sigma_gain * self.data, 0.0)",
        wrong="self.observations.force_sigma_gain * self.data",
        tests=OBJECTIVE,
    ),
    Fault(
        name="the design is widened by its whole edges",
        file="kolsky/inverse/refined_search.py",
        right="more = 0.5 * (high - low)",
        wrong="more = 1.0 * (high - low)",
        tests=("tests/unit/inverse/test_refined_search.py",),
    ),
    Fault(
        name="an optimum beyond the second design is not followed",
        file="kolsky/inverse/refined_search.py",
        right="        if at_inner_face(best, coarse.box, stages.box):",
        wrong="        if False:",
        tests=("tests/unit/inverse/test_refined_search.py",),
    ),
    Fault(
        name="not seen where forty sigma are the whole design",
        file="kolsky/inverse/estimates.py",
        right="= 4.0 * totals > upper - lower,",
        wrong="= 40.0 * totals > upper - lower,",
        tests=ESTIMATES,
    ),
    Fault(
        name="parts of the noise added, not their squares",
        file="kolsky/inverse/estimates.py",
        right="totals = np.hypot.reduce([np.zeros(len(optimum)), *noise.values()])",
        wrong="totals = np.add.reduce([np.zeros(len(optimum)), *noise.values()])",
        tests=ESTIMATES,
    ),
    Fault(
        name="the last numerical part alone",
        file="kolsky/inverse/estimates.py",
        right="sigma_numerical=float(np.hypot.reduce(list(computed.values()))),",
        wrong="sigma_numerical=float(list(computed.values())[-1]),",
        tests=ESTIMATES,
    ),
    Fault(
        name="a value beside one at its bound counts as identified",
        file="kolsky/inverse/estimates.py",
        right="verdict = Verdict.CONDITIONAL if any(bounds) else good",
        wrong="verdict = good",
        tests=ESTIMATES,
    ),
    Fault(
        name="the systematic part left out of the combined uncertainty",
        file="kolsky/inverse/result.py",
        right="self.sigma_numerical**2 + self.sigma_systematic**2))",
        wrong="self.sigma_numerical**2))",
        tests=ESTIMATES,
    ),
    Fault(
        name="the interval's upper end at one sigma",
        file="kolsky/inverse/result.py",
        right="return max(self.value - half, low), min(self.value + half, high)",
        wrong="return max(self.value - half, low), min(self.value + 0.5 * half, high)",
        tests=ESTIMATES,
    ),
    Fault(
        name="methods agree within ten times the share",
        file="kolsky/inverse/result.py",
        right="AGREEMENT = 0.25",
        wrong="AGREEMENT = 2.5",
        tests=ESTIMATES,
    ),
    Fault(
        name="a coordinate lies on a bound at ten times the distance",
        file="kolsky/inverse/coarse_search.py",
        right="ON_EDGE = 1e-5",
        wrong="ON_EDGE = 1e-4",
        tests=ESTIMATES,
    ),
    Fault(
        name="Phi_S relative to the model's radius",
        file="kolsky/inverse/run_table.py",
        right="phi_shape = _frame_mean(np.abs(Z_model - Z) / Z, frame)",
        wrong="phi_shape = _frame_mean(np.abs(Z_model - Z) / Z_model, frame)",
        tests=MISFIT,
    ),
    Fault(
        name="delta Phi_S without the model over the measured radius",
        file="kolsky/inverse/run_table.py",
        right="sigma_shape = _frame_mean(Z_model * sigma / Z**2, frame)",
        wrong="sigma_shape = _frame_mean(sigma / Z, frame)",
        tests=MISFIT,
    ),
    Fault(
        name="delta Phi of the force alone",
        file="kolsky/inverse/run_table.py",
        right="sigma_phi=float(np.hypot(sigma_force / SCALE_FORCE, sigma_shape / SCALE_SHAPE)),",
        wrong="sigma_phi=float(sigma_force / SCALE_FORCE),",
        tests=MISFIT,
    ),
    Fault(
        name="a run confirms at two sigma",
        file="kolsky/inverse/refined_search.py",
        right="CONFIRMED = 0.2",
        wrong="CONFIRMED = 2.0",
        tests=CONFIRMS,
    ),
    Fault(
        name="a run confirms at thirty times the roughness",
        file="kolsky/inverse/refined_search.py",
        right="ROUGH = 3.0",
        wrong="ROUGH = 30.0",
        tests=CONFIRMS,
    ),
    Fault(
        name="an error beside a lone run is lost",
        file="kolsky/inverse/work.py",
        right="            done()\n",
        wrong="",
        tests=IDLE,
    ),
    Fault(
        name="runs that were put off made beside every run",
        file="kolsky/inverse/work.py",
        right="elif idle:",
        wrong="else:",
        tests=IDLE,
    ),
    Fault(
        name="replicates under the path that is followed when they are asked for",
        file="kolsky/inverse/staged_runs.py",
        right="response = forward.run(values",
        wrong="response = self.prepared.with_replicates(moved, self.rng, curves=n).run(values",
        tests=("tests/unit/inverse/test_replicates.py",),
    ),
    Fault(
        name="weights of the discrepancies before",
        file="kolsky/inverse/objective.py",
        right='        "pattern_variance",\n',
        wrong='        "own_sigma",\n        "pattern_variance",\n',
        tests=OBJECTIVE,
    ),
    Fault(
        name="what waits for an idle core is done beside every run",
        file="kolsky/inverse/work.py",
        right="if idle and self._waiting:",
        wrong="if self._waiting:",
        tests=IDLE,
    ),
    Fault(
        name="a run begun early taken for one under another path",
        file="kolsky/inverse/work.py",
        right="return self.forward is forward and np",
        wrong="return np",
        tests=EARLY,
    ),
    Fault(
        name="a run begun early behind a long step",
        file="kolsky/inverse/gauss_newton.py",
        right="found.step.moved <= LIKELY if found",
        wrong="True if found",
        tests=EARLY,
    ),
    Fault(
        name="a run begun early under a path that will be moved",
        file="kolsky/inverse/gauss_newton.py",
        right="if final and len(points) == 1",
        wrong="if len(points) == 1",
        tests=EARLY,
    ),
)
