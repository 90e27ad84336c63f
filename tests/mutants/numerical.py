"""Faults of the numerical error of an answer: orders, windows, elements, corrections."""

from tests.mutants.fault import Fault

NUMERICAL = ("tests/unit/uncertainty/test_numerical.py",)

FAULTS = (
    Fault(
        name="a mesh error of second order",
        file="kolsky/uncertainty/numerical.py",
        right="\nORDER = 3.2",
        wrong="\nORDER = 2.0",
        tests=NUMERICAL,
    ),
    Fault(
        name="elements that come together at another order",
        file="kolsky/uncertainty/numerical.py",
        right="ELEMENT_ORDER = 1.5",
        wrong="ELEMENT_ORDER = 2.0",
        tests=NUMERICAL,
    ),
    Fault(
        name="a correction that the lower order would hardly change",
        file="kolsky/uncertainty/numerical.py",
        right="LOW_ORDER = 2.1",
        wrong="LOW_ORDER = 3.0",
        tests=NUMERICAL,
    ),
    Fault(
        name="half the correction uncertain without the other element",
        file="kolsky/uncertainty/numerical.py",
        right="UNKNOWN = 3.5",
        wrong="UNKNOWN = 0.5",
        tests=NUMERICAL,
    ),
    Fault(
        name="the elements' distance with one sign for the whole test",
        file="kolsky/uncertainty/numerical.py",
        right="np.add.at(moved, windows, (gain * change).T)",
        wrong="np.add.at(moved, 0 * windows, (gain * change).T)",
        tests=NUMERICAL,
    ),
    Fault(
        name="a window too few",
        file="kolsky/uncertainty/numerical.py",
        right="WINDOWS = 12",
        wrong="WINDOWS = 11",
        tests=NUMERICAL,
    ),
    Fault(
        name="the end of a test in a window of its own",
        file="kolsky/uncertainty/numerical.py",
        right="return np.minimum((WINDOWS * share).astype(int), WINDOWS - 1)",
        wrong="return (WINDOWS * share).astype(int)",
        tests=NUMERICAL,
    ),
    Fault(
        name="a correction the wrong way",
        file="kolsky/uncertainty/numerical.py",
        right="return np.asarray(gain @ self.error)",
        wrong="return -np.asarray(gain @ self.error)",
        tests=NUMERICAL,
    ),
    Fault(
        name="Richardson's divisor without its one",
        file="kolsky/uncertainty/numerical.py",
        right="self.coarser / (self.ratio**ORDER - 1.0) if",
        wrong="self.coarser / self.ratio**ORDER if",
        tests=NUMERICAL,
    ),
    Fault(
        name="the refined mesh less the coarser one",
        file="kolsky/uncertainty/numerical.py",
        right="coarser=np.nan_to_num(coarse - model) - fine",
        wrong="coarser=np.nan_to_num(model - coarse) - fine",
        tests=NUMERICAL,
    ),
    Fault(
        name="what is left of a graded mesh's error added to what it cures",
        file="kolsky/uncertainty/numerical.py",
        right="return self.left - self.graded",
        wrong="return self.left + self.graded",
        tests=NUMERICAL,
    ),
    Fault(
        name="a graded mesh's Richardson without its one",
        file="kolsky/uncertainty/numerical.py",
        right="self.coarser / (self.ratio**GRADED_ORDER - 1.0)",
        wrong="self.coarser / self.ratio**GRADED_ORDER",
        tests=NUMERICAL,
    ),
    Fault(
        name="a graded mesh's error of first order",
        file="kolsky/uncertainty/numerical.py",
        right="GRADED_ORDER = 2.0",
        wrong="GRADED_ORDER = 1.0",
        tests=NUMERICAL,
    ),
    Fault(
        name="the elements' whole distance beside graded meshes",
        file="kolsky/uncertainty/numerical.py",
        right="np.hypot(left, self.element_share * apart)",
        wrong="np.hypot(left, apart)",
        tests=NUMERICAL,
    ),
    Fault(
        name="graded meshes alone as sure as with the other element",
        file="kolsky/uncertainty/numerical.py",
        right="return ALONE * left",
        wrong="return left",
        tests=NUMERICAL,
    ),
    Fault(
        name="the finer graded mesh less the coarser one",
        file="kolsky/uncertainty/numerical.py",
        right="coarser=np.nan_to_num(coarse - same)",
        wrong="coarser=np.nan_to_num(same - coarse)",
        tests=NUMERICAL,
    ),
    Fault(
        name="graded runs at the points of a mesh that is run in step",
        file="kolsky/uncertainty/numerical.py",
        right="(_vector(stages, fine, numerics, shifted=False) for",
        wrong="(_vector(stages, fine, numerics, shifted=True) for",
        tests=NUMERICAL,
    ),
    Fault(
        name="graded meshes where a surface slides",
        file="kolsky/uncertainty/numerical.py",
        right="if fine.roughness is not None or",
        wrong="if False or",
        tests=NUMERICAL,
    ),
)
