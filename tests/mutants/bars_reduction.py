"""Faults of the reduction between bars: warnings, thresholds, budget, corrections."""

from tests.mutants.fault import Fault

REMARKS = ("tests/unit/bars/test_remarks_and_quoted_values.py",)
INPUTS = ("tests/unit/bars/test_budget_inputs.py",)
THRESHOLDS = ("tests/unit/bars/test_thresholds.py",)
BUDGET = ("tests/unit/bars/test_waves_budget.py",)
REPEATS = ("tests/unit/bars/test_waves_repeats.py",)
CARRIED = "tests/unit/bars/test_carried_uncertainty.py"
QUOTED = "kolsky/bars/reduction/summary.py"
SIGNALS = "kolsky/bars/reduction/summary.py"
SUMMARY = "kolsky/bars/reduction/summary.py"
VARIED = "kolsky/bars/reduction/varied_test.py"
WINDOWS = "kolsky/bars/reduction/windows.py"
PULSE_CHECKS = "kolsky/bars/reduction/windows.py"
VALIDITY = "kolsky/bars/reduction/validity.py"

FAULTS = (
    Fault(
        "a missing reflected pulse is not remarked",
        SIGNALS,
        'found.append(f"no reflected pulse is found: {reflected.reason}")',
        "pass",
        REMARKS,
    ),
    Fault(
        "a delayed pulse is remarked ten times too late",
        SIGNALS,
        "LARGEST_DELAY = 3.0",
        "LARGEST_DELAY = 30.0",
        REMARKS,
    ),
    Fault("two samples' allowance dropped", SIGNALS, " + 2.0 * interval\n", "\n", REMARKS),
    Fault(
        "an early pulse is not remarked",
        SIGNALS,
        "if late or check.offset < -allowed:",
        "if late:",
        REMARKS,
    ),
    Fault("nonlinear values not named", QUOTED, "BEND = 0.2", "BEND = 2.0", REMARKS),
    Fault("undeclared uncertainties not remarked", QUOTED, "if not systematic:", "if systematic:", REMARKS),
    Fault("no equilibrium not remarked", QUOTED, "if reduction.balanced is None:", "if False:", REMARKS),
    Fault(
        "sigma of the modulus without correlation",
        SUMMARY,
        "sqrt(alike / spread)",
        "sqrt(1.0 / spread)",
        REMARKS,
    ),
    Fault("a modulus up to the whole stress", SUMMARY, "RISING_SHARE = 0.5", "RISING_SHARE = 0.95", REMARKS),
    Fault("a modulus from a few samples", SUMMARY, "FEWEST_SAMPLES = 10", "FEWEST_SAMPLES = 3", REMARKS),
    Fault(
        "the transmission gauge's distance not in the budget",
        VARIED,
        "{key: station.position for key, station in given.stations.items()}, given.uncertainty",
        '{key: s.position for key, s in given.stations.items() if key != "transmission"}, given.uncertainty',
        INPUTS,
    ),
    Fault(
        "the bars not in the budget",
        VARIED,
        "quantities += bar_quantities(given.bars[side], side, given.uncertainty)",
        "pass",
        INPUTS,
    ),
    Fault(
        "a gauge's other distance not used",
        VARIED,
        'return values.get(f"{side} gauge, distance", position)',
        "return position",
        INPUTS,
    ),
    Fault(
        "specimen length's uncertainty taken as absolute",
        VARIED,
        'L * uncertainty.get("specimen_length", 0.0)',
        'uncertainty.get("specimen_length", 0.0)',
        INPUTS,
    ),
    Fault(
        "bars of one rod taken as independent",
        VARIED,
        "{pair: 1.0 for pair in pairs if given.alike",
        "{pair: 0.0 for pair in pairs if given.alike",
        INPUTS,
    ),
    Fault(
        "contributions halved",
        "kolsky/bars/budget.py",
        "0.5 * (plus[name] - minus[name]))",
        "0.25 * (plus[name] - minus[name]))",
        BUDGET,
    ),
    Fault(
        "degrees of freedom not divided by",
        "kolsky/bars/budget.py",
        "under += variance**2 / nu",
        "under += variance**2",
        BUDGET,
    ),
    Fault(
        "repeats' band without Student",
        "kolsky/bars/reduction/repeated_tests.py",
        "student.ppf(0.5 + 0.5 * probability, nu)",
        "student.ppf(0.5 + 0.5 * probability, np.inf)",
        REPEATS,
    ),
    Fault(
        "scatter not reduced by repeating",
        "kolsky/bars/reduction/repeated_tests.py",
        "self.scatter / np.sqrt(self.count)",
        "self.scatter",
        REPEATS,
    ),
    Fault(
        "an earlier pulse of the other sign let pass",
        WINDOWS,
        "OTHER_SIGN = 0.2",
        "OTHER_SIGN = 2.0",
        THRESHOLDS,
    ),
    Fault("faint reflected pulses taken", PULSE_CHECKS, "VISIBLE = 0.05", "VISIBLE = 0.005", THRESHOLDS),
    Fault(
        "one way instead of two to the far end",
        WINDOWS,
        "return 2.0 * (signal.bar.length",
        "return 1.0 * (signal.bar.length",
        THRESHOLDS,
    ),
    Fault(
        "forces in their noise judged",
        "kolsky/bars/reduction/validity.py",
        "LEAST_FORCE = 5.0",
        "LEAST_FORCE = 0.5",
        THRESHOLDS,
    ),
    Fault("validity without coverage", VALIDITY, "COVERAGE = 2.0", "COVERAGE = 1.0", THRESHOLDS),
    Fault("an empty window not said", VALIDITY, "NEARLY_EMPTY = 0.2", "NEARLY_EMPTY = 0.02", THRESHOLDS),
    Fault(
        "the punching of one face only",
        "kolsky/bars/reduction/stress_strain.py",
        "sunk = (first * F1.value + second * F2.value) / L",
        "sunk = (first * F1.value) / L",
        THRESHOLDS,
    ),
    Fault(
        "the noise of a slope over one sample",
        "kolsky/bars/reduction/stress_strain.py",
        "slope_noise = noise / (width * step)",
        "slope_noise = noise / step",
        THRESHOLDS,
    ),
    Fault(
        "a third of the axial inertia",
        "kolsky/bars/reduction/inertia.py",
        "(rho * length / 2.0 * a.sigma) ** 2",
        "(rho * length / 6.0 * a.sigma) ** 2",
        THRESHOLDS,
    ),
    Fault(
        "the stations' distance known exactly",
        "kolsky/bars/reduction/inertia.py",
        " + (a * sigma_distance / d) ** 2",
        "",
        THRESHOLDS,
    ),
    Fault(
        "intervals compared in their unit",
        "kolsky/bars/monte_carlo.py",
        "np.max(off / u)",
        "np.max(off)",
        (f"{CARRIED}::test_intervals_are_compared_in_standard_uncertainties",),
    ),
    Fault(
        "memory dropped on the way to the faces",
        "kolsky/bars/reduction/faces.py",
        "s.strain.sigma * sqrt(s.strain.memory)",
        "s.strain.sigma",
        (f"{CARRIED}::test_slow_noise_of_the_gauges_is_carried_to_the_faces",),
    ),
    Fault(
        "equilibrium judged by the larger noise",
        "kolsky/bars/reduction/stress_strain.py",
        "min(s, width**0.5",
        "max(s, width**0.5",
        (f"{CARRIED}::test_equilibrium_is_judged_by_the_lesser_of_two_noises",),
    ),
)
