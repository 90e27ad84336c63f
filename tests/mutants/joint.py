"""Faults in the joint identification."""

from tests.mutants.fault import Fault

_SCATTER = "kolsky/inverse/joint_search.py"
_WEIGHTS = "kolsky/inverse/joint_problem.py"
_NODES = "kolsky/inverse/joint_runs.py"
_SLOW = "kolsky/inverse/slow_tests.py"
_UNSEEN = "kolsky/inverse/joint_result.py"
_ANSWER = "kolsky/joint_identification.py"
_STEPS = "kolsky/inverse/joint_search.py"


def fault(name: str, file: str, right: str, wrong: str, test: str) -> Fault:
    return Fault(name=name, file=file, right=right, wrong=wrong, tests=(f"tests/unit/{test}",))


FAULTS = (
    fault(
        "arithmetic that a ledger does not tell apart",
        "kolsky/inverse/joint_runs.py",
        'float(int.from_bytes(digest, "big"))',
        "0.0",
        "joint/test_refined_patterns.py",
    ),
    fault(
        "a scatter of the plain likelihood, too small for few shots",
        _SCATTER,
        "+ float(np.linalg.slogdet(normal)[1])",
        "",
        "joint/test_scatter.py",
    ),
    fault(
        "a residual that the shared unknowns have not followed",
        _SCATTER,
        "float(r @ r) - taken",
        "float(r @ r)",
        "joint/test_scatter.py",
    ),
    fault(
        "the scatter's interval at one standard deviation",
        _SCATTER,
        "RISE = 3.84",
        "RISE = 1.0",
        "joint/test_scatter.py",
    ),
    fault(
        "as many degrees of freedom as shots",
        _SCATTER,
        "(shots - 1) * (sigma",
        "shots * (sigma",
        "joint/test_scatter.py",
    ),
    fault(
        "Welch and Satterthwaite's ratio of variances not squared",
        _SCATTER,
        "min(between, sigma)) ** 4",
        "min(between, sigma)) ** 2",
        "joint/test_scatter.py",
    ),
    fault(
        "blocks of time that go on from shot to shot",
        _WEIGHTS,
        "first += int(own.max()) + 1",
        "first += 0",
        "joint/test_weights.py",
    ),
    fault(
        "correlated residuals never widen the interval",
        _WEIGHTS,
        "np.diag(sandwich) / np.diag(best), 1.0",
        "0.0 * np.diag(sandwich) / np.diag(best), 1.0",
        "joint/test_weights.py",
    ),
    fault(
        "a calibration that shots share left out of the weights",
        _WEIGHTS,
        "for shared in (self.common, self.curve):",
        "for shared in (self.curve,):",
        "joint/test_weights.py",
    ),
    fault(
        "the slow curve's noise left out of the weights",
        _WEIGHTS,
        "for shared in (self.common, self.curve):",
        "for shared in (self.common,):",
        "joint/test_weights.py",
    ),
    fault(
        "the sign of a shot's own part",
        _ANSWER,
        "return -float(row @ pull),",
        "return float(row @ pull),",
        "joint/test_weights.py",
    ),
    fault(
        "what is left of a shot's own uncertainty is all of it",
        _ANSWER,
        "left = 1.0 - float(",
        "left = 1.0 - 0.0 * float(",
        "joint/test_weights.py",
    ),
    fault(
        "smoothness by the first difference",
        _NODES,
        "np.diff(np.eye(nodes), n=2, axis=0)",
        "np.diff(np.eye(nodes), n=1, axis=0)[1:]",
        "joint/test_unknowns.py",
    ),
    fault(
        "the slope by m taken for that by its logarithm",
        _NODES,
        "slopes[:, i] * x[i]",
        "slopes[:, i] * 1.0",
        "joint/test_unknowns.py",
    ),
    fault(
        "hertz taken for radians per second",
        _SLOW,
        '"Hz": 2.0 * np.pi',
        '"Hz": 1.0',
        "joint/test_slow_tests.py",
    ),
    fault(
        "a slow test's compression read as tension",
        _SLOW,
        'if test.convention == "tension positive" else -1.0',
        'if test.convention == "tension positive" else 1.0',
        "joint/test_slow_tests.py",
    ),
    fault(
        "a strength within one standard uncertainty of nothing asked for",
        _UNSEEN,
        "SEEN = 2.0",
        "SEEN = 1.0",
        "joint/test_model_choice_words.py",
    ),
    fault(
        "the time of a branch without strength corrected for the mesh",
        _UNSEEN,
        "value=e.on_mesh,",
        "value=e.value,",
        "joint/test_unseen.py",
    ),
    fault(
        "the time of a branch without strength known to a third of its range",
        _UNSEEN,
        "(high - low) / 12.0**0.5",
        "(high - low) / 12.0",
        "joint/test_unseen.py",
    ),
    fault(
        "a strength of one standard uncertainty said to be seen",
        _UNSEEN,
        "{SEEN * e.sigma:.2g}",
        "{e.sigma:.2g}",
        "joint/test_unseen.py",
    ),
    fault(
        "a value corrected past a bound of its range",
        "kolsky/inverse/estimates.py",
        "np.where(unseen | bounds, optimum, np.clip(wanted, lower, upper))",
        "wanted",
        "inverse/test_estimates.py",
    ),
    fault(
        "an interval that goes on where nothing was searched",
        "kolsky/inverse/result.py",
        "return max(self.value - half, low), min(self.value + half, high)",
        "return self.value - half, self.value + half",
        "inverse/test_estimates.py",
    ),
    fault(
        "a branch at a bound of its times asked for",
        "kolsky/diagnosis/relaxation.py",
        "return e is None or e.outcome is not Verdict.AT_BOUND",
        "return True",
        "joint/test_model_choice_words.py",
    ),
    fault(
        "an unknown that nothing sees known to a twelfth of its range",
        _WEIGHTS,
        "12.0 / widths**2",
        "144.0 / widths**2",
        "joint/test_weights.py",
    ),
    fault(
        "a step cut off at a bound, the others as if it were not",
        _WEIGHTS,
        'found = lsq_linear((rows * width[:, None]).T, -residual, bounds, method="bvls")',
        "found = lsq_linear((rows * width[:, None]).T, -residual)",
        "joint/test_weights.py",
    ),
    fault(
        "a step on the refined mesh confirmed at a whole standard deviation",
        _STEPS,
        "CONFIRMED = 0.25",
        "CONFIRMED = 1.0",
        "joint/test_refined_steps.py",
    ),
    fault(
        "slopes of the search's mesh that lead astray kept",
        _STEPS,
        "if not own and (astray or made >= BORROWED):",
        "if not own and made >= BORROWED:",
        "joint/test_refined_steps.py",
    ),
    fault(
        "slopes of the search's mesh kept to the end",
        _STEPS,
        "if not own and (astray or made >= BORROWED):",
        "if not own and astray:",
        "joint/test_refined_steps.py",
    ),
    fault(
        "a secant in the unknowns' own units",
        _STEPS,
        "np.outer(missed, step / sigma) / float(step @ step)",
        "np.outer(missed, step * sigma) / float((step * sigma) @ (step * sigma))",
        "joint/test_refined_steps.py",
    ),
)
