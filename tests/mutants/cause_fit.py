"""Faults of the fit of one cause of a misfit: patterns, priors, evidence, noise."""

from tests.mutants.fault import Fault

RUNS = ("tests/unit/diagnosis/test_cause_runs.py",)
FIT = ("tests/unit/diagnosis/test_cause_fit.py",)
SCAN = ("tests/unit/diagnosis/test_cause_scan.py",)
DECLARED = ("tests/unit/diagnosis/test_declared_causes.py",)

FAULTS = (
    Fault(
        name="patterns without their unit prior",
        file="kolsky/diagnosis/cause_fit.py",
        right="core = np.eye(self.patterns.shape[1]) + self.patterns.T @ VN",
        wrong="core = 1e-9 * np.eye(self.patterns.shape[1]) + self.patterns.T @ VN",
        tests=FIT,
    ),
    Fault(
        name="the noise taken off tau once, not squared",
        file="kolsky/diagnosis/cause_fit.py",
        right="(left[use] ** 2 - self.sigma[use] ** 2).mean()",
        wrong="(left[use] ** 2 - self.sigma[use]).mean()",
        tests=FIT,
    ),
    Fault(
        name="a misfit that its own tau explains",
        file="kolsky/diagnosis/cause_fit.py",
        right="replace(self.of(channel), tau=np.zeros(2))",
        wrong="self.of(channel)",
        tests=FIT,
    ),
    Fault(
        name="the step with the wrong sign",
        file="kolsky/diagnosis/cause_fit.py",
        right="z = -np.linalg.pinv(H, rcond=1e-12, hermitian=True) @ g",
        wrong="z = np.linalg.pinv(H, rcond=1e-12, hermitian=True) @ g",
        tests=FIT,
    ),
    Fault(
        name="blocks of times without their degrees of freedom",
        file="kolsky/diagnosis/cause_fit.py",
        right="blocks = sums @ sums.T * n / (n - p)",
        wrong="blocks = sums @ sums.T",
        tests=FIT,
    ),
    Fault(
        name="evidence below what a right model leaves",
        file="kolsky/diagnosis/cause_fit.py",
        right="np.log(np.maximum(before, 1.0) / np.maximum(after, 1.0))",
        wrong="np.log(before / after)",
        tests=FIT,
    ),
    Fault(
        name="the explained share of all, not of what is beyond the expected",
        file="kolsky/diagnosis/cause_fit.py",
        right="entries @ np.maximum(misfit - 1.0, 0.0)",
        wrong="entries @ np.maximum(misfit, 0.0)",
        tests=FIT,
    ),
    Fault(
        name="the F-test with the change over sigma not squared",
        file="kolsky/diagnosis/cause_fit.py",
        right="max(degrees, 1.0), (change / sigma) ** 2)",
        wrong="max(degrees, 1.0), abs(change / sigma))",
        tests=FIT,
    ),
    Fault(
        name="Holm with one test too few",
        file="kolsky/diagnosis/cause_fit.py",
        right="min(1.0, (n - place) * probabilities[i])",
        wrong="min(1.0, (n - place - 1) * probabilities[i])",
        tests=FIT,
    ),
    Fault(
        name="Holm that falls again",
        file="kolsky/diagnosis/cause_fit.py",
        right="largest = max(largest, min(1.0, (n - place) * probabilities[i]))",
        wrong="largest = min(1.0, (n - place) * probabilities[i])",
        tests=FIT,
    ),
    Fault(
        name="patterns of a path that are not its covariance's",
        file="kolsky/diagnosis/cause_model.py",
        right="root = safe[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))",
        wrong="root = safe[:, None] * vectors * np.maximum(values, 0.0)",
        tests=FIT,
    ),
    Fault(
        name="declared uncertainties without their prior",
        file="kolsky/diagnosis/cause_fit.py",
        right="prior = np.append(np.ones(q), np.zeros(p))[seen]",
        wrong="prior = np.append(0.1 * np.ones(q), np.zeros(p))[seen]",
        tests=DECLARED,
    ),
    Fault(
        name="declared uncertainties beyond their bounds",
        file="kolsky/diagnosis/cause_fit.py",
        right="low[:q], high[:q] = allowed.lower, allowed.upper",
        wrong="low[:q], high[:q] = 2.0 * allowed.lower, 2.0 * allowed.upper",
        tests=DECLARED,
    ),
    Fault(
        name="runs of one model for points of another",
        file="kolsky/diagnosis/cause_model.py",
        right="launch = (tuple(sorted(point.changed.specimen.items())), any_slides(named))",
        wrong="launch = (any_slides(named),)",
        tests=RUNS,
    ),
    Fault(
        name="a run of another motion taken for this one",
        file="kolsky/diagnosis/cause_model.py",
        right="tuple(sorted(point.changed.values.items())), point.changed.motion)",
        wrong="tuple(sorted(point.changed.values.items())))",
        tests=RUNS,
    ),
    Fault(
        name="weights of another tau",
        file="kolsky/diagnosis/cause_fit.py",
        right="return self if (tau == self.tau).all() else",
        wrong="return self if (tau == self.tau).any() else",
        tests=FIT,
    ),
    Fault(
        name="radii at the height of another alteration",
        file="kolsky/diagnosis/cause_inputs.py",
        right="return self.outline_lag, self.y_offset",
        wrong="return self.outline_lag, 0.0",
        tests=("tests/unit/diagnosis/test_alterations.py",),
    ),
    Fault(
        name="finer values to one side only",
        file="kolsky/diagnosis/cause_search.py",
        right="range(-FINER, FINER + 1)",
        wrong="range(0, FINER + 1)",
        tests=SCAN,
    ),
    Fault(
        name="values asked for that are at work",
        file="kolsky/diagnosis/cause_search.py",
        right="found = _tried(search, altered)",
        wrong="found = _tried(search, [*altered, *narrow])[: len(altered)]",
        tests=SCAN,
    ),
    Fault(
        name="runs made ahead that nobody keeps",
        file="kolsky/diagnosis/cause_model.py",
        right="            found = self._named(fresh, made())\n",
        wrong="            found = self._named(fresh, made()) and {}\n",
        tests=RUNS,
    ),
)
