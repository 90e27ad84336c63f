"""Strains on a surface against closed forms, and their sigmas against repeated noise."""

import numpy as np
import pytest

from dic import PointOutcome, SurfaceHistory
from dic.correlation.subsets import overlap_correlation
from dic.surfaces.strains import StrainGauge, StrainOutcome, strains

RADIUS, SCALE = 4.75e-3, 1.0 / 18e3  # 18 px/mm
NOISE = np.array([1e-6, 1e-6, 4e-6])
STEP, SUBSET = 5.0, 21.0
GAUGE = StrainGauge(window=5, step=STEP, subset=SUBSET)


def grid(columns=13, rows=11):
    x, y = np.meshgrid(40.0 + STEP * np.arange(columns), 40.0 + STEP * np.arange(rows))
    return np.stack([x.ravel(), y.ravel()], axis=-1)


def at_rest(points):
    """The cylinder's points under a grid of pixels; rows count down, y up."""
    x, y = (points[:, 0] - 70.0) * SCALE, (100.0 - points[:, 1]) * SCALE
    return np.stack([x, y, np.sqrt(RADIUS**2 - x**2)], axis=-1)


def history(X, positions, outcome=None):
    frames = len(positions)
    if outcome is None:
        outcome = np.zeros((frames, len(X)), dtype=np.int64)
    return SurfaceHistory(
        t=np.arange(float(frames)),
        X=X,
        u=np.where((outcome == 0)[..., None], positions - X, np.nan),
        sigma=np.broadcast_to(NOISE, (frames, len(X), 3)),
        outcome=outcome,
    )


def compressed(X, stretch):
    """Homogeneous compression of an incompressible body along y."""
    wide = stretch**-0.5
    return np.array([X * [b, a, b] for a, b in zip(stretch, wide, strict=True)])


STRETCH = np.array([1.0, 0.8, 0.5, 0.3])


@pytest.mark.parametrize("order", [1, 2])
def test_a_homogeneous_compression_has_its_closed_forms_at_every_point(order):
    points = grid()
    X = at_rest(points)
    gauge = StrainGauge(window=5, step=STEP, subset=SUBSET, order=order)
    found = strains(history(X, compressed(X, STRETCH)), points, gauge)
    assert (found.outcome == StrainOutcome.VALID).all()  # corners with one-sided windows too
    lam, wide = STRETCH[:, None], STRETCH[:, None] ** -0.5
    for strain, f in (
        (found.green_lagrange, lambda a: (a**2 - 1.0) / 2.0),
        (found.hencky, np.log),
        (found.nominal, lambda a: a - 1.0),
    ):
        # Around the axis the fibre in the tangent plane lies in x and Z, both of which stretch alike.
        # Linear in X, so a fit of any order has it exactly: round-off.
        np.testing.assert_allclose(strain.value[..., 0], f(wide) + 0.0 * X[:, 0], atol=1e-12)
        np.testing.assert_allclose(strain.value[..., 1], f(lam) + 0.0 * X[:, 0], atol=1e-12)
        np.testing.assert_allclose(strain.value[..., 2], 0.0, atol=1e-12)
    stretch, _ = found.principal_stretch
    np.testing.assert_allclose(stretch[1:, :, 1], lam[1:] + 0.0 * X[:, 0], atol=1e-12)


def test_simple_shear_and_rotation_have_their_closed_forms():
    points = grid()
    X = at_rest(points) * [1.0, 1.0, 0.0]  # a plane: tangents are x and y
    k, turn = 0.4, 0.7
    shear = np.array([[1.0, k, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    found = strains(history(X, np.array([X @ (R @ shear).T])), points, GAUGE)
    # E = (FᵀF - 1)/2 with F = 1 + k e_x e_y, whatever the rotation.
    np.testing.assert_allclose(found.green_lagrange.value - [0.0, k**2 / 2, k / 2], 0.0, atol=1e-12)
    stretch, _ = found.principal_stretch
    root = np.sqrt(1.0 + k**2 / 4.0)  # principal stretches of simple shear: root ± k/2
    np.testing.assert_allclose(stretch - [root + k / 2, root - k / 2], 0.0, atol=1e-12)
    # Hencky's tensor has the logarithms of these as eigenvalues.
    H = found.hencky.value[0, 0]
    logs = np.linalg.eigvalsh(np.array([[H[0], H[2]], [H[2], H[1]]]))
    np.testing.assert_allclose(logs, np.log([root - k / 2, root + k / 2]), atol=1e-12)
    angle, _ = found.principal_angle
    np.testing.assert_allclose(np.tan(2.0 * angle), -2.0 / k, atol=1e-9)  # tan 2φ = 2 C12 / (C11 - C22)


def test_a_barrelled_surface_is_off_by_the_second_order_of_the_gauge():
    points = grid()
    X = at_rest(points)
    r = 1.0 + 0.1 * (1.0 - ((X[:, 1] - 1.9e-3) / 1.9e-3) ** 2)
    places = X * np.stack([r, np.ones_like(r), r], axis=-1)
    interior = (np.abs(points - [70.0, 65.0]) <= [20.0, 15.0]).all(axis=1)  # full windows of both gauges
    error = []
    for window in (3, 5):
        found = strains(history(X, places[None]), points, StrainGauge(window, STEP, SUBSET))
        assert (found.share[0, interior] == 1.0).all()
        E = found.green_lagrange.value[0, interior, 0]
        error.append(np.mean((r[interior] ** 2 - 1.0) / 2.0 - E))
    # The gauge sees the mean of r over its rows: short by r''/2 times the mean square of their places,
    # 2/3 and 2 steps², and E by r times that; the rest is of second order of it.
    curvature = 0.2 / 1.9e-3**2
    expected = np.mean(r[interior]) * 0.5 * curvature * (STEP * SCALE) ** 2 * np.array([2.0 / 3.0, 2.0])
    np.testing.assert_allclose(error, expected, rtol=0.01)


def noisy(X, positions, points, rng):
    """The history with noise that overlapping subsets have in common."""
    rho = overlap_correlation(points, points, SUBSET) + 1e-10 * np.eye(len(points))
    white = rng.standard_normal(positions.shape)
    return history(X, positions + np.einsum("nm,fmi->fni", np.linalg.cholesky(rho), white) * NOISE)


def test_the_sigmas_of_strains_are_those_of_their_errors():
    points = grid(9, 9)
    X = at_rest(points)
    positions = np.repeat(compressed(X, np.array([0.8, 0.4])), 60, axis=0)  # 60 draws of each
    rng = np.random.default_rng(1)
    true = strains(history(X, positions), points, GAUGE)
    found = strains(noisy(X, positions, points, rng), points, GAUGE)
    for name in ("green_lagrange", "hencky", "nominal"):
        off = (getattr(found, name).value - getattr(true, name).value) / getattr(found, name).sigma
        for part in (off[:60], off[60:]):
            # 60 draws of fields whose gauges overlap over 9 x 9 points: about four independent places,
            # 240 values, each standard deviation known to 1/sqrt(480) = 4.6 %.
            assert part.std(axis=(0, 1)) == pytest.approx(np.ones(3), abs=0.15)
    (a, s), (b, _) = found.principal_stretch, true.principal_stretch
    assert ((a - b) / s).std(axis=(0, 1)) == pytest.approx(np.ones(2), abs=0.15)
    angle, sigma = found.principal_angle
    assert (angle / sigma).std() == pytest.approx(1.0, abs=0.15)


def test_noise_of_the_reference_counts_as_noise_of_the_frame_when_nothing_deforms():
    points = grid(7, 7)
    X = at_rest(points)
    surface = history(X, X[None])
    alone = strains(surface, points, GAUGE).green_lagrange.sigma
    both = strains(surface, points, GAUGE, reference_sigma=np.broadcast_to(NOISE, X.shape))
    np.testing.assert_allclose(both.green_lagrange.sigma, np.sqrt(2.0) * alone, rtol=1e-9)  # equal parts


def test_windows_do_not_reach_across_regions_and_lost_points_are_left_out():
    points = grid()
    X = at_rest(points)
    rows = ((points[:, 1] - 40.0) / STEP).astype(int)
    platen = rows < 3
    positions = compressed(X, np.array([0.5]))
    positions[0, platen] = X[platen] + [0.0, -1e-3, 0.0]  # rigid, and far from the specimen's motion
    outcome = np.zeros((1, len(X)), dtype=np.int64)
    outcome[0, 70] = PointOutcome.LOW_CORRELATION
    positions[0, 70] = 1.0  # what a lost point holds means nothing
    found = strains(history(X, positions, outcome), points, GAUGE, regions=platen)
    E = found.green_lagrange.value[0]
    lost = np.arange(len(X)) == 70
    np.testing.assert_allclose(E[platen], 0.0, atol=1e-12)
    # A lopsided window leans by a part of its angle on the cylinder, 0.1: here 0.02 at most.
    near = np.abs(points - points[70]).max(axis=1) <= 2 * STEP
    np.testing.assert_allclose(E[~platen & ~near, 1], (0.5**2 - 1.0) / 2.0, atol=1e-12)
    np.testing.assert_allclose(E[~platen & near & ~lost, 1], (0.5**2 - 1.0) / 2.0, rtol=0.02**2)
    assert found.outcome[0, 70] == StrainOutcome.POINT_LOST
    assert np.isnan(E[70]).all()
    assert (found.outcome[0, ~lost] == StrainOutcome.VALID).all()
    beside = np.abs(points - points[70]).max(axis=1) == STEP
    assert (found.share[0, beside & ~platen] < 1.0).all()
    first = np.flatnonzero(rows == 3)[10]  # the specimen's first row sees itself and two rows on
    assert found.centre[0, first] == pytest.approx([0.0, 1.0])


def test_too_few_neighbours_are_an_outcome():
    points = grid()
    X = at_rest(points)
    outcome = np.full((1, len(X)), int(PointOutcome.NOT_CONVERGED))
    outcome[0, :13] = PointOutcome.VALID  # a single row: nothing is known along y
    found = strains(history(X, X[None], outcome), points, GAUGE)
    assert (found.outcome[0, :13] == StrainOutcome.TOO_FEW_NEIGHBOURS).all()
    assert (found.outcome[0, 13:] == StrainOutcome.POINT_LOST).all()
    assert np.isnan(found.hencky.value).all()
    for member in StrainOutcome:
        assert member.ok == (member is StrainOutcome.VALID)
        assert member.cause
        assert member.cure


def test_the_gauge_has_its_declared_size_and_refuses_what_is_none():
    assert StrainGauge(window=5, step=5.0, subset=21.0).size == 41.0  # (5 - 1) 5 + 21
    for options in ({"window": 4}, {"window": 1}, {"step": 0.0}, {"order": 3}):
        with pytest.raises(ValueError, match="must be"):
            StrainGauge(**({"window": 5, "step": 5.0, "subset": 21.0} | options))
    X = at_rest(grid())
    with pytest.raises(ValueError, match="points has shape"):
        strains(history(X, X[None]), grid()[:-1], GAUGE)
