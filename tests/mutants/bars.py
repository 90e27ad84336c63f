"""Faults of the reduction between bars: warnings, thresholds, budget, arrivals, corrections, events."""

from tests.mutants.fault import Fault

REMARKS = ("tests/unit/bars/test_remarks_and_quoted_values.py",)
INPUTS = ("tests/unit/bars/test_budget_inputs.py",)
THRESHOLDS = ("tests/unit/bars/test_thresholds.py",)
BUDGET = ("tests/unit/bars/test_waves_budget.py",)
REPEATS = ("tests/unit/bars/test_waves_repeats.py",)
FRONT = ("tests/unit/bars/test_front_path.py::test_noise_and_scale_are_told_apart",)
UNSEEN = ("tests/unit/bars/test_flyer_unseen.py",)
SMOOTHNESS = ("tests/unit/bars/test_flyer_smoothness.py",)
FLYER = "tests/unit/bars/test_flyer.py"
FLIGHT = "tests/unit/shot/test_flight_report.py"
CARRIED = "tests/unit/bars/test_carried_uncertainty.py"

QUOTED = "kolsky/bars/reduction/quoted_values.py"
SIGNALS = "kolsky/bars/reduction/signal_remarks.py"
SUMMARY = "kolsky/bars/reduction/summary.py"
VARIED = "kolsky/bars/reduction/varied_test.py"
WINDOWS = "kolsky/bars/reduction/windows.py"
ARRIVAL = "kolsky/bars/signals/arrival.py"
ZERO = "kolsky/bars/signals/signal_zero.py"
EVENTS = "kolsky/bars/flyer/event_signals.py"
CLOCKS = "kolsky/bars/flyer/synchronisation.py"
VALIDITY = "kolsky/bars/reduction/validity.py"

GAP = "kolsky/bars/flyer/unseen.py"

FAULTS = (
    Fault(
        "an unseen onset as smooth as the likeliest",
        "kolsky/bars/flyer/fit.py",
        "    if free.any():",
        "    if False:",
        SMOOTHNESS,
    ),
    Fault(
        "draws of the smoothness all alike",
        GAP,
        "+ 0.5 * (normal**2).sum(axis=1)",
        "- 1e9 * (normal**2).sum(axis=1)",
        SMOOTHNESS,
    ),
    Fault("draws weighed twice as much", GAP, "-0.5 * deviance(one)[0]", "-deviance(one)[0]", SMOOTHNESS),
    Fault(
        "means of the draws scatter about nothing",
        GAP,
        "covariance + np.outer(mean - jerk, mean - jerk)",
        "covariance",
        SMOOTHNESS,
    ),
    Fault(
        "the smoothness of spans before an unseen frame alone",
        GAP,
        "hidden[:-1] | hidden[1:]",
        "hidden[1:]",
        SMOOTHNESS,
    ),
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
        "kolsky/bars/budget/propagation.py",
        "0.5 * (plus[name] - minus[name]))",
        "0.25 * (plus[name] - minus[name]))",
        BUDGET,
    ),
    Fault(
        "degrees of freedom not divided by",
        "kolsky/bars/budget/budget.py",
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
        "an earlier pulse of the other sign let pass",
        WINDOWS,
        "OTHER_SIGN = 0.2",
        "OTHER_SIGN = 2.0",
        THRESHOLDS,
    ),
    Fault("faint reflected pulses taken", WINDOWS, "VISIBLE = 0.05", "VISIBLE = 0.005", THRESHOLDS),
    Fault(
        "one way instead of two to the far end",
        WINDOWS,
        "return 2.0 * (signal.bar.length",
        "return 1.0 * (signal.bar.length",
        THRESHOLDS,
    ),
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
        "forces in their noise judged",
        "kolsky/bars/reduction/equilibrium.py",
        "LEAST_FORCE = 5.0",
        "LEAST_FORCE = 0.5",
        THRESHOLDS,
    ),
    Fault("validity without coverage", VALIDITY, "COVERAGE = 2.0", "COVERAGE = 1.0", THRESHOLDS),
    Fault("an empty window not said", VALIDITY, "NEARLY_EMPTY = 0.2", "NEARLY_EMPTY = 0.02", THRESHOLDS),
    Fault("another motion taken for a match", CLOCKS, "UNLIKE = 25.0", "UNLIKE = 250.0", THRESHOLDS),
    Fault("residuals narrow a lag", CLOCKS, "growth = max(1.0, ratio)", "growth = ratio", THRESHOLDS),
    Fault(
        "the trigger's sigma dropped",
        CLOCKS,
        "np.sqrt(growth * covariance[-1, -1]), sigma_trigger",
        "np.sqrt(growth * covariance[-1, -1]), 0.0",
        THRESHOLDS,
    ),
    Fault("impacts of any size", EVENTS, "EXCURSION = 3.0", "EXCURSION = 1.0", THRESHOLDS),
    Fault(
        "dips of any depth", EVENTS, "0.05 * float(driven.max())", "0.005 * float(driven.max())", THRESHOLDS
    ),
    Fault(
        "kinks without their misfit",
        "kolsky/bars/flyer/kink.py",
        "growth = max(1.0, left / (y.size - J.shape[1]))",
        "growth = 1.0",
        THRESHOLDS,
    ),
    Fault(
        "the punching of one face only",
        "kolsky/bars/reduction/punching.py",
        "sunk = (first * F1.value + second * F2.value) / L",
        "sunk = (first * F1.value) / L",
        THRESHOLDS,
    ),
    Fault(
        "the noise of a slope over one sample",
        "kolsky/bars/reduction/punching.py",
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
        "kolsky/bars/reduction/mass.py",
        " + (a * sigma_distance / d) ** 2",
        "",
        THRESHOLDS,
    ),
    Fault(
        "slow noise of the front dropped",
        "kolsky/bars/flyer/front_path.py",
        "return waves.sigma, waves.sigma if waves.white is None else waves.white",
        "return waves.sigma, waves.sigma",
        FRONT,
    ),
    Fault(
        "memory of a tail dropped",
        "kolsky/bars/signals/droop.py",
        "covariance[1, 1] * memory",
        "covariance[1, 1]",
        (f"{CARRIED}::test_a_tail_with_correlated_noise_is_known_half_as_well",),
    ),
    Fault(
        "residuals of a wave speed taken as independent",
        "kolsky/bars/guides/bars_together.py",
        "max(alike * float",
        "max(float",
        (f"{CARRIED}::test_correlated_residuals_widen_a_wave_speed",),
    ),
    Fault(
        "noise of the gauges dropped from a wave speed",
        "kolsky/bars/guides/bars_together.py",
        ", noise / peak**2)",
        ", 0.0)",
        (f"{CARRIED}::test_a_wave_speed_is_not_better_than_the_gauges_noise",),
    ),
    Fault(
        "symmetry ends in the noise",
        "kolsky/bars/flyer/flight.py",
        "part - coverage * sigma > share",
        "part > share",
        (f"{CARRIED}::test_symmetry_ends_beyond_two_sigmas",),
    ),
    Fault(
        name="a flight's own noise: variance of second differences over 2",
        file="kolsky/bars/flyer/flight.py",
        right="n=2, axis=1)) / 6.0",
        wrong="n=2, axis=1)) / 2.0",
        tests=("tests/unit/bars/test_flight.py::test_a_frames_own_noise_is_what_no_smooth_error_explains",),
    ),
    Fault(
        "intervals compared in their unit",
        "kolsky/bars/budget/monte_carlo.py",
        "np.max(off / u)",
        "np.max(off)",
        (f"{CARRIED}::test_intervals_are_compared_in_standard_uncertainties",),
    ),
    Fault(
        "full speed known better than a frame",
        "kolsky/bars/flyer/events.py",
        "frame = float(np.median(np.diff(path.knots)))",
        "frame = 0.0",
        (f"{CARRIED}::test_full_speed_is_known_to_a_frame_at_best",),
    ),
    Fault(
        "the common error of frames dropped",
        "kolsky/bars/flyer/fit.py",
        "spread = spread + gain",
        "spread = spread + 0.0 * gain",
        (f"{CARRIED}::test_a_common_error_of_all_frames_is_in_the_paths_uncertainty",),
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
    Fault(
        name="a flyer's path: frames without a displacement tell of the noise",
        file="kolsky/bars/flyer/jerks.py",
        right="own = np.where(data, noise.sum(axis=1), 1.0)",
        wrong="own = noise.sum(axis=1)",
        tests=UNSEEN,
    ),
    Fault(
        name="a flyer's path: round-off of a gap in the likelihood",
        file="kolsky/bars/flyer/jerks.py",
        right="P = rest.dot(P).dot(rest.T) + noise_k * upright * gain",
        wrong="P = P - upright * column",
        tests=UNSEEN,
    ),
    Fault(
        name="a flyer's path: one jerk from rest to speed across a gap",
        file="kolsky/bars/flyer/fit.py",
        right="LONGEST_STEP = 2.5",
        wrong="LONGEST_STEP = 250.0",
        tests=UNSEEN,
    ),
    Fault(
        name="a flyer's path: the zero's sigma taken for its variance",
        file="kolsky/shot/flyer_path.py",
        right="motion.zero_sigma**2 * np.outer",
        wrong="motion.zero_sigma * np.outer",
        tests=UNSEEN,
    ),
    Fault(
        name="a flyer's path: the places at rest share the zero's error",
        file="kolsky/shot/flyer_path.py",
        right="moved = (motion.time > start)",
        wrong="moved = (motion.time > -np.inf)",
        tests=UNSEEN,
    ),
    Fault(
        name="a flyer's path: noise of all frames taken for a share of each one's",
        file="kolsky/bars/flyer/jerks.py",
        right="np.column_stack([np.ones(weight.size), weight**2])",
        wrong="np.column_stack([np.ones(weight.size), weight])",
        tests=(f"{FLYER}::test_noise_of_all_frames_beside_the_declared_one",),
    ),
    Fault(
        name="a flyer's path: added noise that vanished stays away",
        file="kolsky/bars/flyer/jerks.py",
        right="x[1:n_parts] < np.log(VANISHED)",
        wrong="x[1:n_parts] < -np.inf",
        tests=(f"{FLYER}::test_added_noise_that_a_search_loses_is_found_again",),
    ),
    Fault(
        name="a flyer's path: its noise without the part that all frames have",
        file="kolsky/bars/flyer/fit.py",
        right="s = np.sqrt(parts @ np.exp(2.0 * log_scales))",
        wrong="s = np.full(t.size, np.exp(log_scales[0]))",
        tests=(f"{FLYER}::test_warm_air_in_well_seen_frames_is_no_fault_of_the_others",),
    ),
    Fault(
        name="symmetry ends with three frames of another direction",
        file="kolsky/bars/flyer/flight_report.py",
        right="times_in_row=frames_in(over, time),",
        wrong="times_in_row=FEWEST_IN_ROW,",
        tests=(f"{FLIGHT}::test_a_short_swing_is_no_end_of_symmetry",),
    ),
    Fault(
        name="another direction lasts a step less than the first took",
        file="kolsky/bars/flyer/flight_report.py",
        right="1 + int(np.ceil(span",
        wrong="int(np.ceil(span",
        tests=(f"{FLIGHT}::test_another_direction_must_last_as_long_as_the_first_took",),
    ),
)
