"""Faults in the joint identification, in what relaxes, and in the choice between with it and without."""

from tests.mutants.fault import Fault

_SCATTER, _WEIGHTS = "kolsky/joint/scatter.py", "kolsky/joint/weights.py"
_BRANCH, _NODES = "kolsky/diagnosis/branch_test.py", "kolsky/joint/unknowns.py"
_SLOW, _RELAXING = "kolsky/joint/slow_schema.py", "kolsky/inverse/relaxing.py"
_ANSWER, _STEPS = "kolsky/joint/answer.py", "kolsky/joint/refined_steps.py"


def _fault(name: str, file: str, right: str, wrong: str, test: str) -> Fault:
    return Fault(name=name, file=file, right=right, wrong=wrong, tests=(f"tests/unit/{test}",))


FAULTS = (
    _fault(
        "a scatter of the plain likelihood, too small for few shots",
        _SCATTER,
        "+ float(np.linalg.slogdet(normal)[1])",
        "",
        "joint/test_scatter.py",
    ),
    _fault(
        "a residual that the shared unknowns have not followed",
        _SCATTER,
        "float(r @ r) - taken",
        "float(r @ r)",
        "joint/test_scatter.py",
    ),
    _fault(
        "the scatter's interval at one standard deviation",
        _SCATTER,
        "RISE = 3.84",
        "RISE = 1.0",
        "joint/test_scatter.py",
    ),
    _fault(
        "as many degrees of freedom as shots",
        _SCATTER,
        "(shots - 1) * (sigma",
        "shots * (sigma",
        "joint/test_scatter.py",
    ),
    _fault(
        "Welch and Satterthwaite's ratio of variances not squared",
        _SCATTER,
        "min(between, sigma)) ** 4",
        "min(between, sigma)) ** 2",
        "joint/test_scatter.py",
    ),
    _fault(
        "blocks of time that go on from shot to shot",
        _WEIGHTS,
        "first += int(own.max()) + 1",
        "first += 0",
        "joint/test_weights.py",
    ),
    _fault(
        "correlated residuals never widen the interval",
        _WEIGHTS,
        "np.diag(sandwich) / np.diag(best), 1.0",
        "0.0 * np.diag(sandwich) / np.diag(best), 1.0",
        "joint/test_weights.py",
    ),
    _fault(
        "a calibration that shots share left out of the weights",
        _WEIGHTS,
        "for shared in (self.common, self.curve):",
        "for shared in (self.curve,):",
        "joint/test_weights.py",
    ),
    _fault(
        "the slow curve's noise left out of the weights",
        _WEIGHTS,
        "for shared in (self.common, self.curve):",
        "for shared in (self.common,):",
        "joint/test_weights.py",
    ),
    _fault(
        "the sign of a shot's own part",
        _ANSWER,
        "return -float(row @ pull),",
        "return float(row @ pull),",
        "joint/test_weights.py",
    ),
    _fault(
        "what is left of a shot's own uncertainty is all of it",
        _ANSWER,
        "left = 1.0 - float(",
        "left = 1.0 - 0.0 * float(",
        "joint/test_weights.py",
    ),
    _fault(
        "a strength below zero explains as well",
        _BRANCH,
        "gain = max(0.0, float(score[best])) ** 2",
        "gain = float(score[best]) ** 2",
        "diagnosis/test_branch_test.py",
    ),
    _fault(
        "the best of several times judged as if one had been tried",
        _BRANCH,
        ".max(axis=1) ** 2",
        "[:, 0] ** 2",
        "diagnosis/test_branch_test.py",
    ),
    _fault(
        "residuals of a block taken for independent evidence",
        _BRANCH,
        "scale[k] = max(scale[k],",
        "scale[k] = max(scale[k], 0.0 *",
        "diagnosis/test_branch_test.py",
    ),
    _fault(
        "what the parameters follow counted for the branch",
        _BRANCH,
        "own = directions - (directions @ basis) @ basis.T",
        "own = directions.copy()",
        "diagnosis/test_branch_test.py",
    ),
    _fault(
        "smoothness by the first difference",
        _NODES,
        "np.diff(np.eye(nodes), n=2, axis=0)",
        "np.diff(np.eye(nodes), n=1, axis=0)[1:]",
        "joint/test_unknowns.py",
    ),
    _fault(
        "the slope by m taken for that by its logarithm",
        _NODES,
        "slopes[:, i] * x[i]",
        "slopes[:, i] * 1.0",
        "joint/test_unknowns.py",
    ),
    _fault(
        "hertz taken for radians per second",
        _SLOW,
        '"Hz": 2.0 * np.pi',
        '"Hz": 1.0',
        "joint/test_slow_tests.py",
    ),
    _fault(
        "a slow test's compression read as tension",
        _SLOW,
        'if test.convention == "tension positive" else -1.0',
        'if test.convention == "tension positive" else 1.0',
        "joint/test_slow_tests.py",
    ),
    _fault(
        "every run of a batch with the first series",
        _RELAXING,
        "choice = index.ravel() if len(index) > 1",
        "choice = 0 * index.ravel() if len(index) > 1",
        "inverse/test_relaxing.py",
    ),
    _fault(
        "strengths taken for times",
        _RELAXING,
        "PronySeries(tuple(row[:n].tolist()), tuple(row[n:].tolist()))",
        "PronySeries(tuple(row[n:].tolist()), tuple(row[:n].tolist()))",
        "inverse/test_relaxing.py",
    ),
    _fault(
        "a strength within one standard uncertainty of nothing asked for",
        "kolsky/joint/model_choice.py",
        "SEEN = 2.0",
        "SEEN = 1.0",
        "joint/test_model_choice_words.py",
    ),
    _fault(
        "a branch at a bound of its times asked for",
        "kolsky/joint/model_choice.py",
        "return e is None or e.outcome is not Verdict.AT_BOUND",
        "return True",
        "joint/test_model_choice_words.py",
    ),
    _fault(
        "the mesh's error left as large as between the meshes",
        "kolsky/joint/mesh_errors.py",
        "change.coarser / (change.ratio**ORDER - 1.0)",
        "change.coarser / 1.0",
        "joint/test_model_choice_words.py",
    ),
    _fault(
        "a mesh error that is one for all shots",
        "kolsky/joint/mesh_errors.py",
        "stack.of_shot(k, row) for row in rows for k in range(len(stack.shots))",
        "row for row in rows",
        "joint/test_model_choice_words.py",
    ),
    _fault(
        "an unknown that nothing sees known to a twelfth of its range",
        _WEIGHTS,
        "12.0 / widths**2",
        "144.0 / widths**2",
        "joint/test_weights.py",
    ),
    _fault(
        "a step cut off at a bound, the others as if it were not",
        _WEIGHTS,
        'found = lsq_linear((rows * width[:, None]).T, -residual, bounds, method="bvls")',
        "found = lsq_linear((rows * width[:, None]).T, -residual)",
        "joint/test_weights.py",
    ),
    _fault(
        "a step on the refined mesh confirmed at a whole standard deviation",
        _STEPS,
        "CONFIRMED = 0.25",
        "CONFIRMED = 1.0",
        "joint/test_refined_steps.py",
    ),
    _fault(
        "slopes of the search's mesh that lead astray kept",
        _STEPS,
        "if not own and (astray or made >= BORROWED):",
        "if not own and made >= BORROWED:",
        "joint/test_refined_steps.py",
    ),
    _fault(
        "slopes of the search's mesh kept to the end",
        _STEPS,
        "if not own and (astray or made >= BORROWED):",
        "if not own and astray:",
        "joint/test_refined_steps.py",
    ),
    _fault(
        "a secant in the unknowns' own units",
        _STEPS,
        "np.outer(missed, step / sigma) / float(step @ step)",
        "np.outer(missed, step * sigma) / float((step * sigma) @ (step * sigma))",
        "joint/test_refined_steps.py",
    ),
)
