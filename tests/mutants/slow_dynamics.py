"""Faults of slow tests over time: holds, shift factors, the axis of moduli, healing, points of contact."""

from tests.mutants.fault import Fault

TEMPERATURE = "kolsky/material/relaxation/temperature.py"
HOLDS = "kolsky/material/uniaxial.py"
AXIS = "kolsky/studies/rate_dependence.py"
SCALES = "kolsky/material/relaxation/rate_fit.py"
POINTS = "kolsky/material/end_friction/compression.py"
HEALING = "kolsky/material/fits/properties.py"

SWEPT = "tests/unit/material/test_temperature.py"
HELD = "tests/unit/material/test_holds.py"
PLACED = "tests/unit/joint/test_slow_dynamics.py"
TOUCHED = ("tests/unit/material/test_contact_points.py",)

FAULTS = (
    Fault(
        "Eq. (V.5) with its sign lost",
        TEMPERATURE,
        "-C1 * difference / (C2 + difference)",
        "C1 * difference / (C2 + difference)",
        (f"{SWEPT}::test_the_law_by_hand",),
    ),
    Fault(
        "frequencies divided by the shift factor",
        TEMPERATURE,
        "10.0 ** self.adopted[self.sweep.level]",
        "10.0 ** -self.adopted[self.sweep.level]",
        (f"{SWEPT}::test_planted_constants_are_found",),
    ),
    Fault(
        "a shift of half a decade determined",
        TEMPERATURE,
        "UNDETERMINED = 0.5",
        "UNDETERMINED = 0.6",
        (f"{SWEPT}::test_verdicts_at_their_limits",),
    ),
    Fault(
        "curves apart taken for one",
        TEMPERATURE,
        "UNLIKELY = 0.01",
        "UNLIKELY = 0.001",
        (f"{SWEPT}::test_verdicts_at_their_limits",),
    ),
    Fault(
        "a law that does not hold adopted",
        TEMPERATURE,
        "self.determined and self.law_likely >= UNLIKELY",
        "self.determined",
        (f"{SWEPT}::test_verdicts_at_their_limits",),
    ),
    Fault(
        "temperatures of one level apart",
        TEMPERATURE,
        "SAME = 0.5",
        "SAME = 0.05",
        (f"{SWEPT}::test_temperatures_near_each_other_are_one_and_the_reference_is_measured",),
    ),
    Fault(
        "a hold of a tenth of its ramp unseen",
        HOLDS,
        "LONG = 0.05",
        "LONG = 0.1",
        (f"{HELD}::test_a_hold_is_five_per_cent_of_the_ramp",),
    ),
    Fault(
        "relaxed samples in the ramp",
        HOLDS,
        "slice(begin, reached + 1), hold",
        "slice(begin, end), hold",
        (f"{HELD}::test_a_ramp_ends_where_its_strain_is_reached",),
    ),
    Fault(
        "a relaxation of 1.5 % not told",
        HOLDS,
        "LOSS = 0.01",
        "LOSS = 0.02",
        (f"{HELD}::test_a_hold_without_relaxation_is_not_told",),
    ),
    Fault(
        "a shot as old as the shot's clock",
        AXIS,
        "duration=end - begin",
        "duration=end",
        (f"{PLACED}::test_a_shot_stands_at_half_its_duration_with_m_times_its_curves_modulus",),
    ),
    Fault(
        "a curve beyond what the shot reached",
        AXIS,
        "(size > 0.0) & (size <= largest * (1.0 + 1e-9))",
        "(size > 0.0)",
        (f"{PLACED}::test_a_shot_stands_at_half_its_duration_with_m_times_its_curves_modulus",),
    ),
    Fault(
        "noise of a held strain taken for unloading",
        SCALES,
        "SETBACK = 0.01",
        "SETBACK = 0.0",
        (f"{PLACED}::test_a_noisy_hold_has_an_age",),
    ),
    Fault(
        "constants fitted past the fracture",
        HEALING,
        "int(np.argmax(test.stress)) + 1 if broke is not None else test.stress.size",
        "test.stress.size",
        ("tests/unit/cli/test_healing_command.py::test_planted_groups",),
    ),
    Fault(
        "the side's area twice",
        POINTS,
        "np.pi * mesh.radius * length",
        "2.0 * np.pi * mesh.radius * length",
        TOUCHED,
    ),
    Fault(
        "a point's stiffness on one of its nodes",
        POINTS,
        "self.shape[:, first] * self.shape[:, second]",
        "self.shape[:, first]",
        TOUCHED,
    ),
)
