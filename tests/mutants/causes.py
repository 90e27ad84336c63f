"""Faults of the search for the cause of a misfit."""

from tests.mutants.fault import Fault

FIT = ("tests/unit/diagnosis/test_cause_fit.py",)
ALTERED = ("tests/unit/diagnosis/test_alterations.py",)
CAUSES = ("tests/unit/diagnosis/test_causes.py",)

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
        right="alone = replace(self.of(channel), tau=np.zeros(2))",
        wrong="alone = self.of(channel)",
        tests=FIT,
    ),
    Fault(
        name="the step with the wrong sign",
        file="kolsky/diagnosis/cause_fit.py",
        right="z = -G @ (W.T @ residual)",
        wrong="z = G @ (W.T @ residual)",
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
        right="(change / sigma) ** 2, 1, max(degrees, 1.0)",
        wrong="abs(change / sigma), 1, max(degrees, 1.0)",
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
        name="a late force that comes early",
        file="kolsky/diagnosis/alterations.py",
        right="at = edges - self.force_lag - lag",
        wrong="at = edges + self.force_lag - lag",
        tests=ALTERED,
    ),
    Fault(
        name="an outline further out in the model, not in the file",
        file="kolsky/diagnosis/alterations.py",
        right="self._radii(response, observations, sample) - self.Z_offset",
        wrong="self._radii(response, observations, sample) + self.Z_offset",
        tests=ALTERED,
    ),
    Fault(
        name="strips of a tilted face with equal shares",
        file="kolsky/diagnosis/alterations.py",
        right="2.0 * np.sin(angle) ** 2 / (NODES + 1)",
        wrong="np.ones(NODES) / NODES",
        tests=ALTERED,
    ),
    Fault(
        name="a gain that multiplies the simulated force",
        file="kolsky/diagnosis/cause_inputs.py",
        right="value=lambda u: 1.0 / u,",
        wrong="value=lambda u: u,",
        tests=CAUSES,
    ),
    Fault(
        name="the unusual error first",
        file="kolsky/diagnosis/causes.py",
        right="sorted(group, key=lambda t: _unusual(search, t))",
        wrong="sorted(group, key=lambda t: -_unusual(search, t))",
        tests=CAUSES,
    ),
    Fault(
        name="a cause said at one sigma as k = 2",
        file="kolsky/diagnosis/causes.py",
        right="half = 2.0 * factor * finding.sigma",
        wrong="half = factor * finding.sigma",
        tests=CAUSES,
    ),
    Fault(
        name="inputs told apart by any difference",
        file="kolsky/diagnosis/causes.py",
        right="ALIKE = 10.0",
        wrong="ALIKE = 0.0",
        tests=CAUSES,
    ),
    Fault(
        name="a sensitivity put right by multiplying",
        file="kolsky/diagnosis/corrected.py",
        right="sensitivity=force.transducer.sensitivity / value",
        wrong="sensitivity=force.transducer.sensitivity * value",
        tests=("tests/unit/diagnosis/test_corrected.py",),
    ),
    Fault(
        name="a late clock put later",
        file="kolsky/diagnosis/corrected.py",
        right="clock_offset=force.clock_offset - lag",
        wrong="clock_offset=force.clock_offset + lag",
        tests=("tests/unit/diagnosis/test_corrected.py",),
    ),
    Fault(
        name="a clock that stands still once is still no force",
        file="kolsky/shot/force.py",
        right="(np.diff(scope.value) > 0.0).all()",
        wrong="(np.diff(scope.value) >= 0.0).all()",
        tests=("tests/unit/shot/test_checks.py",),
    ),
)
