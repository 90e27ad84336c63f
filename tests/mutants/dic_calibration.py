"""Faults of calibrations: the order of pairs, their residuals, what is predicted."""

from tests.mutants.fault import Fault

ORDER = ("tests/unit/dic/test_dic_pair_order.py",)
TOGETHER = ("tests/unit/dic/test_dic_side_by_side.py",)

FAULTS = (
    Fault(
        name="calibration: pairs that do not fit are used",
        file="kolsky/pictures/calibration.py",
        right="LARGEST_RMS = 1.0",
        wrong="LARGEST_RMS = 100.0",
        tests=ORDER,
    ),
    Fault(
        name="calibration: an order that few pictures fit",
        file="dic/calibration/refine.py",
        right="LEAST_SHARE = 0.8",
        wrong="LEAST_SHARE = 0.1",
        tests=(f"{ORDER[0]}::test_pictures_of_other_poses_have_no_order",),
    ),
    Fault(
        name="calibration: parts that cannot be solved are left out of what is predicted",
        file="dic/calibration/solve.py",
        right="if len(sums) < len(parts):",
        wrong="if not sums:",
        tests=TOGETHER,
    ),
)
