"""Faults of the full-field measurement: extensometers, grey noise, bias of curvature."""

from tests.mutants.fault import Fault

PARTS = ("tests/unit/dic/test_dic_full_field_parts.py",)
EXTENSOMETERS = "dic/full_field/measure.py"
CURVATURE = "dic/full_field/stereo.py"

FAULTS = (
    Fault(
        name="extensometer: the ends' noise taken for independent of the overlap",
        file=EXTENSOMETERS,
        right="return float(g @ rho @ g)",
        wrong="return float(g @ g)",
        tests=PARTS,
    ),
    Fault(
        name="extensometer: the reference's noise left out",
        file=EXTENSOMETERS,
        right="+ (n0[c] ** 2) * _variance",
        wrong="+ 0.0 * (n0[c] ** 2) * _variance",
        tests=PARTS,
    ),
    Fault(
        name="extensometer: strain over the present length",
        file=EXTENSOMETERS,
        right="strain[k] = elongation[k] / initial",
        wrong="strain[k] = elongation[k] / length[k]",
        tests=PARTS,
    ),
    Fault(
        name="extensometer: two points are enough for an end",
        file=EXTENSOMETERS,
        right="if used.sum() < FEWEST:",
        wrong="if used.sum() < 0:",
        tests=PARTS,
    ),
    Fault(
        name="grey noise: twice the variance that two pictures explain",
        file="dic/full_field/measure.py",
        right="np.maximum(1.0 - zncc, 0.0)",
        wrong="np.maximum(2.0 * (1.0 - zncc), 0.0)",
        tests=PARTS,
    ),
    Fault(
        name="curvature: a second order fitted where a first was matched",
        file=CURVATURE,
        right="if shape == Shape.QUADRATIC else []",
        wrong="if shape != Shape.RIGID else []",
        tests=PARTS,
    ),
    Fault(
        name="curvature: the bias added instead of taken off",
        file=CURVATURE,
        right="warp[..., :2] -= moved[..., 0]",
        wrong="warp[..., :2] += moved[..., 0]",
        tests=PARTS,
    ),
    Fault(
        name="curvature: the bias does not ride with the deformation",
        file=CURVATURE,
        right="moved = now @ (np.linalg.inv(start)",
        wrong="moved = start @ (np.linalg.inv(start)",
        tests=PARTS,
    ),
    Fault(
        name="curvature: pixels beside the mask counted",
        file=CURVATURE,
        right="known = np.asarray(np.isfinite(field).all(axis=2))",
        wrong="known = np.asarray(np.isfinite(field).all(axis=2)) | True",
        tests=PARTS,
    ),
)
