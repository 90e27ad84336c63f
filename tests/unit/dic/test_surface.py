"""The centre line against a barrelled cylinder whose outline is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from dic import PointOutcome, SurfaceHistory, centre_line

RADIUS, LENGTH = 4.75e-3, 6.5e-3
SIGMA = np.array([2e-6, 1e-6, 4e-6])


def outline(y, bulge):
    """Radius of the barrelled cylinder [m]: a parabola between the platens, `bulge` at mid-height."""
    return RADIUS + bulge * (1.0 - (2.0 * y / LENGTH - 1.0) ** 2)


def barrel(axis_x=0.0, axis_Z=0.0):
    """Three frames of a barrelling cylinder seen from Z over +-23 degrees: 13 angles x 9 heights."""
    t = np.array([0.0, 1e-4, 2e-4])
    bulge = np.array([0.0, 0.2e-3, 0.7e-3])
    angle, y = (a.ravel() for a in np.meshgrid(np.linspace(-0.4, 0.4, 13), np.linspace(0.5e-3, 6e-3, 9)))

    def place(b):
        r = outline(y, b)
        return np.stack([axis_x + r * np.sin(angle), y, axis_Z + r * np.cos(angle)], axis=-1)

    X = place(0.0)
    u = np.array([place(b) - X for b in bulge])
    outcome = np.zeros(u.shape[:2], dtype=np.int64)
    return SurfaceHistory(t=t, X=X, u=u, sigma=np.broadcast_to(SIGMA, u.shape), outcome=outcome), bulge


@pytest.mark.parametrize(("axis_x", "axis_Z"), [(0.0, 0.0), (0.3e-3, -1.2e-3)])
def test_every_point_of_the_strip_gives_the_true_radius(axis_x, axis_Z):
    surface, bulge = barrel(axis_x, axis_Z)
    line = centre_line(surface, half_width=0.5e-3, axis_x=axis_x, axis_Z=axis_Z)
    assert line.frame.size > 3 * 9  # more than the middle column alone
    np.testing.assert_allclose(line.Z, outline(line.y, bulge[line.frame]), rtol=1e-14)  # round-off
    np.testing.assert_array_equal(line.t, surface.t[line.frame])
    assert not line.left_out


def test_without_the_correction_the_strip_would_read_short():
    surface, bulge = barrel()
    half_width = 0.7e-3
    position = surface.position
    strip = np.abs(position[..., 0]) <= half_width
    frame, _ = np.nonzero(strip)
    short = outline(position[strip][:, 1], bulge[frame]) - position[strip][:, 2]
    expected = position[strip][:, 0] ** 2 / (2.0 * RADIUS)
    # the docstring's d^2/(2 r): r grows by 15 % and the next term is d^2/(4 r^2) = 0.5 %
    np.testing.assert_allclose(short, expected, rtol=0.16, atol=1e-17)
    assert short.max() > 10e-6  # worth correcting: more than the noise of a point


def test_the_strip_follows_the_current_position():
    surface, _ = barrel()
    line = centre_line(surface, half_width=0.65e-3)
    per_frame = np.bincount(line.frame)
    assert per_frame[0] > per_frame[2]  # barrelling carries points outward, out of the strip
    assert np.all(np.diff(line.frame) >= 0)
    for k in range(3):
        assert np.all(np.diff(line.y[line.frame == k]) >= 0.0)


def test_sigma_is_the_scatter_of_repeated_measurements():
    rng = np.random.default_rng(7)
    d, depth, n = 2.0e-3, 4.3e-3, 20_000
    noisy = np.array([d, 1e-3, depth]) + SIGMA * rng.standard_normal((1, n, 3))
    X = noisy[0]
    surface = SurfaceHistory(
        t=np.zeros(1),
        X=X,
        u=np.zeros((1, n, 3)),
        sigma=np.broadcast_to(SIGMA, (1, n, 3)),
        outcome=np.zeros((1, n), dtype=np.int64),
    )
    line = centre_line(surface, half_width=3e-3)
    # standard error of a standard deviation 1/sqrt(2 n) = 0.5 %, four of them
    assert np.mean(line.sigma) == pytest.approx(np.std(line.Z), rel=0.02)


def test_lost_points_are_left_out_and_counted():
    surface, bulge = barrel()
    outcome = surface.outcome.copy()
    u = surface.u.copy()
    centre = np.nonzero(np.abs(surface.X[:, 0]) < 1e-9)[0]
    outcome[2, centre[:4]] = PointOutcome.LOW_CORRELATION
    outcome[1, centre[0]] = PointOutcome.OUT_OF_VIEW
    outcome[1, 0] = PointOutcome.NOT_CONVERGED  # far from the strip: not its business
    u[outcome != PointOutcome.VALID] = np.nan
    line = centre_line(replace(surface, u=u, outcome=outcome), half_width=0.1e-3)
    np.testing.assert_array_equal(np.bincount(line.frame), [9, 8, 5])
    assert line.left_out == {PointOutcome.LOW_CORRELATION: 4, PointOutcome.OUT_OF_VIEW: 1}
    np.testing.assert_allclose(line.Z, outline(line.y, bulge[line.frame]), rtol=1e-14)  # round-off


def test_every_outcome_has_a_cause_and_a_cure():
    texts = [(o.cause, o.cure) for o in PointOutcome]
    assert all(cause and cure for cause, cure in texts)
    assert len(set(texts)) == len(PointOutcome)
    assert [o for o in PointOutcome if o.ok] == [PointOutcome.VALID]


def first_point_not_finite(s):
    u = s.u.copy()
    u[1, 5] = np.nan
    return {"u": u}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: {"X": s.X[:, :2]}, r"X has shape \(117, 2\), must be \(117, 3\)"),
        (lambda s: {"u": s.u[:2]}, r"u has shape \(2, 117, 3\)"),
        (lambda s: {"t": s.t[[0, 2, 1]]}, r"t must increase.*frame 2"),
        (lambda s: {"X": np.full_like(s.X, np.nan)}, "X must be finite"),
        (lambda s: {"outcome": s.outcome + 99}, "outcome 99 is none of"),
        (lambda s: {"sigma": s.sigma * 0.0}, "frame 0, point 0 is VALID"),
        (first_point_not_finite, "frame 1, point 5 is VALID"),
    ],
)
def test_inconsistent_surfaces_are_refused(change, message):
    surface, _ = barrel()
    with pytest.raises(ValueError, match=message):
        replace(surface, **change(surface))


@pytest.mark.parametrize("half_width", [0.0, -1e-3, np.nan])
def test_a_strip_without_width_is_refused(half_width):
    with pytest.raises(ValueError, match="half_width must be a positive length"):
        centre_line(barrel()[0], half_width=half_width)


def test_an_axis_in_front_of_the_surface_is_refused():
    with pytest.raises(ValueError, match="check axis_Z"):
        centre_line(barrel()[0], half_width=1e-3, axis_Z=20e-3)
