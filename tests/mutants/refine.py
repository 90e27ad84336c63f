"""Faults of the refinement of the pose from speckles, and of named calibration pictures."""

from tests.mutants.fault import Fault

TESTS = ("tests/unit/dic/test_dic_refine.py",)
REFINE = "dic/calibration/refine.py"

FAULTS = (
    Fault(
        name="refinement: a gain of a fifth is no longer asked for",
        file=REFINE,
        right="<= (1.0 - LEAST_GAIN) * self.held_out_before",
        wrong="<= self.held_out_before",
        tests=TESTS,
    ),
    Fault(
        name="refinement: the length of the baseline is let go",
        file=REFINE,
        right="length * direction / np.linalg.norm(direction)",
        wrong="length * direction",
        tests=TESTS,
    ),
    Fault(
        name="refinement: judged on the points it was fitted to",
        file=REFINE,
        right="distances(fitted(a)[0], b)) for a, b",
        wrong="distances(fitted(a)[0], a)) for a, b",
        tests=("tests/unit/dic/test_dic_refine.py::test_points_left_out_take_no_part",),
    ),
    Fault(
        name="refinement: false matches pull with their square",
        file=REFINE,
        right="robust = np.sign(d) * np.sqrt(2.0 * (np.sqrt(1.0 + d * d) - 1.0))",
        wrong="robust = d",
        tests=TESTS,
    ),
    Fault(
        name="refinement: the prior taken for its inverse",
        file=REFINE,
        right="np.asarray(np.linalg.inv(np.linalg.cholesky(C)))",
        wrong="np.asarray(np.linalg.cholesky(C))",
        tests=TESTS,
    ),
    Fault(
        name="refinement: taken where it does not help",
        file="kolsky/pictures/rig.py",
        right="used = section.refine is True or found.helps",
        wrong="used = section.refine is not False",
        tests=("tests/unit/shot/test_refined_rig.py",),
    ),
    Fault(
        name="calibration: a first picture of an odd size is let through",
        file="kolsky/pictures/calibration.py",
        right="if other > same:",
        wrong="if other < same:",
        tests=("tests/unit/dic/test_dic_unusable_pictures.py",),
    ),
)
