"""Faults of the warning of folded edges."""

from tests.mutants.fault import Fault

TESTS = ("tests/unit/uncertainty/test_folded_edge.py",)
RUNS = "kolsky/uncertainty/warnings.py"

FAULTS = (
    Fault(
        name="a corner's area without its second product",
        file="explicit/mesh.py",
        right="ahead[..., 0] * behind[..., 1] - ahead[..., 1] * behind[..., 0]",
        wrong="ahead[..., 0] * behind[..., 1]",
        tests=TESTS,
    ),
    Fault(
        name="a folded edge is looked for at the last time only",
        file=RUNS,
        right="over = np.flatnonzero((worst < FOLDED).any(axis=1))",
        wrong="over = np.flatnonzero((worst < FOLDED).all(axis=1))",
        tests=TESTS,
    ),
    Fault(
        name="folded edges are said of held faces",
        file=RUNS,
        right="if not slides or response.nodes is None",
        wrong="if response.nodes is None",
        tests=TESTS,
    ),
    Fault(
        name="the threshold of a folded edge has the other sign",
        file=RUNS,
        right="FOLDED = -0.4",
        wrong="FOLDED = 0.4",
        tests=("tests/unit/uncertainty/test_folded_edge.py::test_folds_of_right_runs_are_not_said",),
    ),
)
