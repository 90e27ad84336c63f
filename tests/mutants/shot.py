"""Faults of reading a shot: ranges, zero, sign, first motion, window, strictness."""

from tests.mutants.fault import Fault

CHECKS = ("tests/unit/shot/test_checks.py",)
CONTACT = ("tests/unit/shot/test_contact_door.py",)
NEW = tuple(
    f"tests/unit/cli/test_new_from_files.py::{name}"
    for name in (
        "test_a_blank_says_what_is_allowed",
        "test_blanks_are_found_in_order",
        "test_the_next_shot_of_a_series_keeps_the_apparatus",
        "test_what_could_be_two_things_is_left_open_and_said",
        "test_two_channels_of_unknown_meaning_are_offered",
        "test_problems_come_in_the_order_of_the_file",
    )
)

FAULTS = (
    Fault(
        name="a sample at full scale is not clipped",
        file="kolsky/shot/force.py",
        right="np.abs(scope.value) >= limit",
        wrong="np.abs(scope.value) > limit",
        tests=CHECKS,
    ),
    Fault(
        name="the last code of a recorder is not clipped",
        file="kolsky/shot/force.py",
        right="1.0 - 1.5 / 2 ** (section.bits - 1)",
        wrong="1.0 - 0.5 / 2 ** (section.bits - 1)",
        tests=CHECKS,
    ),
    Fault(
        name="codes counted for one bit more",
        file="kolsky/shot/force.py",
        right="1.0 - 1.5 / 2 ** (section.bits - 1)",
        wrong="1.0 - 1.5 / 2**section.bits",
        tests=CHECKS,
    ),
    Fault(
        name="a baseline of nineteen samples is enough",
        file="kolsky/shot/force.py",
        right="SMALLEST_BASELINE = 20",
        wrong="SMALLEST_BASELINE = 19",
        tests=CHECKS,
    ),
    Fault(
        name="a baseline may begin, not end, before the test",
        file="kolsky/shot/force.py",
        right="toml.declared.force.baseline[1] > rest",
        wrong="toml.declared.force.baseline[0] > rest",
        tests=CHECKS,
    ),
    Fault(
        name="the sign is decided by a hundredth of the length",
        file="kolsky/shot/force.py",
        right="< 0.1 * toml.declared.specimen.length",
        wrong="< 0.01 * toml.declared.specimen.length",
        tests=CHECKS,
    ),
    Fault(
        name="a force that pushes has the wrong sign",
        file="kolsky/shot/force.py",
        right="if mean < 0.0:",
        wrong="if mean > 0.0:",
        tests=CHECKS,
    ),
    Fault(
        name="the clock offset of the force subtracted",
        file="kolsky/shot/records.py",
        right="return self.recording.time + self.clock_offset",
        wrong="return self.recording.time - self.clock_offset",
        tests=CHECKS,
    ),
    Fault(
        name="the zero of the force added",
        file="kolsky/shot/records.py",
        right="self.recording.value - self.baseline_volts().mean()",
        wrong="self.recording.value + self.baseline_volts().mean()",
        tests=CHECKS,
    ),
    Fault(
        name="volts times the sensitivity",
        file="kolsky/shot/records.py",
        right="volts / self.transducer.sensitivity",
        wrong="volts * self.transducer.sensitivity",
        tests=CHECKS,
    ),
    Fault(
        name="the window begins a frame after rest",
        file="kolsky/shot/load.py",
        right="frame_time[declared.frames.static - 1]",
        wrong="frame_time[declared.frames.static]",
        tests=CHECKS,
    ),
    Fault(
        name="a fifth of the frames may be beyond the force",
        file="kolsky/shot/load.py",
        right="UNCOVERED_SHARE = 0.05",
        wrong="UNCOVERED_SHARE = 0.2",
        tests=CHECKS,
    ),
    Fault(
        name="the frame at which symmetry ends is inside",
        file="kolsky/shot/load.py",
        right="frame_time >= symmetry_end",
        wrong="frame_time > symmetry_end",
        tests=CHECKS,
    ),
    Fault(
        name="a declared end need not be covered by all recordings",
        file="kolsky/shot/load.py",
        right="covered = min(",
        wrong="covered = max(",
        tests=CHECKS,
    ),
    Fault(
        name="a curve of four points",
        file="kolsky/shot/curve.py",
        right="SMALLEST_CURVE = 5",
        wrong="SMALLEST_CURVE = 4",
        tests=CHECKS,
    ),
    Fault(
        name="a stress against its strain is taken",
        file="kolsky/shot/curve.py",
        right="strain * stress < 0.0",
        wrong="strain * stress > np.inf",
        tests=CHECKS,
    ),
    Fault(
        name="a number that no contact law reads is taken",
        file="kolsky/schema/apparatus.py",
        right="if given and not needing:",
        wrong="if given and needing is None:",
        tests=CONTACT,
    ),
    Fault(
        name="a list half filled in taken for a blank",
        file="kolsky/base/toml.py",
        right="all(x == BLANK for x in content)",
        wrong="any(x == BLANK for x in content)",
        tests=NEW,
    ),
    Fault(
        name="blanks listed in another order than the file's",
        file="kolsky/schema/shot_file.py",
        right="key=lambda p: (p.line is None, p.line)",
        wrong="key=lambda p: (p.line is None, -(p.line or 0))",
        tests=NEW,
    ),
    Fault(
        name="the next shot keeps the last one's length",
        file="kolsky/survey/new_file.py",
        right='PER_SHOT = ("specimen.diameter", "specimen.length", "frames.static")',
        wrong='PER_SHOT = ("specimen.diameter", "frames.static")',
        tests=NEW,
    ),
    Fault(
        name="one of two files that could be the same taken",
        file="kolsky/survey/tables.py",
        right="for part, tables in parts.items() if len(tables) == 1}",
        wrong="for part, tables in parts.items()}",
        tests=NEW,
    ),
    Fault(
        name="the first of two channels of volts taken for the force",
        file="kolsky/survey/tables.py",
        right="return volts[0] if len(volts) == 1 else",
        wrong="return volts[0] if volts else",
        tests=NEW,
    ),
)
