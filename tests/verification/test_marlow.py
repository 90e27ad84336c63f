"""Marlow's law: closed forms, the limit at rest, energy and stress, extrapolation, and its Warp twin."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from order import assert_order, fitted_order
from scene import FloatArray

from explicit.device import select_device
from explicit.materials import MarlowLaw, marlow_from_curve, neo_hookean
from explicit.precision import precision

C1, C2, C3 = 13.4e3, 1.34e3, 0.268e3
"""Constants of a Yeoh solid W = C1 x + C2 x^2 + C3 x^3, x = I1_bar - 3 [Pa]."""
POINTS = (11, 21, 41, 81, 161)  # points of the sampled curve
DIFFERENCES = tuple(10.0 ** -np.arange(1, 11))  # relative steps of the central difference of the energy [-]


Result = SimpleNamespace


def yeoh_two_u_prime(x: FloatArray) -> FloatArray:
    """2 U' of the Yeoh solid at x = I1_bar - 3 [Pa]."""
    return 2.0 * (C1 + 2.0 * C2 * x + 3.0 * C3 * x**2)


def yeoh_stress(stretch: FloatArray) -> FloatArray:
    """Uniaxial nominal stress of the incompressible Yeoh solid [Pa]."""
    return yeoh_two_u_prime(stretch**2 + 2.0 / stretch - 3.0) * (stretch - stretch**-2)


def sampled_yeoh(n: int) -> MarlowLaw:
    """The law from `n` points in compression to 60 %, equally spaced in s."""
    s_last = float(np.sqrt(0.4**2 + 2.0 / 0.4 - 3.0))
    s = np.linspace(0.0, s_last, n + 1)[1:]
    stretch = np.array([_compressed(value) for value in s])
    return marlow_from_curve(stretch, yeoh_stress(stretch), n_knots=32 * n + 1)


def _compressed(s: float) -> float:
    """The root lam < 1 of lam^2 + 2 / lam = 3 + s^2."""
    roots = np.roots([1.0, 0.0, -(3.0 + s * s), 2.0])
    real = roots[np.abs(roots.imag) < 1e-9].real
    return float(real[(real > 0.0) & (real <= 1.0)].max())


def isochoric(gradient: FloatArray) -> FloatArray:
    """b_bar (rr, yy, ry, tt) of deformation gradients, shape [..., 3, 3] in the order r, y, theta."""
    b = gradient @ np.swapaxes(gradient, -1, -2)
    b = b * (np.linalg.det(gradient) ** (-2.0 / 3.0))[..., None, None]
    return np.stack([b[..., 0, 0], b[..., 1, 1], b[..., 0, 1], b[..., 2, 2]], axis=-1)


def random_gradients(n: int, size: float, seed: int) -> FloatArray:
    """Axisymmetric deformation gradients, shape [n, 3, 3]."""
    rng = np.random.default_rng(seed)
    gradient = np.zeros((n, 3, 3))
    gradient[:, :2, :2] = rng.uniform(-size, size, (n, 2, 2))
    gradient[:, 2, 2] = rng.uniform(-size, size, n)
    return gradient + np.eye(3)


def warp_twin(law: MarlowLaw, name: str, b_bar: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Stress, tangent bound and energy of the kernel functions, launched once per row of `b_bar`."""
    numbers = precision(name)
    device = select_device("cpu")
    stress, tangent, energy = law.kernel_functions(numbers)
    real, vec4 = numbers.real, numbers.vec4

    @wp.kernel(module="unique", enable_backward=False)
    def evaluate(
        b: wp.array(dtype=vec4),
        row: wp.array(dtype=real),
        tau: wp.array(dtype=vec4),
        bound: wp.array(dtype=real),
        stored: wp.array(dtype=real),
    ):
        i = wp.tid()
        tau[i] = stress(b[i][0], b[i][1], b[i][2], b[i][3], row)
        bound[i] = tangent(b[i][0], b[i][1], b[i][2], b[i][3], row)
        stored[i] = energy(b[i][0], b[i][1], b[i][2], b[i][3], row)

    n = len(b_bar)
    tau = wp.zeros(n, dtype=vec4, device=device)
    bound, stored = (wp.zeros(n, dtype=real, device=device) for _ in range(2))
    given = wp.array(b_bar.astype(numbers.dtype), dtype=vec4, device=device)
    table_row = wp.array(law.parameters(), dtype=real, device=device)
    wp.launch(evaluate, dim=n, inputs=[given, table_row, tau, bound, stored], device=device)
    return tau.numpy().astype(float), bound.numpy().astype(float), stored.numpy().astype(float)


def _difference_errors(law: MarlowLaw) -> FloatArray:
    """|central difference of U along delta F - tau : delta F F^-1|, relative, largest of 20 states."""
    gradient = random_gradients(20, 0.25, 3)
    direction = random_gradients(20, 1.0, 4) - np.eye(3)
    tau = law.stress(isochoric(gradient))
    full = np.zeros((20, 3, 3))
    full[:, 0, 0], full[:, 1, 1], full[:, 2, 2] = tau[:, 0], tau[:, 1], tau[:, 3]
    full[:, 0, 1] = full[:, 1, 0] = tau[:, 2]
    power = np.einsum("nij,nij->n", full, direction @ np.linalg.inv(gradient))
    errors = []
    for h in DIFFERENCES:
        ahead, behind = (law.energy(isochoric(gradient + sign * h * direction)) for sign in (1.0, -1.0))
        errors.append(np.abs((ahead - behind) / (2.0 * h) - power).max() / np.abs(power).max())
    return np.array(errors)


def _tangent_ratio(law: MarlowLaw) -> float:
    """Largest d2U/dt2 of F(t) = (1 + t a n) F over 2 tangent |a|^2 |n|^2, as the stable step uses it."""
    n, h = 4000, 1e-4  # truncation h^2 and round-off 1e-16 / h^2 are both 1e-8
    rng = np.random.default_rng(5)
    gradient = random_gradients(n, 0.35, 6)
    motion = np.zeros((n, 3, 3))
    a, b = rng.normal(size=(2, n, 2))
    a, b = a / np.linalg.norm(a, axis=1)[:, None], b / np.linalg.norm(b, axis=1)[:, None]
    motion[:, :2, :2] = a[:, :, None] * b[:, None, :]
    now, ahead, behind = (law.energy(isochoric((np.eye(3) + t * motion) @ gradient)) for t in (0.0, h, -h))
    curvature = (ahead - 2.0 * now + behind) / h**2
    _, bound, _ = warp_twin(law, "fp64", isochoric(gradient))
    return float((curvature / (2.0 * bound)).max())


@cache
def case() -> Result:
    """Evaluate the law against its closed forms."""
    mu = 2.0 * C1
    errors = []
    for stretch in (np.linspace(0.4, 0.98, 40), np.linspace(1.02, 3.0, 40)):
        law = marlow_from_curve(stretch, mu * (stretch - stretch**-2))
        s = np.linspace(0.0, 2.0 * law.last, 1000)
        errors.append(np.abs(law.two_u_prime(s) / mu - 1.0).max())

    rest = np.array([0.0, 1e-8, 1e-4])
    yeoh_error, origin_error = [], []
    for n in POINTS:
        law = sampled_yeoh(n)
        origin_error.append(np.abs(law.two_u_prime(rest) / mu - 1.0).max())
        s = np.linspace(0.4, law.last, 5001)
        yeoh_error.append(np.abs(law.two_u_prime(s) - yeoh_two_u_prime(s**2)).max() / mu)

    law = sampled_yeoh(41)
    stretch = np.array([_compressed(s) for s in np.linspace(0.0, law.last, 42)[1:]])
    state = np.zeros((41, 3, 3))
    state[:, 0, 0] = state[:, 2, 2] = stretch**-0.5
    state[:, 1, 1] = stretch
    tau = law.stress(isochoric(state))
    uniaxial = (tau[:, 1] - tau[:, 0]) / stretch  # the pressure makes the lateral stress vanish

    tiny = 1e-7 * law.last
    before, at, after = law.two_u_prime(law.last + np.array([-tiny, 0.0, tiny]))
    slopes = (at - before) / tiny, (after - at) / tiny

    b_bar = isochoric(random_gradients(500, 0.45, 7))
    b_bar[0] = [1.0, 1.0, 0.0, 1.0]
    twin = {}
    for name in ("fp64", "fp32"):
        tau_twin, _, energy_twin = warp_twin(law, name, b_bar)
        tau_numpy, energy_numpy = law.stress(b_bar), law.energy(b_bar)
        twin[name] = float(
            max(
                np.abs(tau_twin - tau_numpy).max() / np.abs(tau_numpy).max(),
                np.abs(energy_twin - energy_numpy).max() / np.abs(energy_numpy).max(),
            )
        )
    return Result(
        # Largest relative error of 2 U' built from a sampled neo-Hookean curve, both branches [-].
        neo_hookean_error=float(max(errors)),
        # Largest error of 2 U' for s in [0.4, last] over mu_0, by number of points [-], shape [n_points].
        yeoh_error=np.array(yeoh_error),
        yeoh_order=fitted_order(1.0 / np.array(POINTS), yeoh_error),  # fit against the distance of the points
        # Largest relative error of 2 U' against E_0 / 3 at s = 0, 1e-8 and 1e-4 [-], shape [n_points].
        origin_error=np.array(origin_error),
        # Largest relative error of the law's uniaxial nominal stress at the data, 41 points [-].
        uniaxial_error=float(np.abs(uniaxial / yeoh_stress(stretch) - 1.0).max()),
        # Error of the energy's central difference against the stress power, by step [-].
        difference_error=_difference_errors(law),
        # jump of 2 U' and of its slope across the last datum, relative [-]
        jump=(float(abs(after - before) / at), float(abs(slopes[1] / slopes[0] - 1.0))),
        # Largest relative difference of the Warp twin's stress and energy from NumPy's, by precision [-].
        twin=twin,
        # Largest curvature of the energy along a rank-one motion over the kernel's bound [-].
        tangent_ratio=max(_tangent_ratio(law), _tangent_ratio(neo_hookean(mu))),
    )


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    rows = [
        [str(n), f"{error:.1e}", f"{origin:.1e}"]
        for n, error, origin in zip(POINTS, result.yeoh_error, result.origin_error, strict=True)
    ]
    return locals()


def test_the_law_of_a_curve_has_its_values_slopes_and_limits() -> None:
    assert case().neo_hookean_error < 1e-13  # a constant quotient: round-off
    # The fit is a line in s^2 over s < 0.3; it leaves out 3 C3 s^4 / C1 <= 5e-4, a tenth reaches s = 0.
    assert case().origin_error[2] < 1e-4
    assert case().uniaxial_error < 1e-13  # knots on the data: round-off
    value, slope = case().jump
    assert value < 1e-6  # the slope times the probe of 1e-7
    assert slope < 1e-6  # round-off 1e-16 over the probe 1e-7, with a factor
    # The stable step relies on it; 1e-3 for the second difference's own error.
    assert case().tangent_ratio < 1.0 + 1e-3


def test_yeoh_curve_converges_with_the_number_of_points() -> None:
    result = case()
    assert result.yeoh_error[2] < 1e-5  # 41 points; third order from 2e-4 at 11
    # A monotone cubic is of third order where its slopes are limited by one-sided data, else better.
    assert_order(1.0 / np.array(POINTS), result.yeoh_error, 3.0, 0.2, at_least=True)


def test_stress_is_the_derivative_of_the_energy() -> None:
    error = case().difference_error
    best = int(np.argmin(error))
    assert error[best] < 1e-8  # eps^(2/3) = 4e-11 times the third derivative over the first
    assert_order(DIFFERENCES[:4], error[:4], 2.0, 0.05)  # truncation
    assert 2 < best < len(error) - 2
    assert_order(DIFFERENCES[-4:], error[-4:], -1.0, 0.3)  # round-off / h; scatter of the rounding


@pytest.mark.parametrize(("precision", "tolerance"), [("fp64", 1e-14), ("fp32", 2e-6)])
def test_warp_twin_is_the_numpy_law(precision: str, tolerance: float) -> None:
    assert case().twin[precision] < tolerance  # round-off of some twenty operations


def test_data_limit_is_the_largest_s_of_the_curve() -> None:
    stretch = np.linspace(0.5, 0.95, 10)
    law = marlow_from_curve(stretch, 1e4 * (stretch - stretch**-2))
    assert law.data_limit == pytest.approx(np.sqrt(0.25 + 4.0 - 3.0), rel=1e-14)


@pytest.mark.parametrize(
    ("stretch", "stress", "message"),
    [
        ([0.9, 0.8, 0.7, 0.6], [-1, -2, -3, -4], "at least 5 points"),
        ([0.9, 0.8, 1.1, 0.6, 0.5], [-1, -2, 1, -4, -5], "this one has both"),
        ([0.9, 0.8, 0.7, 0.6, 0.5], [-1, -2, 3, -4, -5], "sign of the other branch"),
        ([0.9, 0.8, 0.8, 0.6, 0.5], [-1, -2, -2, -4, -5], "repeated"),
        ([0.9, 0.8, 0.7, 0.6, -0.5], [-1, -2, -3, -4, -5], "stretch must be > 0, got -0.5"),
    ],
)
def test_impossible_curves_are_refused(stretch: list[float], stress: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        marlow_from_curve(np.array(stretch), 1e3 * np.array(stress))


@pytest.mark.parametrize("modulus", [0.0, -1.0, float("nan")])
def test_neo_hookean_needs_a_positive_modulus(modulus: float) -> None:
    with pytest.raises(ValueError, match="shear_modulus must be > 0 Pa"):
        neo_hookean(modulus)
