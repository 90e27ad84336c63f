"""Faults of errors that points and frames share: their size, their way to flyer, outline and answer."""

from tests.mutants.fault import Fault

FOUND = ("tests/unit/dic/test_dic_shared_error.py",)
PATTERNS = ("tests/unit/base/test_correlated.py",)
SHOT = ("tests/unit/shot/test_shared_errors.py",)
FLYER = ("tests/unit/bars/test_flyer.py",)
OBJECTIVE = ("tests/unit/inverse/test_objective.py",)
LATERAL = ("tests/unit/dic/test_dic_lateral.py",)
INPUTS = ("tests/unit/uncertainty/test_input_directions.py",)

FAULTS = (
    Fault(
        name="shared error: what the mean over time takes is not counted",
        file="dic/stereo/reconstruction.py",
        right="H = R - rows[:, None] - rows[None, :] + R.mean()",
        wrong="H = R - rows[:, None]",
        tests=FOUND,
    ),
    Fault(
        name="shared error: subsets that share pixels are compared",
        file="dic/stereo/reconstruction.py",
        right='"chebyshev") >= subset',
        wrong='"chebyshev") >= 0.0',
        tests=FOUND,
    ),
    Fault(
        name="shared error: the size is not freed of the mean over time",
        file="dic/stereo/reconstruction.py",
        right="sigma=float(np.sqrt(length[1] / share))",
        wrong="sigma=float(np.sqrt(length[1]))",
        tests=FOUND,
    ),
    Fault(
        name="shared error: continued to lengths that were not compared",
        file="dic/stereo/reconstruction.py",
        right="np.geomspace(distance.min(),",
        wrong="np.geomspace(0.3 * distance.min(),",
        tests=FOUND,
    ),
    Fault(
        name="patterns: what is left out is lost",
        file="kolsky/pictures/shared_errors.py",
        right="left = sigma**2 - float((found**2).sum(axis=0).mean())",
        wrong="left = 0.0 * sigma",
        tests=PATTERNS,
    ),
    Fault(
        name="patterns: the length once",
        file="kolsky/pictures/shared_errors.py",
        right="np.exp(-(((nodes[:, None] - nodes) / length) ** 2))",
        wrong="np.exp(-np.abs((nodes[:, None] - nodes) / length))",
        tests=PATTERNS,
    ),
    Fault(
        name="flyer: two cameras are as one",
        file="kolsky/pictures/shared_errors.py",
        right="sum(means) / len(means) ** 2",
        wrong="sum(means) / len(means)",
        tests=SHOT,
    ),
    Fault(
        name="offsets: static frames count as independent",
        file="kolsky/pictures/shared_errors.py",
        right="share *= mean_over_time(max(int(result.static.sum()), 1), errors.shared.memory)",
        wrong="share /= max(int(result.static.sum()), 1)",
        tests=SHOT,
    ),
    Fault(
        name="flyer path: the shared error does not fade",
        file="kolsky/bars/flyer/jerks.py",
        right="growth[:, 4, 4] = 1.0 - shared[1] ** 2",
        wrong="growth[:, 4, 4] = 1.0 - shared[1]",
        tests=FLYER,
    ),
    Fault(
        name="flyer path: whitening without the shared error",
        file="kolsky/bars/flyer/path.py",
        right="lower = cholesky(covariance + np.diag(s**2), lower=True)",
        wrong="lower = cholesky(np.diag(s**2), lower=True)",
        tests=FLYER,
    ),
    Fault(
        name="objective: errors in common carry the patterns' own error",
        file="kolsky/inverse/objective.py",
        right="return np.asarray(PATTERN_ERROR**2 * (self.front_noise**2).sum(axis=0))",
        wrong="return np.asarray(PATTERN_ERROR**2 * (self.common**2).sum(axis=0))",
        tests=OBJECTIVE,
    ),
    Fault(
        name="one camera: all frames count alike for the place across the axis",
        file="dic/bodies/axial_displacement.py",
        right="place = np.array([np.average(across[rows], axis=0, weights=weight[rows]) for rows in near])",
        wrong="place = np.array([np.average(across[rows], axis=0) for rows in near])",
        tests=LATERAL,
    ),
    Fault(
        name="one camera: the lateral velocity is taken as exact",
        file="dic/bodies/axial_displacement.py",
        right="np.abs(slope) + 2.0 * own",
        wrong="np.abs(slope)",
        tests=LATERAL,
    ),
    Fault(
        name="diameter: every shot's outline moves with it",
        file="kolsky/uncertainty/budgets.py",
        right="if shot.axis_by_radius:",
        wrong="if shot.specimen.diameter:",
        tests=("tests/unit/joint/test_declared_diameter.py",),
    ),
    Fault(
        name="diameter: the outline moves by the diameter",
        file="kolsky/uncertainty/input_changes.py",
        right="found[n_force:] -= 0.5 * step * diameter",
        wrong="found[n_force:] -= step * diameter",
        tests=INPUTS,
    ),
)
