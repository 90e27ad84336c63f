"""Faults of bar shots: inertia, alignment, sensitivities, true curves, files of two recorders, readers."""

from tests.mutants.fault import Fault

INERTIA = ("tests/unit/bars/test_specimen_inertia.py",)
ALIGNED = ("tests/unit/bars/test_alignment.py",)
CLOCK = ("tests/unit/shot/test_bar_files.py",)
RESULTS = ("tests/unit/cli/test_bar_results.py",)
ENDS = ("tests/unit/bars/test_free_end.py",)
HEADINGS = ("tests/unit/readers/test_workbooks_and_headings.py",)

SPECIMEN = "kolsky/bars/reduction/inertia.py"
FREE = "kolsky/bars/reduction/separation.py"
ALIGNMENT = "kolsky/bars/reduction/windows.py"

FAULTS = (
    Fault(
        "axial inertia of two waves taken as that of one",
        "kolsky/bars/reduction/inertia.py",
        '"two waves": mean - across',
        '"two waves": mean',
        (f"{INERTIA[0]}::test_axial_inertia_is_the_momentum_of_the_layers",),
    ),
    Fault(
        "the rate of a soft specimen half a sample late",
        SPECIMEN,
        "/ step) | 1)",
        "/ step) * 1)",
        (f"{INERTIA[0]}::test_the_motion_is_that_of_the_faces",),
    ),
    Fault(
        "noise of the second derivative of a mean taken as that of a sample",
        SPECIMEN,
        "history.sigma / (width * step)",
        "history.sigma / step",
        (f"{INERTIA[0]}::test_the_noise_of_the_second_derivative_is_that_of_two_means",),
    ),
    Fault(
        "no specimen is soft",
        SPECIMEN,
        'elif key == "radial inertia" and part > share:',
        'elif key == "radial inertia" and part > 10.0 * share:',
        (f"{INERTIA[0]}::test_a_specimen_is_soft_from_the_limit_on",),
    ),
    Fault(
        "validity without the sign of tension",
        SPECIMEN,
        "sign = -1.0 if tension else 1.0",
        "sign = 1.0",
        (f"{INERTIA[0]}::test_a_pulled_specimen_has_the_same_span",),
    ),
    Fault(
        "an aligned wave follows the declared distance",
        ALIGNMENT,
        "found.late + found.way - ways[wave]",
        "found.late",
        (f"{ALIGNED[0]}::test_an_aligned_wave_stays_where_it_was_seen",),
    ),
    Fault(
        "the incident arrival known exactly in an alignment",
        ALIGNMENT,
        "hypot(arrival.sigma, check.observed.sigma)",
        "check.observed.sigma",
        (f"{ALIGNED[0]}::test_the_uncertainty_is_that_of_both_arrivals",),
    ),
    Fault(
        "the second recorder's clock offset dropped",
        "kolsky/bars/reduction/faces.py",
        "offset - offsets[0]",
        "0.0 * offset",
        (f"{CLOCK[0]}::test_a_fraction_of_a_sample_between_the_recorders_is_taken_out",),
    ),
    Fault(
        "sensitivities of a pulled specimen with the sign of compression",
        "kolsky/bars/reduction/summary.py",
        "{name: sign * slope for",
        "{name: slope for",
        (f"{RESULTS[0]}::test_sensitivities_have_the_signs_of_closed_forms",),
    ),
    Fault(
        "the true curve without the sign of tension",
        "kolsky/bars/reduction/analyse.py",
        "= sign * history.value",
        "= history.value",
        (f"{RESULTS[0]}::test_the_true_curve_is_that_of_constant_volume",),
    ),
    Fault(
        "an echo from a free end with the sign of the wave",
        FREE,
        "value=strain.value + echo.value",
        "value=strain.value - echo.value",
        (f"{ENDS[0]}::test_the_wave_comes_back_from_its_echoes",),
    ),
    Fault(
        "noise of an echo's passes dropped",
        FREE,
        "strain.sigma * sqrt(seen + 1.0)",
        "strain.sigma",
        (f"{ENDS[0]}::test_its_noise_is_that_of_every_pass",),
    ),
    Fault(
        "windows until the echo is back at the gauge twice",
        FREE,
        "2.0 * s.bar.length / s.bar.wave_speed - margin",
        "4.0 * s.bar.length / s.bar.wave_speed - margin",
        (f"{ENDS[0]}::test_windows_end_when_the_echo_is_back_at_the_specimen",),
    ),
    Fault(
        "a channel A taken for a current",
        "kolsky/readers/header.py",
        "if of_time or _TAIL_UNITS.fullmatch(unit) is not None:",
        "if True:",
        (f"{HEADINGS[0]}::test_a_unit_is_found_in_the_last_word_of_a_heading",),
    ),
    Fault(
        "a time column of other steps taken for seconds",
        "kolsky/readers/sheet.py",
        "SAME_STEP = 1e-3",
        "SAME_STEP = 1e-2",
        (f"{HEADINGS[0]}::test_the_headers_interval_tells_the_unit_of_a_time_column",),
    ),
)
