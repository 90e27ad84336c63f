"""Faults of signals and waves in bars: arrivals, zero, droop, bars read together."""

from tests.mutants.fault import Fault

THRESHOLDS = ("tests/unit/bars/test_thresholds.py",)
CARRIED = "tests/unit/bars/test_carried_uncertainty.py"
ARRIVAL = "kolsky/bars/signals/arrival.py"
ZERO = "kolsky/bars/signals/baseline.py"

FAULTS = (
    Fault("pulses in the noise", ARRIVAL, "THRESHOLD = 6.0", "THRESHOLD = 5.0", THRESHOLDS),
    Fault(
        "the memory of noise dropped at an arrival",
        ARRIVAL,
        "noise = signal.sigma**2 * min(signal.memory, float(time.size))",
        "noise = signal.sigma**2",
        THRESHOLDS,
    ),
    Fault("the foot's lever dropped", ARRIVAL, "(centre - foot) ** 2 / spread", "0.0", THRESHOLDS),
    Fault("counts dropped at an arrival", ARRIVAL, " + count**2 / 12.0", "", THRESHOLDS),
    Fault(
        "a drift significant at ten percent", ZERO, "SIGNIFICANCE = 0.01", "SIGNIFICANCE = 0.1", THRESHOLDS
    ),
    Fault(
        "memory not taken off the degrees of freedom",
        ZERO,
        "self.count / max(self.noise.memory, 1.0) - 2.0",
        "self.count - 2.0",
        THRESHOLDS,
    ),
    Fault(
        "clipping seen late",
        ZERO,
        "limit = max(8, 3 * baseline.longest_run)",
        "limit = max(8, 30 * baseline.longest_run)",
        THRESHOLDS,
    ),
    Fault(
        "memory of a tail dropped",
        "kolsky/bars/signals/transducers.py",
        "covariance[1, 1] * memory",
        "covariance[1, 1]",
        (f"{CARRIED}::test_a_tail_with_correlated_noise_is_known_half_as_well",),
    ),
    Fault(
        "residuals of a wave speed taken as independent",
        "kolsky/bars/guides/propagation.py",
        "max(alike * float",
        "max(float",
        (f"{CARRIED}::test_correlated_residuals_widen_a_wave_speed",),
    ),
    Fault(
        "noise of the gauges dropped from a wave speed",
        "kolsky/bars/guides/propagation.py",
        ", noise / peak**2)",
        ", 0.0)",
        (f"{CARRIED}::test_a_wave_speed_is_not_better_than_the_gauges_noise",),
    ),
)
