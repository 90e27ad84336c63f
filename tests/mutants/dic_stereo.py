"""Faults of two cameras: epipolar curve, match, triangulation, offsets, synchronisation."""

from tests.mutants.fault import Fault

GATES = ("tests/unit/dic/test_dic_gates.py",)
LENSES = ("tests/unit/dic/test_dic_triangulate.py::test_lenses_with_some_coefficients",)

FAULTS = (
    Fault(
        name="synchronisation: the upper of two middle values counted from the wrong end",
        file="dic/stereo/diagnose.py",
        right="(np.maximum(count - 1, 0) // 2, count // 2)",
        wrong="(np.maximum(count - 1, 0) // 2, np.maximum(count - 1, 0) // 2)",
        tests=(
            "tests/unit/dic/test_dic_speed_parts.py::test_medians_are_those_of_the_numbers_that_are_there",
        ),
    ),
    Fault(
        name="epipolar gate: a point's own noise narrows it",
        file="dic/stereo/reconstruction.py",
        right="allowed = np.maximum(gates[0],",
        wrong="allowed = np.minimum(gates[0],",
        tests=GATES,
    ),
    Fault(
        name="curve: the slopes of the best peak count as other places",
        file="dic/correlation/kernels/curve.py",
        right="while (left > 0 && profile[left - 1] < profile[left]) --left;",
        wrong="left = peak;",
        tests=("tests/unit/dic/test_dic_epipolar_search.py",),
    ),
    Fault(
        name="curve: its piece in the picture shut on the nearer side",
        file="dic/stereo/epipolar_search.py",
        right="high = np.minimum(high, -b / a)",
        wrong="high = np.minimum(high, b / a)",
        tests=("tests/unit/dic/test_dic_visible.py",),
    ),
    Fault(
        name="curve: its piece in the picture open on the farther side",
        file="dic/stereo/epipolar_search.py",
        right="low = np.maximum(low, -b / a)",
        wrong="low = np.maximum(low, b / a)",
        tests=("tests/unit/dic/test_dic_visible.py",),
    ),
    Fault(
        name="curve: a place behind camera 1 counts as seen",
        file="dic/stereo/epipolar_search.py",
        right="sides = [(e[2], v[:, 2])]",
        wrong="sides = [(0.0, v[:, 2])]",
        tests=("tests/unit/dic/test_dic_visible.py",),
    ),
    Fault(
        name="triangulation: camera 1 has the noise of camera 0",
        file="dic/stereo/geometry.py",
        right="inverse(noise[0] + EXACT * np.eye(2)), inverse(noise[1] + EXACT * np.eye(2))",
        wrong="inverse(noise[0] + EXACT * np.eye(2)), inverse(noise[0] + EXACT * np.eye(2))",
        tests=(
            "tests/unit/dic/test_dic_triangulate.py::test_noise_spreads_positions_and_epipolar_distances_as_predicted",
        ),
    ),
    Fault(
        name="reconstruction: the template's noise taken off instead of added",
        file="dic/stereo/reconstruction.py",
        right="met.covariance + along @ shared",
        wrong="met.covariance - along @ shared",
        tests=("tests/unit/dic/test_dic_reconstruct.py",),
    ),
    Fault(
        name="crop offset along the lines: told at a tenth of its standard deviation",
        file="dic/stereo/diagnose.py",
        right="np.abs(value) >= SURE * sigma) & (np.abs(value) >= LEAST_FAINT)",
        wrong="np.abs(value) >= 0.1 * sigma)",
        tests=("tests/unit/dic/test_dic_diagnose.py",),
    ),
    Fault(
        name="crop offset along the lines: never told",
        file="dic/stereo/diagnose.py",
        right="if sizes[1] > GONE * sizes[0]:",
        wrong="if sizes[1] < GONE * sizes[0]:",
        tests=("tests/unit/dic/test_dic_diagnose.py",),
    ),
    Fault(
        name="epipolar gates narrowed afterwards: a point beyond the smaller of two limits ends",
        file="dic/stereo/reconstruction.py",
        right="np.maximum(gate, gate_sigmas * found.epipolar_sigma)",
        wrong="np.minimum(gate, gate_sigmas * found.epipolar_sigma)",
        tests=("tests/unit/dic/test_dic_reconstruct.py",),
    ),
    Fault(
        name="lens: of a sixth power alone no term is left",
        file="dic/camera.py",
        right="if k2 or k3 else k1)",
        wrong="if k2 else k1)",
        tests=LENSES,
    ),
    Fault(
        name="slope of a pixel: focal lengths by columns",
        file="dic/stereo/geometry.py",
        right="np.array([[camera.fx], [camera.fy]])",
        wrong="np.array([[camera.fx, camera.fy]])",
        tests=LENSES,
    ),
)
