"""Faults of the counts of a study of coverage."""

from tests.mutants.fault import Fault

STUDY = ("tests/validation/test_coverage_study.py",)
COUNTS = "benchmarks/coverage_counts.py"

FAULTS = (
    Fault("refused shots among the answers", COUNTS, "if called_identified(one)]", "if True]", STUDY),
    Fault(
        "one verdict that is an answer is enough",
        COUNTS,
        "return all(text in ANSWERS",
        "return any(text in ANSWERS",
        STUDY,
    ),
    Fault("an answer without a value holds the truth", COUNTS, "held / len(each)", "held / len(good)", STUDY),
    Fault("intervals of k = 1", COUNTS, "(np.abs(error) <= 2.0 * sigma)", "(np.abs(error) <= sigma)", STUDY),
    Fault(
        "misses too low counted as too high",
        COUNTS,
        '"above": int((error > ',
        '"above": int((-error > ',
        STUDY,
    ),
    Fault(
        "the mean error wanted below half of sigma",
        COUNTS,
        "LARGEST_MEAN = 0.25",
        "LARGEST_MEAN = 0.5",
        STUDY,
    ),
)
