"""Faults of the pictures of a shot: frames, clocks, changes, outline, a subset that is refused."""

from tests.mutants.fault import Fault

CHECKS = ("tests/unit/shot/test_checks.py",)

FAULTS = (
    Fault(
        name="an even subset is proposed",
        file="kolsky/pictures/summary.py",
        right="across - 1 + across % 2",
        wrong="across",
        tests=("tests/unit/shot/test_flyer_refusal.py",),
    ),
    Fault(
        name="a subset that fits is made smaller",
        file="kolsky/pictures/summary.py",
        right="    if fitting >= subset:",
        wrong="    if False:",
        tests=("tests/unit/shot/test_flyer_refusal.py",),
    ),
    Fault(
        name="first motion at sixty sigmas",
        file="kolsky/pictures/frames.py",
        right="MOTION_SIGMAS = 6.0",
        wrong="MOTION_SIGMAS = 60.0",
        tests=CHECKS,
    ),
    Fault(
        name="rest counted from the first frame, not from the mean",
        file="kolsky/pictures/frames.py",
        right="flyer.displacement - flyer.displacement[:n_static][sound[:n_static]].mean()",
        wrong="flyer.displacement - flyer.displacement[0]",
        tests=CHECKS,
    ),
    Fault(
        name="a flyer that moves away is taken",
        file="kolsky/pictures/frames.py",
        right="if travel[row] < 0.0:",
        wrong="if travel[row] < -1.0:",
        tests=CHECKS,
    ),
    Fault(
        name="times agree within a whole digit",
        file="kolsky/pictures/frames.py",
        right="tolerance = 0.5 * (table.digit + frames.digit)",
        wrong="tolerance = 1.0 * (table.digit + frames.digit)",
        tests=CHECKS,
    ),
    Fault(
        name="the clock offset of the frames subtracted where the flyer must cover them",
        file="kolsky/pictures/frames.py",
        right="frames.time + toml.declared.frames.clock_offset > end",
        wrong="frames.time - toml.declared.frames.clock_offset > end",
        tests=CHECKS,
    ),
    Fault(
        name="the outline held against the diameter",
        file="kolsky/shot/outline.py",
        right="0.5 * toml.declared.specimen.diameter",
        wrong="1.0 * toml.declared.specimen.diameter",
        tests=CHECKS,
    ),
    Fault(
        name="the outline may be half of the radius off",
        file="kolsky/shot/outline.py",
        right="RADIUS_TOLERANCE = 0.2",
        wrong="RADIUS_TOLERANCE = 0.5",
        tests=CHECKS,
    ),
    Fault(
        name="a specimen ten times as long as its outline is taken",
        file="kolsky/shot/outline.py",
        right="LEAST_HEIGHT = 0.2",
        wrong="LEAST_HEIGHT = 0.02",
        tests=CHECKS,
    ),
    Fault(
        name="a radius of ten specimens is taken",
        file="kolsky/shot/outline.py",
        right="LARGEST_RADIUS = 3.0",
        wrong="LARGEST_RADIUS = 30.0",
        tests=CHECKS,
    ),
    Fault(
        name="points below the transmission platen are taken",
        file="kolsky/shot/outline.py",
        right="-0.1 * length, 1.1 * length",
        wrong="-1.0 * length, 1.1 * length",
        tests=CHECKS,
    ),
    Fault(
        name="a stray frame of the flyer keeps its weight",
        file="kolsky/pictures/frames.py",
        right="np.where(stray, np.abs(off), flyer.sigma)",
        wrong="flyer.sigma",
        tests=("tests/unit/shot/test_stray_frames.py",),
    ),
    Fault(
        name="a stray frame is told from four neighbours",
        file="kolsky/pictures/frames.py",
        right="NEIGHBOURS = 6",
        wrong="NEIGHBOURS = 4",
        tests=("tests/unit/shot/test_stray_frames.py",),
    ),
    Fault(
        name="a refused flyer: length and lower end added",
        file="kolsky/pictures/summary.py",
        right="float(np.hypot(length_sigma, lower))",
        wrong="float(length_sigma + lower)",
        tests=("tests/unit/shot/test_flyer_refusal.py",),
    ),
    Fault(
        name="a picture's change over the number of grey values, not over white",
        file="kolsky/pictures/picture_set.py",
        right="/ float(2**pictures.bits - 1)",
        wrong="/ float(2**pictures.bits)",
        tests=("tests/unit/shot/test_picture_changes.py",),
    ),
    Fault(
        name="rest ends one frame late on the page of a shot with pictures",
        file="kolsky/pictures/picture_set.py",
        right="rest_end=float(time[static - 1]),",
        wrong="rest_end=float(time[static]),",
        tests=("tests/unit/shot/test_picture_changes.py",),
    ),
    Fault(
        name="pictures taken for the test's whatever their number",
        file="kolsky/survey/pictures.py",
        right="test = _pair([one for one in series if one.count == count])",
        wrong="test = _pair([one for one in series if one.key == 'file'])",
        tests=("tests/unit/cli/test_new_from_pictures.py",),
    ),
)
