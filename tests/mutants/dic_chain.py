"""Faults of the chain from pictures to a result: gates, robust limits, remarks, checks of the travel."""

from tests.mutants.fault import Fault

GATES = ("tests/unit/dic/test_dic_gates.py",)
TRAVEL = ("tests/unit/dic/test_dic_travel_checks.py",)

FAULTS = (
    Fault(
        name="epipolar gate: the larger of two limits taken for the least",
        file="dic/chain/outliers.py",
        right="gate = max(LEAST_GATE,",
        wrong="gate = min(LEAST_GATE,",
        tests=GATES,
    ),
    Fault(
        name="epipolar gate: the median times what it should be divided by",
        file="dic/chain/outliers.py",
        right="/ 0.6745",
        wrong="* 0.6745",
        tests=GATES,
    ),
    Fault(
        name="residual map: both cameras must see the change",
        file="dic/chain/outliers.py",
        right="unlike |= unlike_points(",
        wrong="unlike &= unlike_points(",
        tests=GATES,
    ),
    Fault(
        name="MAD constant inverted",
        file="dic/basics.py",
        right="MAD = 1.4826",
        wrong="MAD = 0.6745",
        tests=GATES,
    ),
    Fault(
        name="another radius: the lesser of two limits",
        file="dic/chain/remarks.py",
        right="max(RADIUS_SIGMAS *",
        wrong="min(RADIUS_SIGMAS *",
        tests=GATES,
    ),
    Fault(
        name="travel: a step is uneven by its sigma alone",
        file="dic/chain/remarks.py",
        right="max(STEP_SHARE * abs(usual), SIGMAS * float(noise[k]))",
        wrong="SIGMAS * float(noise[k])",
        tests=TRAVEL,
    ),
    Fault(
        name="travel: left-out frames make a step long",
        file="dic/chain/remarks.py",
        right="speed = np.diff(axial.displacement) / dt",
        wrong="speed = np.diff(axial.displacement) / dt.min()",
        tests=TRAVEL,
    ),
    Fault(
        name="travel: the starting flyer is uneven",
        file="dic/chain/remarks.py",
        right="STEADY = 0.2",
        wrong="STEADY = 20.0",
        tests=TRAVEL,
    ),
    Fault(
        name="travel: the slowest points of the specimen",
        file="dic/chain/remarks.py",
        right="FASTEST = 95.0",
        wrong="FASTEST = 5.0",
        tests=TRAVEL,
    ),
    Fault(
        name="travel: a rim below the specimen's end is fine",
        file="dic/chain/remarks.py",
        right="if abs(off) > SIGMAS * sigma:",
        wrong="if off > SIGMAS * sigma:",
        tests=TRAVEL,
    ),
    Fault(
        name="region: used in another frame without proof",
        file="dic/chain/follow_bodies.py",
        right="if frame == region.frame or (inputs.static[frame] and inputs.static[region.frame]):",
        wrong="if frame == region.frame or inputs.static.any():",
        tests=TRAVEL,
    ),
)
