"""Faults of the paper's method: its cost, its uncertainty, its interval, what it calls told and confirmed."""

from tests.mutants.fault import Fault

TESTS = ("tests/unit/studies/test_paper_method.py",)
METHOD = "kolsky/studies/paper_method.py"
PAPER_SURFACE = "kolsky/studies/paper_method.py"
INTERVAL = "kolsky/studies/paper_method.py"
SWEEPS = ("tests/unit/report/test_sweep_report.py",)

FAULTS = (
    Fault(
        name="the interval of the paper's method has half of delta Phi",
        file=INTERVAL,
        right="limit = float(cost.min()) + delta",
        wrong="limit = float(cost.min()) + 0.5 * delta",
        tests=TESTS,
    ),
    Fault(
        name="the interval of the paper's method ends at a run and not at the crossing",
        file=INTERVAL,
        right="return float(x[0] + share * (x[1] - x[0]))",
        wrong="return float(x[0])",
        tests=TESTS,
    ),
    Fault(
        name="an interval that reaches the design's upper bound is not open",
        file=INTERVAL,
        right="first == 0, last == len(x) - 1)",
        wrong="first == 0, False)",
        tests=TESTS,
    ),
    Fault(
        name="the interval of the paper's method stays where the coarse mesh had it",
        file=METHOD,
        right="interval.moved(factor - coarse[MOVED])",
        wrong="interval",
        tests=TESTS,
    ),
    Fault(
        name="without an outline delta Phi is that of both",
        file=PAPER_SURFACE,
        right="return found.sigma_phi if found.has_shape else found.sigma_phi_force / SCALE_FORCE",
        wrong="return found.sigma_phi",
        tests=TESTS,
    ),
    Fault(
        name="friction is told by its lower bound",
        file=PAPER_SURFACE,
        right="cost[-1] - cost.min() > delta",
        wrong="cost[0] - cost.min() > delta",
        tests=TESTS,
    ),
    Fault(
        name="an optimum at a bound of its design is confirmed",
        file=METHOD,
        right="confirmed=moved <= CONFIRMED and not at_bound(factor, given[MOVED])",
        wrong="confirmed=moved <= CONFIRMED",
        tests=TESTS,
    ),
    Fault(
        name="the profile over m is the mean over friction",
        file=PAPER_SURFACE,
        right="cost.min(axis=others)",
        wrong="cost.mean(axis=others)",
        tests=TESTS,
    ),
    Fault(
        name="the least of a sweep's interpolant is its best run",
        file="kolsky/studies/sweep_analysis.py",
        right="at=box.as_dict(found.x),",
        wrong="at=box.as_dict(start),",
        tests=SWEEPS,
    ),
)
