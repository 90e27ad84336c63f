"""Inputs that must not be accepted, hang, flood or end in a traceback, each with its tests."""

from dataclasses import dataclass

_UNIT = "tests/unit"
_INPUTS = "tests/fuzz/test_named_inputs.py"
_LIMITS = f"{_UNIT}/readers/test_unpacking_limits.py"
_FIELDS = f"{_UNIT}/readers/test_long_fields.py"
_LEDGER = f"{_UNIT}/doe/test_doe_ledger.py"
_FILES = f"{_UNIT}/base/test_files.py"
_SYSTEM = f"{_UNIT}/cli/test_system_refusals.py"
CORPUS = "corpus"  # place of what is tried in every file that it can stand in, by `python -m tests.fuzz`


@dataclass(frozen=True)
class Named:
    """One input."""

    what: str
    answer: str  # what becomes of it
    places: tuple[str, ...]  # tests as pytest names them without parameters, or `CORPUS` and the trap's name


def _trap(*names: str) -> tuple[str, ...]:
    return tuple(f"{CORPUS}: {name}" for name in names)


SILENT = (
    Named(
        "a specimen's length of 65 mm or 6.5 m for 6.5 mm", "refused: outline, or scale of the pictures",
        (f"{_INPUTS}::test_a_shot_with_it_is_refused",
         f"{_UNIT}/shot/test_picture_scale.py::test_the_refusal_names_both"),
    ),
    Named("the time column declared as a voltage", "refused",
          (f"{_INPUTS}::test_a_shot_with_it_is_refused",)),
    Named("1e308 or ten radii in an outline", "refused with its line",
          (f"{_INPUTS}::test_a_shot_with_it_is_refused",)),
    Named("pictures with colours", "refused (TIFF), or grey by a rule that is said",
          (f"{_LIMITS}::test_colours_become_grey_by_a_rule_that_is_said",
           f"{_UNIT}/dic/test_dic_images.py::test_a_tiff_of_floats_or_colours_is_refused")),
    Named("a strip of 4 GB in a small TIFF", "refused", _trap("a strip of 4 GB")),
    Named("`sweep --merge` that is refused", "leaves no ledger",
          (f"{_INPUTS}::test_a_refused_merge_leaves_no_ledger",)),
    Named("a full disk under a sweep", "one line, exit code 2", (f"{_SYSTEM}::test_a_disk_that_is_full",)),
    Named("control characters in a name", "printed as escapes",
          (f"{_INPUTS}::test_a_name_of_control_characters_does_not_reach_the_terminal",
           f"{_UNIT}/cli/test_text_arithmetic.py::test_a_name_cannot_steer_the_terminal")),
    Named("one frame of the flyer 5.9 mm off", "named, without weight; the answer stays",
          (f"{_UNIT}/shot/test_second_impact.py::test_a_stray_frame_of_a_shot_is_named_and_has_no_weight",
           f"{_INPUTS}::test_one_stray_frame_does_not_move_the_answer")),
    Named("one outline row 500 times", "named, counted once",
          (f"{_UNIT}/shot/test_shots.py"
           "::test_an_outline_row_that_stands_five_hundred_times_is_counted_once",)),
    Named("one bit turned in a ledger's row", "named, run again",
          (f"{_LEDGER}::test_a_changed_row_counts_as_not_there_and_is_named",)),
    Named("results exchanged between two runs of a ledger", "named, run again",
          (f"{_LEDGER}::test_results_exchanged_between_two_runs_are_found",)),
)  # fmt: skip
"""Once believed."""
ENDLESS = (
    Named("a pipe, a device, a folder, a link to them, in place of any file", "refused before it is opened",
          (*_trap("a pipe", "a link to a device", "a folder", "a link to itself"),
           f"{_UNIT}/readers/test_regular_files.py::test_a_pipe_is_refused")),
    Named("3000 blanks behind a bracket", "no unit, at once", (f"{_FIELDS}::test_a_long_field_has_no_unit",)),
    Named("a unit of 300 000 letters", "refused or no unit, at once",
          (*_trap("a unit of 300 000 letters"), f"{_FIELDS}::test_a_long_unit_is_none")),
    Named("lines of 300 000 blanks in a calibration of MatchID", "refused at once",
          (f"{_LIMITS}::test_a_camera_file_of_long_lines_is_refused_at_once",
           *_trap("a line of 300 000 blanks"))),
    Named("a sheet's row of the number 2 000 000 000", "refused",
          _trap("a row of the number 2 000 000 000", "a sheet that declares 2 000 000 000 rows")),
    Named("12 GB in 12 MB of MATLAB variables", "refused",
          (*_trap("12 GB of MATLAB variables"), f"{_LIMITS}::test_variables_share_one_limit")),
    Named("gigabytes in a strip of a TIFF", "refused",
          (*_trap("2 GB in a strip"), f"{_LIMITS}::test_a_strip_may_not_unpack_to_more_than_the_page")),
    Named("a billion declared times in HDF5", "refused", _trap("a billion declared times")),
    Named("160 GB of zeros in datasets each of which may be read", "read, within the limits",
          _trap("160 GB of zeros")),
    Named("a result file of zeros", "refused", _trap("an identification of zeros", "surfaces of zeros")),
    Named("a sparse file of 20 GB in place of any file", "refused", _trap("20 GB of nothing")),
)  # fmt: skip
"""Once a hang or a flood."""
TRACEBACKS = (
    Named("a file name that is too long", "one line", (f"{_SYSTEM}::test_a_name_that_is_too_long",)),
    Named("a field of more than 131 072 characters", "refused or read",
          _trap("a field of 200 000 characters in quotes", "5 MB without an end of line")),
    Named("times of HDF5's own type, and other odd types", "refused or read",
          (f"{_INPUTS}::test_times_of_odd_types_in_hdf5",)),
    Named("a clock that starts at infinity", "refused", (f"{_LIMITS}::test_a_clock_is_finite",)),
    Named("forces of 1e308", "refused", (f"{_LIMITS}::test_no_sample_is_larger_than_anything_measured",)),
    Named("YAML and JSON nested 100 000 deep", "refused",
          (f"{_UNIT}/dic/test_dic_camera_files.py::test_deep_nesting_is_refused",)),
    Named("a wave speed of 1e300 m/s", "refused with its line",
          (f"{_INPUTS}::test_a_wave_speed_of_1e300_is_refused",
           f"{_UNIT}/base/test_units.py::test_sizes_that_nothing_measured_has")),
    Named("a disk that fills up under sweep, waves, identify, plan, virtual make", "one line, no remains",
          (f"{_SYSTEM}::test_a_disk_that_is_full", f"{_FILES}::test_a_full_disk_is_one_line_and_no_remains")),
    Named("any refusal of the corpus or the sources", "names the file, and a cure or what is allowed",
          ("tests/fuzz/test_fuzz_judge.py::test_nothing_is_wrong_in_silence_and_nothing_ends_in_a_traceback",
           "tests/fuzz/test_fuzz_judge.py::test_a_refusal_needs_a_name_a_cure_and_one_line",
           f"{_UNIT}/base/test_every_refusal.py::test_every_refusal_names_a_cure_or_what_is_allowed")),
)  # fmt: skip
"""Once a traceback, or a line without help."""
ENDS = (
    Named("a folder that nobody may write to", "one line, earlier results stay",
          (f"{_UNIT}/cli/test_closed_folders.py::test_every_command_refuses_a_closed_folder_in_one_line",
           f"{_UNIT}/cli/test_ends.py::test_a_folder_that_nobody_may_write_to")),
    Named("two commands that write into one folder", "the second waits",
          (f"{_FILES}::test_of_two_commands_in_one_folder_the_second_waits",)),
    Named("two sweeps with one ledger", "the second says that it is in use",
          (f"{_LEDGER}::test_two_processes_cannot_hold_one_ledger",)),
    Named("what a killed command left", "removed by the next one",
          (f"{_FILES}::test_what_a_killed_process_left_is_removed_by_the_next",)),
    Named("a command that is killed while others work for it", "they end within a second",
          (f"{_UNIT}/base/test_children.py::test_children_end_within_a_second",)),
    Named("`kill` and Ctrl-C", "143 and 130, nothing half-made",
          (f"{_UNIT}/cli/test_ends.py::test_a_command_that_is_told_to_end_leaves_nothing",
           f"{_UNIT}/cli/test_ends.py::test_a_signal_that_a_library_makes_an_error_of_its_own")),
)  # fmt: skip
"""Kills, and what the system refuses."""
KINDS = {"wrong answer": SILENT, "no end": ENDLESS, "traceback": TRACEBACKS, "partial result": ENDS}
"""What an input could do -> the inputs."""


def table() -> str:
    """The inputs as a table of the documentation."""
    lines = ["| risk | input | what happens |", "| --- | --- | --- |"]
    lines += [f"| {kind} | {one.what} | {one.answer} |" for kind, inputs in KINDS.items() for one in inputs]
    return "\n".join(lines)
