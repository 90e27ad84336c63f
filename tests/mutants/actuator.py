"""Faults in bends, in the pressure for a bend, in the closed loop and in markers."""

from tests.mutants.fault import Fault

_UNIT = "tests/unit/actuator"
_BEND, _LOOP, _MARKERS = (f"{_UNIT}/test_{name}.py" for name in ("bending", "control", "markers"))
_STUDY, _READING = f"{_UNIT}/test_study.py", f"{_UNIT}/test_actuator_reading.py"

FAULTS = (
    Fault(
        "compressibility read as a modulus",
        "kolsky/actuator/reading.py",
        "return 2.0 / value if modulus is None else 2.0 * value",
        "return 2.0 * value if modulus is None else 2.0 * value",
        (f"{_READING}::test_the_unit_says_which_d1_is_meant",),
    ),
    Fault(
        "bend with the wrong sign",
        "kolsky/actuator/model.py",
        "np.arctan2(-chord[..., BEND], chord[..., AXIS])",
        "np.arctan2(chord[..., BEND], chord[..., AXIS])",
        (f"{_BEND}::test_angle_of_an_arc_is_half_of_its_turn",),
    ),
    Fault(
        "slope of the bend with the wrong sign",
        "kolsky/actuator/model.py",
        "z / square, -x / square",
        "z / square, x / square",
        (f"{_BEND}::test_slope_of_the_angle_by_the_chord",),
    ),
    Fault(
        "Newton's step the wrong way",
        "kolsky/actuator/inverse.py",
        "self.pressure - (angle - self.wanted) / slope",
        "self.pressure + (angle - self.wanted) / slope",
        (f"{_BEND}::test_search_bisects_where_newton_would_leave_the_bracket",),
    ),
    Fault(
        "limit of the gain for one tick less",
        "kolsky/actuator/controller.py",
        "(2.0 * (2.0 * delay + 1.0))",
        "(2.0 * (2.0 * delay - 1.0))",
        (f"{_LOOP}::test_limit_of_the_gain",),
    ),
    Fault(
        "sum that grows at a bound",
        "kolsky/actuator/controller.py",
        "        if not outward:",
        "        if True:",
        (f"{_LOOP}::test_the_sum_does_not_grow_at_a_bound",),
    ),
    Fault(
        "gain taken twice",
        "kolsky/actuator/controller.py",
        "self.sum += self.gain * error",
        "self.sum += 2.0 * self.gain * error",
        (f"{_LOOP}::test_a_wrong_stiffness_is_learnt_geometrically",),
    ),
    Fault(
        "root mean square of coordinates in place of distances",
        "kolsky/actuator/marker_fit.py",
        ".sum(axis=1).mean()))",
        ".mean()))",
        (f"{_MARKERS}::test_rmse_is_that_of_the_distances",),
    ),
    Fault(
        "interval that a misfit does not widen",
        "kolsky/actuator/marker_fit.py",
        "sigma * max(1.0, np.sqrt(square / degrees))",
        "sigma * min(1.0, np.sqrt(square / degrees))",
        (f"{_MARKERS}::test_interval_of_a_line",),
    ),
    Fault(
        "interval of 90 %",
        "kolsky/actuator/marker_fit.py",
        "student.ppf(0.975, degrees)",
        "student.ppf(0.95, degrees)",
        (f"{_MARKERS}::test_interval_of_a_line",),
    ),
    Fault(
        "noise explains ten times as much",
        "kolsky/actuator/marker_fit.py",
        "return square <= float(chi2_law.ppf(EXPLAINED, self.measured.size))",
        "return square <= 10.0 * float(chi2_law.ppf(EXPLAINED, self.measured.size))",
        (f"{_MARKERS}::test_rmse_is_that_of_the_distances",),
    ),
    Fault(
        "largest gap in place of the smallest",
        "kolsky/actuator/gaps.py",
        'np.einsum("npd,nd->np", right - left, across).min(axis=1)',
        'np.einsum("npd,nd->np", right - left, across).max(axis=1)',
        (f"{_STUDY}::test_gap_is_the_distance_of_the_walls_and_negative_where_they_overlap",),
    ),
    Fault(
        "effect of healing with the weight's own bend",
        "kolsky/actuator/study.py",
        "(run.angle - run.angle[0] for run in (one.pristine, one.healed))",
        "(run.angle for run in (one.pristine, one.healed))",
        (f"{_STUDY}::test_effect_of_healing_is_that_on_the_bend_from_rest",),
    ),
    Fault(
        "faces that share an edge taken for one",
        "implicit/loads/surface.py",
        "keys.append(np.sort(nodes, axis=1))",
        "keys.append(np.sort(nodes, axis=1)[:, : element.dimension])",
        (f"{_UNIT}/test_actuator_geometry.py::test_faces_that_meet_in_an_edge_are_two",),
    ),
    Fault(
        "half of the curvature of the pressure left out",
        "implicit/reduction/model.py",
        "forces.append(a + B @ q + 0.5 * Cq @ q)",
        "forces.append(a + B @ q + Cq @ q)",
        ("tests/unit/implicit/test_reduction.py::test_reduced_loads_are_those_of_the_whole",),
    ),
    Fault(
        "trapezoidal rule with half of its inertia",
        "implicit/dynamics/inertia.py",
        "a = 4.0 / dt**2 * (u - before.u) - 4.0 / dt * before.v - before.a",
        "a = 2.0 / dt**2 * (u - before.u) - 4.0 / dt * before.v - before.a",
        ("tests/unit/implicit/test_dynamics.py::test_a_body_falls",),
    ),
    Fault(
        "relaxation without its half step",
        "implicit/dynamics/relaxation.py",
        "beta * np.exp(-0.5 * dt / tau)",
        "beta * np.exp(-1.0 * dt / tau)",
        ("tests/unit/implicit/test_dynamics.py::test_stress_relaxes_as_the_series_says",),
    ),
)
