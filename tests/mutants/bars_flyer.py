"""Faults of the flyer: its path, smoothness, unseen onset, flight, events, clocks."""

from tests.mutants.fault import Fault

THRESHOLDS = ("tests/unit/bars/test_thresholds.py",)
FRONT = ("tests/unit/bars/test_front_path.py::test_noise_and_scale_are_told_apart",)
UNSEEN = ("tests/unit/bars/test_flyer_unseen.py",)
SMOOTHNESS = ("tests/unit/bars/test_flyer_smoothness.py",)
FLYER = "tests/unit/bars/test_flyer.py"
FLIGHT = "tests/unit/shot/test_flight_report.py"
CARRIED = "tests/unit/bars/test_carried_uncertainty.py"
EVENTS = "kolsky/bars/flyer/events.py"
CLOCKS = "kolsky/bars/flyer/synchronisation.py"
GAP = "kolsky/bars/flyer/path.py"
MANY = "kolsky/bars/flyer/jerks.py"

FAULTS = (
    Fault(
        "an unseen onset as smooth as the likeliest",
        "kolsky/bars/flyer/path.py",
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
    Fault("draws weighed twice as much", GAP, "-0.5 * deviances(drawn)", "-deviances(drawn)", SMOOTHNESS),
    Fault(
        "many smoothnesses: frames without a displacement tell of the noise",
        MANY,
        "np.where(self.weight > 0.0, np.sum(self._noise, axis=2), 1.0)",
        "np.sum(self._noise, axis=2)",
        SMOOTHNESS,
    ),
    Fault(
        "many smoothnesses: what a shared error gains anew by its standard deviation",
        MANY,
        "1.0 - self.shared[1][k] ** 2",
        "1.0 - self.shared[1][k]",
        SMOOTHNESS,
    ),
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
        "kolsky/bars/flyer/events.py",
        "growth = max(1.0, left / (y.size - J.shape[1]))",
        "growth = 1.0",
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
        "full speed known better than a frame",
        "kolsky/bars/flyer/events.py",
        "frame = float(np.median(np.diff(path.knots)))",
        "frame = 0.0",
        (f"{CARRIED}::test_full_speed_is_known_to_a_frame_at_best",),
    ),
    Fault(
        "the common error of frames dropped",
        "kolsky/bars/flyer/path.py",
        "spread = spread + gain",
        "spread = spread + 0.0 * gain",
        (f"{CARRIED}::test_a_common_error_of_all_frames_is_in_the_paths_uncertainty",),
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
        file="kolsky/bars/flyer/path.py",
        right="LONGEST_STEP = 2.5",
        wrong="LONGEST_STEP = 250.0",
        tests=UNSEEN,
    ),
    Fault(
        name="a flyer's path: the zero's sigma taken for its variance",
        file="kolsky/shot/records.py",
        right="motion.zero_sigma**2 * np.outer",
        wrong="motion.zero_sigma * np.outer",
        tests=UNSEEN,
    ),
    Fault(
        name="a flyer's path: the places at rest share the zero's error",
        file="kolsky/shot/records.py",
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
        file="kolsky/bars/flyer/path.py",
        right="s = np.sqrt(parts @ np.exp(2.0 * log_scales))",
        wrong="s = np.full(t.size, np.exp(log_scales[0]))",
        tests=(f"{FLYER}::test_warm_air_in_well_seen_frames_is_no_fault_of_the_others",),
    ),
    Fault(
        name="symmetry ends with three frames of another direction",
        file="kolsky/bars/flyer/flight.py",
        right="times_in_row=frames_in(over, time),",
        wrong="times_in_row=FEWEST_IN_ROW,",
        tests=(f"{FLIGHT}::test_a_short_swing_is_no_end_of_symmetry",),
    ),
    Fault(
        name="another direction lasts a step less than the first took",
        file="kolsky/bars/flyer/flight.py",
        right="1 + int(np.ceil(span",
        wrong="int(np.ceil(span",
        tests=(f"{FLIGHT}::test_another_direction_must_last_as_long_as_the_first_took",),
    ),
)
