"""Requirements of every contact law, and comparison of the two stress-dependent laws with closed forms."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray

from explicit import CharacteristicBar, Model, MovingSupport, PlatenMotion, Samples, Sampling, cylinder, run
from explicit.contact import CONTACT_LAWS, contact_law
from explicit.contact.base import FREE, RELEASED, TOUCHED, touch_struct
from explicit.device import select_device
from explicit.materials import neo_hookean
from explicit.precision import PRECISIONS

N = 400
LAWS = pytest.mark.parametrize("name", CONTACT_LAWS)


@cache
def kernel(name: str, precision: str) -> Any:
    numbers = PRECISIONS[precision]
    real, Touch = numbers.real, touch_struct(numbers)
    resolve = contact_law(name).kernel_function(numbers)

    @wp.kernel(module="unique", enable_backward=False)
    def resolved(
        touches: wp.array(dtype=Touch),
        v: wp.array2d(dtype=real),
        held: wp.array(dtype=int),
        slip: wp.array(dtype=real),
    ):
        i = wp.tid()
        velocity, mark, moved = resolve(touches[i])
        v[i, 0] = velocity[0]
        v[i, 1] = velocity[1]
        held[i] = mark
        slip[i] = moved

    return resolved


def touches(precision: str = "fp64", **change: Any) -> NDArray[Any]:
    """Nodes that press and nodes that leave, on either platen, with every memory."""
    rng = np.random.default_rng(3)
    made = np.zeros(N, dtype=touch_struct(PRECISIONS[precision]).numpy_dtype())
    values = {
        "v_r": rng.normal(0.0, 1.0, N), "v_y": rng.normal(0.0, 1.0, N), "target": rng.normal(0.0, 0.5, N),
        "normal": rng.choice([1.0, -1.0], N), "status": rng.choice([FREE, TOUCHED, RELEASED], N),
        "friction": rng.choice([0.0, 0.3, 2.0], N), "release_stress": rng.choice([0.0, 4e4, np.inf], N),
        "stiffness": 10.0 ** rng.uniform(9.0, 14.0, N), "density": rng.uniform(0.1, 0.3, N),
        "interval": rng.uniform(1e-6, 4e-6, N), "step": rng.uniform(1e-6, 4e-6, N),
    }  # fmt: skip
    for field, value in (values | change).items():
        made[field] = value
    return made


def resolve(name: str, made: NDArray[Any], precision: str = "fp64") -> tuple[NDArray[Any], ...]:
    """Impulses over mass (radial, away from the platen), velocity away from the platen, memory and slip."""
    numbers, where = PRECISIONS[precision], select_device("cpu")
    v = wp.zeros((N, 2), dtype=numbers.real, device=where)
    held, slip = wp.zeros(N, dtype=int, device=where), wp.zeros(N, dtype=numbers.real, device=where)
    given = wp.array(made, dtype=touch_struct(numbers), device=where)
    wp.launch(kernel(name, precision), N, [given, v, held, slip], device=where)
    new = v.numpy()
    push = made["normal"] * (new[:, 1] - made["v_y"])
    away = made["normal"] * (new[:, 1] - made["target"])
    return new[:, 0] - made["v_r"], push, away, held.numpy(), slip.numpy()


def pressed(made: NDArray[Any]) -> NDArray[np.bool_]:
    return np.asarray(made["normal"] * (made["v_y"] - made["target"]) < 0.0)


@LAWS
def test_a_pressed_node_ends_on_the_platen(name: str) -> None:
    made = touches()
    _, push, away, _, _ = resolve(name, made)
    press = pressed(made)
    assert (push[press] > 0.0).all()
    if contact_law(name).needs_stiffness:
        # Pressure = stiffness x penetration, both at the end of the step.
        pressure = made["density"] * push / made["interval"]
        np.testing.assert_allclose(
            (made["stiffness"] * -away * made["step"])[press], pressure[press], rtol=1e-6
        )  # a difference of velocities that agree to ten digits where the stiffness is large
    else:
        assert (away[press] == 0.0).all()


@LAWS
def test_a_node_that_leaves_is_pulled_by_bonds_only(name: str) -> None:
    made = touches()
    rub, push, _, _, slip = resolve(name, made)
    leaves = ~pressed(made)
    if contact_law(name).carries_tension:
        assert (push[leaves & (made["status"] == TOUCHED)] < 0.0).any()
        leaves &= made["status"] != TOUCHED
    assert (push[leaves] == 0.0).all()
    assert (rub[leaves] == 0.0).all()
    assert (slip[leaves] == 0.0).all()


@LAWS
def test_friction_opposes_within_its_bound(name: str) -> None:
    made = touches()
    rub, push, _, _, _ = resolve(name, made)
    press = pressed(made)
    assert (rub * made["v_r"] <= 0.0).all()
    if not contact_law(name).slides:
        np.testing.assert_array_equal(rub[press], -made["v_r"][press])
    elif not contact_law(name).needs_friction:
        assert (rub == 0.0).all()
    else:
        # Round-off of the velocities' differences: 1e-15.
        assert (np.abs(rub) <= made["friction"] * push + 1e-15)[press].all()
        slides = press & (np.abs(rub) < 0.99 * np.abs(made["v_r"])) & (made["stiffness"] > 1e13)
        np.testing.assert_allclose(np.abs(rub)[slides], (made["friction"] * push)[slides], atol=1e-15)
        assert slides.sum() > 10


@LAWS
def test_memory_changes_by_letting_go_only(name: str) -> None:
    made = touches()
    _, _, _, held, _ = resolve(name, made)
    changed = held != made["status"]
    assert (made["status"][changed] == TOUCHED).all()
    assert (held[changed] == RELEASED).all()
    if not contact_law(name).needs_release_stress:
        assert not changed.any()


@LAWS
@pytest.mark.parametrize(
    ("field", "other", "attribute"),
    [
        ("friction", 0.1, "needs_friction"),
        ("release_stress", 1e4, "needs_release_stress"),
        ("stiffness", 3e10, "needs_stiffness"),
        ("slip", 1e-7, "remembers_slip"),
    ],
)
def test_a_law_reads_what_it_says_it_needs(name: str, field: str, other: float, attribute: str) -> None:
    # The outside asks the law, not its name: a shot file, a derivative, a page.
    values = resolve(name, touches())[:4], resolve(name, touches(**{field: other}))[:4]
    reads = any((a != b).any() for a, b in zip(*values, strict=True))
    assert reads == getattr(contact_law(name), attribute)


@LAWS
def test_a_law_pulls_if_and_only_if_it_says_so(name: str) -> None:
    _, push, _, _, _ = resolve(name, touches())
    assert bool((push < 0.0).any()) == contact_law(name).carries_tension


@LAWS
def test_single_precision_says_the_same(name: str) -> None:
    # Without ties: a decision that round-off can tip is left out by its distance.
    made = touches()
    clear = np.abs(made["v_y"] - made["target"]) > 1e-3
    stress = made["density"] * np.abs(made["v_y"] - made["target"]) / made["interval"]
    clear &= np.abs(stress - made["release_stress"]) > 1e-3 * stress
    for a, b in zip(resolve(name, made), resolve(name, touches("fp32"), "fp32"), strict=True):
        np.testing.assert_allclose(a[clear], b[clear], rtol=1e-4, atol=1e-5)  # 24 bits, sums of 1 m/s


def test_a_bond_breaks_at_its_tensile_stress_and_carries_less() -> None:
    made = touches(status=TOUCHED, release_stress=5e4)
    rub, push, away, held, _ = resolve("bonded_release", made)
    leaves = ~pressed(made)
    stress = made["density"] * made["normal"] * (made["v_y"] - made["target"]) / made["interval"]
    np.testing.assert_array_equal(held == RELEASED, leaves & (stress >= 5e4))  # and for good
    kept = leaves & (stress < 5e4)
    assert 10 < kept.sum() < leaves.sum() - 10
    assert (away[kept] == 0.0).all()
    np.testing.assert_array_equal(rub[kept], -made["v_r"][kept])
    assert (push[leaves & ~kept] == 0.0).all()


def test_elastic_slip_is_shear_over_stiffness_and_adds_up_while_it_sticks() -> None:
    before = np.random.default_rng(4).normal(0.0, 1e-9, N)
    made = touches(slip=before, friction=1e9, normal=1.0, target=1.0, v_y=0.0)  # pressed, never slides
    rub, _, _, _, slip = resolve("penalty", made)
    shear = -made["density"] * rub / made["interval"]
    np.testing.assert_allclose(shear, made["stiffness"] * slip, rtol=1e-6, atol=1e-6 * np.abs(shear).max())
    moved = (made["v_r"] + rub) * made["step"]
    np.testing.assert_allclose(slip, before + moved, rtol=0.0, atol=1e-12 * np.abs(made["step"]).max())


LENGTH, END = 6.5e-3, 0.8e-3
TIMES = np.linspace(0.0, END, 161)[1:]
KNOTS = 2049


def stroke(size: float) -> PlatenMotion:
    """A platen that moves smoothly by `size` [m]."""
    return PlatenMotion.sampled(
        lambda t: size * np.clip(t / END, 0, 1) ** 3 * (4.0 - 3.0 * np.clip(t / END, 0, 1)),
        lambda t: size / END * 12.0 * np.clip(t / END, 0, 1) ** 2 * (1.0 - np.clip(t / END, 0, 1)),
        start=0.0,
        end=END,
        n_knots=KNOTS,
    )


def model(flyer: float) -> Model:
    mesh = cylinder(4.75e-3, LENGTH, n_radial=6, n_axial=8)
    return Model(mesh, 870.0, (neo_hookean(27e3),), (stroke(flyer),))


def test_the_mirrored_test_has_the_mirrored_forces() -> None:
    """Which platen is called the flyer cannot matter: the specimen has a plane of symmetry."""
    stroked = 0.4 * LENGTH
    sampling = Sampling(TIMES, TIMES)
    one = run(model(stroked), Samples.of(poisson=0.495), sampling)
    still = replace(model(0.0), support=MovingSupport((stroke(stroked),)))
    other = run(still, Samples.of(poisson=0.495), sampling)
    assert one.completed.all()
    assert other.completed.all()
    scale = np.abs(one.force_flyer).max()
    # 1e-8: round-off of sums in another order, grown along a chain of some 1000 steps.
    np.testing.assert_allclose(other.force_transmission, one.force_flyer, rtol=0, atol=1e-8 * scale)
    np.testing.assert_allclose(other.force_flyer, one.force_transmission, rtol=0, atol=1e-8 * scale)
    assert other.energy.external[0, -1] == pytest.approx(one.energy.external[0, -1], rel=1e-7)


def test_a_batch_with_a_motion_for_each_sample() -> None:
    """The path that a bar's face took, prescribed, gives the bar's force, in a pack and alone."""
    samples = Samples.of(poisson=0.495, stiffness_factor=np.linspace(0.8, 1.2, 9))
    knots = np.linspace(0.0, END, KNOTS)
    on_bar = replace(model(0.25 * LENGTH), support=CharacteristicBar(impedance=200.0, round_trip=0.3e-3))
    bar = run(on_bar, samples, Sampling(TIMES, knots))
    motions = tuple(
        PlatenMotion(start=0.0, step=END / (KNOTS - 1), position=path, velocity=np.gradient(path, knots))
        for path in bar.surface_y[:, :, 0]
    )
    moved = run(replace(on_bar, support=MovingSupport(motions)), samples, Sampling(TIMES, TIMES))
    rigid = run(model(0.25 * LENGTH), samples, Sampling(TIMES, TIMES))
    # rms: a node that lands one step later makes a spike of one step.
    difference = np.sqrt(np.mean((moved.force_transmission - bar.force_transmission) ** 2, axis=1))
    effect = np.sqrt(np.mean((rigid.force_transmission - bar.force_transmission) ** 2, axis=1))
    assert (difference < 0.02 * effect).all()  # the path is a cubic between knots at half a time step
    assert (effect > 5e-3).all()  # [N], of some 1 N: what the bar does at all


def test_impossible_supports_are_refused() -> None:
    with pytest.raises(ValueError, match="got none"):
        MovingSupport(())
    with pytest.raises(ValueError, match="must start at"):
        replace(model(1e-3), support=MovingSupport((replace(stroke(1e-3), start=1e-3),)))
    sampling = Sampling(TIMES, TIMES)
    two = replace(model(1e-3), support=MovingSupport((stroke(1e-3), stroke(1e-3))))
    with pytest.raises(ValueError, match="one for each of 3 samples, got 2"):
        run(two, Samples.of(stiffness_factor=[1.0, 1.1, 1.2]), sampling)
    short = PlatenMotion(start=0.0, step=END, position=np.zeros(2), velocity=np.zeros(2))
    with pytest.raises(ValueError, match="equally many knots, with those of its support, got"):
        run(replace(model(1e-3), support=MovingSupport((short,))), Samples.of(), sampling)
