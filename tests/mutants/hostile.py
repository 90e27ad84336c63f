"""Faults of what keeps damaged and hostile files out, and results whole."""

from tests.mutants.fault import Fault

_LIMITS = "tests/unit/readers/test_unpacking_limits.py"
_FILES = "tests/unit/base/test_files.py"

FAULTS = (
    Fault(
        "variables of a MATLAB file do not share a limit",
        "kolsky/readers/matlab.py",
        "        left -= max(len(body), 0 if made.values is None else made.values.nbytes)",
        "        left -= 0",
        (f"{_LIMITS}::test_variables_share_one_limit",),
    ),
    Fault(
        "numbers of a MATLAB file count as they are stored",
        "kolsky/readers/matlab.py",
        "    if size * np.dtype(kind).itemsize > limit:",
        "    if size * kept.itemsize > limit:",
        (f"{_LIMITS}::test_numbers_stored_in_a_byte_count_as_what_they_become",),
    ),
    Fault(
        "a strip may unpack to anything",
        "dic/images/tiff.py",
        "        if left < 0:",
        "        if left < -(10**9):",
        (f"{_LIMITS}::test_a_strip_may_not_unpack_to_more_than_the_page",),
    ),
    Fault(
        "colours become grey in silence",
        "dic/images/numbered.py",
        "picture.ndim == 3 and bool((picture != picture[..., :1]).any())",
        "picture.ndim == 4 and bool((picture != picture[..., :1]).any())",
        (f"{_LIMITS}::test_colours_become_grey_by_a_rule_that_is_said",),
    ),
    Fault(
        "what a result unpacks to is not summed",
        "kolsky/base/hdf5.py",
        "    place.taken[0] += dataset.size * dataset.dtype.itemsize",
        "    place.taken[0] = dataset.size * dataset.dtype.itemsize",
        (f"{_LIMITS}::test_a_result_may_not_unpack_to_more_than_so_many_times_its_size",),
    ),
    Fault(
        "a sample of any size is read",
        "kolsky/readers/sheet.py",
        "        bad = np.flatnonzero(~(np.abs(numbers) <= LARGEST_SAMPLE) & ~(np.isnan(numbers) & gaps))",
        "        bad = np.flatnonzero(~(np.abs(numbers) <= np.inf) & ~(np.isnan(numbers) & gaps))",
        (f"{_LIMITS}::test_no_sample_is_larger_than_anything_measured",),
    ),
    Fault(
        "a clock may start anywhere",
        "kolsky/readers/recordings.py",
        "    if not (abs(clock.start) <= LARGEST_SAMPLE and 0.0 < clock.interval <= LARGEST_SAMPLE):",
        "    if not 0.0 < clock.interval <= LARGEST_SAMPLE:",
        (f"{_LIMITS}::test_a_clock_is_finite",),
    ),
    Fault(
        "a mesh is not counted",
        "kolsky/readers/gmsh_mesh.py",
        "    if not said.isdecimal() or int(said[:12]) != len(lines) - 1:",
        "    if not said.isdecimal():",
        (f"{_LIMITS}::test_a_mesh_is_whole",),
    ),
    Fault(
        "an outline row that stands several times weighs so often",
        "kolsky/shot/outline.py",
        "    if first.size == len(rows):",
        "    if first.size <= len(rows):",
        ("tests/unit/shot/test_repeated_rows.py",),
    ),
    Fault(
        "what another process writes is removed",
        "dic/files.py",
        "        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)",
        "        pass",
        (f"{_FILES}::test_what_a_killed_process_left_is_removed_by_the_next",),
    ),
    Fault(
        "what a killed process left stays",
        "dic/files.py",
        "    remove_abandoned(folder)\n",
        "",
        (f"{_FILES}::test_what_a_killed_process_left_is_removed_by_the_next",),
    ),
    Fault(
        "two processes put their files in one folder at once",
        "kolsky/base/files.py",
        "            with alone_in(folder):\n",
        "            if True:\n",
        (f"{_FILES}::test_results_are_put_in_their_places_alone",),
    ),
    Fault(
        "a full disk has another cure",
        "kolsky/cli/commandline.py",
        "    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):",
        "    if error.errno in (errno.EFBIG,):",
        ("tests/unit/cli/test_system_refusals.py::test_each_refusal_has_its_cure",),
    ),
)
