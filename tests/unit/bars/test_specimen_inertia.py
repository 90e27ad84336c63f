"""Inertia of body and specimen, and punching, against closed forms."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from barshots import bar_shot
from elastic_layer import ALUMINIUM, STEEL, Layer
from scipy.special import j0, j1, jn_zeros

from kolsky.bars.audit import CORRECTIONS, AuditLog, Switches
from kolsky.bars.records import ANALYSES, History, Quantity, Reduction
from kolsky.bars.reduction import inertia
from kolsky.bars.reduction.separation import face_waves
from kolsky.bars.reduction.stress_strain import correct_punching, punching_compliance, reduce
from kolsky.bars.reduction.validity import Reason
from kolsky.bars.reduction.windows import find_windows
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.errors import InputError
from kolsky.shot.bars import load_waves
from kolsky.shot.waves import waves

# Inertia against momentum, energy and travelling waves.

SPECIMEN = Specimen(diameter=9.5e-3, length=6.5e-3, density=870.0)
T = np.linspace(0.0, 1e-3, 4001)


def compression(t):
    """e, e', e'' of a smooth ramp to 60 %."""
    w = np.pi / 1e-3
    return 0.3 * (1 - np.cos(w * t)), 0.3 * w * np.sin(w * t), 0.3 * w**2 * np.cos(w * t)


def test_radial_pressure_does_the_work_of_the_radial_kinetic_energy():
    """Power of the mean pressure on the moving face = rate of change of the radial kinetic energy."""
    e, e1, e2 = compression(T)
    rho, a0, L = SPECIMEN.density, SPECIMEN.radius, SPECIMEN.length
    mass, area = rho * np.pi * a0**2 * L, np.pi * a0**2 / (1 - e)
    # v_r = r D / 2 with D = e' / (1 - e); the mean of r^2 over the disc is a^2 / 2.
    energy = 0.5 * mass * (a0**2 / (1 - e) / 2) * (e1 / (1 - e) / 2) ** 2
    power = inertia.radial_pressure(e, e1, e2, density=rho, radius=a0) * area * e1 * L
    rate = np.gradient(energy, T)
    inner = slice(2, -2)
    # Second-order differences of a cosine over 4000 steps: (w h)^2 / 6 ~ 1e-7 of the largest, and round-off.
    np.testing.assert_allclose(power[inner], rate[inner], atol=1e-5 * np.abs(rate).max())


def test_radial_pressure_at_the_start_is_kolskys_term():
    p = inertia.radial_pressure(0.0, 0.0, 1e7, density=870.0, radius=4.75e-3)
    assert p == pytest.approx(870.0 * 4.75e-3**2 / 8 * 1e7)
    with pytest.raises(ValueError, match="must be < 1"):
        inertia.radial_pressure(1.0, 0.0, 0.0, density=870.0, radius=4.75e-3)


def test_radial_correction_takes_the_pressure_on_the_grown_face_off_the_nominal_stress():
    e, e1, e2 = compression(T)
    stress = History(np.full_like(T, 1e5), np.full_like(T, 10.0), "Pa")
    given = [
        History(v, s * np.ones_like(T), u) for v, s, u in ((e, 1e-4, "1"), (e1, 1.0, "1/s"), (e2, 1e4, ""))
    ]
    found, log = inertia.correct_radial_inertia(stress, *given, SPECIMEN)
    p = inertia.radial_pressure(e, e1, e2, density=870.0, radius=SPECIMEN.radius)
    force = p * SPECIMEN.area / (1 - e)  # on the face as it is
    np.testing.assert_allclose(stress.value - found.value, force / SPECIMEN.area, rtol=1e-12)
    assert log.applied
    assert log.size == pytest.approx(float(np.abs(p / (1 - e)).max()))
    # Uncertainty against draws: 4000 of them know a sigma to 1.1 %; 5 % is beyond four of their deviations.
    rng, i = np.random.default_rng(1), 1500
    a, b, c = (h.value[i] + h.sigma[i] * rng.standard_normal(4000) for h in given)
    drawn = inertia.radial_pressure(a, b, c, density=870.0, radius=SPECIMEN.radius) / (1 - a)
    assert np.hypot(drawn.std(), 10.0) == pytest.approx(found.sigma[i], rel=0.05)
    left, off = inertia.correct_radial_inertia(stress, *given, SPECIMEN, apply=False)
    assert left is stress
    assert not off.applied
    assert off.size == log.size


def test_axial_stress_is_the_mean_over_layers():
    """Newton's law layer by layer, from the back face up."""
    n, e2, back = 2000, 4e6, 300.0
    rho, L = SPECIMEN.density, SPECIMEN.length
    y = (np.arange(n) + 0.5) * L / n
    momentum = np.cumsum(rho * (back + e2 * y) * L / n)  # above the back face, at each layer's top
    mean = np.mean(momentum) - 0.5 * rho * (back + e2 * L / 2) * L / n  # middle of each layer
    found = inertia.axial_stress(e2, density=rho, length=L, back_acceleration=back)
    assert found == pytest.approx(mean, rel=1e-6)  # midpoint rule: 1 / n^2
    second = History(np.full(3, e2), np.full(3, 1e5), "1/s^2")
    stress = History(np.zeros(3), np.ones(3), "Pa")
    corrected, log = inertia.correct_axial_inertia(stress, second, SPECIMEN)
    assert corrected.value[0] == pytest.approx(rho * L**2 * e2 / 6)
    assert corrected.sigma[0] == pytest.approx(np.hypot(1.0, rho * L**2 * 1e5 / 6))
    assert log.key == "axial inertia"


def test_a_mass_before_and_behind_the_specimen():
    t = np.linspace(0, 1e-4, 201)
    a = 5e4 * np.sin(2 * np.pi * t / 1e-4)
    force = 30.0 + 0.0071 * a
    mass = Quantity("platen", 0.0071, 2e-5, "kg", "B")
    gauge = History(force, np.full_like(t, 0.4), "N")
    moved = History(a, np.full_like(t, 200.0), "m/s^2")
    found, log = inertia.compensate_mass(gauge, moved, mass)
    np.testing.assert_allclose(found.value, 30.0, atol=1e-10)
    assert log.size == pytest.approx(0.0071 * 5e4, rel=1e-6)
    assert log.unit == "N"
    # Draws of mass, acceleration and noise where it is large; 4000 know sigma to 1.1 %.
    rng, i = np.random.default_rng(2), 50
    drawn = (
        force[i]
        + 0.4 * rng.standard_normal(4000)
        - (0.0071 + 2e-5 * rng.standard_normal(4000)) * (a[i] + 200.0 * rng.standard_normal(4000))
    )
    assert drawn.std() == pytest.approx(found.sigma[i], rel=0.05)
    off, log = inertia.compensate_mass(gauge, moved, mass, apply=False)
    assert off is gauge
    assert not log.applied
    assert log.size > 300.0


# Inertia of a specimen between bars, against closed forms of a constantly accelerated compression.

STEP, N = 1e-7, 2000
SPECIMEN_INERTIA_BAR = Bar(
    diameter=0.02, length=2.0, youngs_modulus=200e9, density=8000.0
)  # 4 us across: 41 samples
BARS = {"incident": SPECIMEN_INERTIA_BAR, "transmission": SPECIMEN_INERTIA_BAR}
RUBBER = Specimen(diameter=0.01, length=0.004, density=1000.0)
PULL, BACK = 5e6, 2e4
"""e'' [1/s^2] and the back face's acceleration [m/s^2]."""
AXIAL = 1000.0 * 0.004**2 * PULL / 12.0
"""What axial inertia takes from the mean of both faces' stresses: 6.7 kPa."""
INSIDE = slice(50, -50)
"""Beyond the ends of the averages."""


def reduction(stress: float = 1e6) -> Reduction:
    """e = e'' t^2 / 2, up to 0.1; the same stress at both faces."""
    t = STEP * np.arange(N)
    quiet = np.zeros(N)
    held = np.full(N, stress)

    def of(value: np.ndarray, unit: str, sigma: float = 0.0) -> dict[str, History]:
        history = History(value, np.full(N, sigma), unit)
        return dict.fromkeys(("one wave", "two waves", "three waves"), history)

    force = History(held * RUBBER.area, quiet, "N")
    return Reduction(
        time=t,
        strain=of(0.5 * PULL * t**2, "1"),
        rate=of(PULL * t, "1/s"),
        stress=of(held, "Pa", 1e3),
        front_force=force,
        back_force=force,
        front_velocity=History(PULL * t * RUBBER.length + BACK * t, quiet, "m/s"),
        back_velocity=History(BACK * t, quiet, "m/s"),
        imbalance=quiet,
        balanced=(0.0, float(t[-1])),
    )


def pressure() -> np.ndarray:
    """Kolsky's pressure at finite strain over the grown face, in nominal stress."""
    t = STEP * np.arange(N)
    e, e1 = 0.5 * PULL * t**2, PULL * t
    a0, left = 0.005, 1.0 - e
    return 1000.0 * a0**2 / 8.0 * (PULL / left**2 + 1.5 * e1**2 / left**3) / left


def test_the_motion_is_that_of_the_faces():
    motion = inertia.specimen_motion(reduction(), BARS)
    t = STEP * np.arange(N)
    np.testing.assert_allclose(motion.rate.value[INSIDE], (PULL * t)[INSIDE], rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(motion.second.value[INSIDE], PULL, rtol=1e-6)
    np.testing.assert_allclose(motion.back.value[INSIDE], BACK, rtol=1e-6)


def test_the_noise_of_the_second_derivative_is_that_of_two_means():
    """Of 20 000 white samples of 1 1/s, a central difference of means of 41 scatters by 1 / (41 step)."""
    noise = np.random.default_rng(2).standard_normal(20_000)
    one = History(noise, np.ones(noise.size), "1/s")
    long = replace(
        reduction(),
        time=STEP * np.arange(noise.size),
        rate={"three waves": one},
        back_velocity=History(noise, np.ones(noise.size), "m/s"),
    )
    motion = inertia.specimen_motion(long, BARS)
    assert motion.second.sigma[0] == pytest.approx(1.0 / (41 * STEP), rel=1e-12)
    assert motion.second.value[50:-50].std() == pytest.approx(motion.second.sigma[0], rel=0.05)
    assert motion.rate.value[50:-50].std() == pytest.approx(motion.rate.sigma[0], rel=0.1)


def test_axial_inertia_is_the_momentum_of_the_layers():
    """Force at the height Y is the back one plus what lies below it times its acceleration; mean over Y."""
    Y = np.linspace(0.0, RUBBER.length, 2001)
    force = 1000.0 * (BACK * Y + 0.5 * PULL * Y**2)  # above the back face, per area
    mean, front = np.trapezoid(force, Y) / RUBBER.length, force[-1]
    found = inertia.axial_by_analysis(PULL, RUBBER, BACK)
    assert found["one wave"] == pytest.approx(mean, rel=1e-6)
    assert found["two waves"] == pytest.approx(mean - front, rel=1e-6)
    assert found["three waves"] == pytest.approx(mean - 0.5 * front, rel=1e-5)
    assert found["three waves"] == pytest.approx(-AXIAL, rel=1e-12)


@pytest.mark.parametrize("key", ["radial inertia", "axial inertia"])
@pytest.mark.parametrize("way", ["one wave", "two waves", "three waves"])
def test_what_is_on_acts_on_every_analysis(key, way):
    plain = reduction()
    found, log = inertia.correct_inertia(plain, RUBBER, BARS, {key: "on, as the shot states"})
    wanted = (
        -pressure()
        if key == "radial inertia"
        else np.full(N, inertia.axial_by_analysis(PULL, RUBBER, BACK)[way])
    )
    change = found.stress[way].value - plain.stress[way].value
    np.testing.assert_allclose(change[INSIDE], wanted[INSIDE], rtol=1e-5)
    assert {entry.key: entry.applied for entry in log} == {
        name: name == key for name in ("radial inertia", "axial inertia")
    }
    same, _ = inertia.correct_inertia(plain, RUBBER, BARS, {key: "off by default"})
    assert same is plain


def test_a_specimen_is_soft_from_the_limit_on():
    """Radial pressure up to 28.6 kPa at the end, where the means end, and 6.7 kPa of axial inertia."""
    top = float(pressure()[-21]) + AXIAL
    just, hard = reduction(top / 0.055), reduction(top / 0.045)
    assert inertia.inertial_share(just, RUBBER, BARS) == pytest.approx(0.055, rel=0.02)
    for given, on in ((just, True), (hard, False)):
        acts = inertia.corrections_that_act(given, RUBBER, BARS, Switches(), share=0.05)
        assert acts["radial inertia"].startswith("on: the specimen is soft" if on else "off by default")
        assert acts["axial inertia"].startswith("off by default")
    stated = Switches({"radial inertia": False, "axial inertia": True})
    acts = inertia.corrections_that_act(just, RUBBER, BARS, stated, share=0.05)
    assert [acts[key].split(",")[0] for key in acts] == ["off", "on"]


def test_the_valid_span_ends_where_inertia_begins_to_count():
    given, added = reduction(1e6), pressure() + AXIAL
    limit = 0.03
    span = inertia.valid_span(given, RUBBER, BARS, share=limit, tension=False)
    assert span.window is not None
    ends = STEP * int(np.argmax(added > limit * 1e6))
    assert span.window[1] == pytest.approx(ends, abs=4e-6)  # intervals of 4 us
    assert span.end_reason is Reason.INERTIA


def test_a_pulled_specimen_has_the_same_span():
    given = reduction(1e6)

    def turned(history: History) -> History:
        return replace(history, value=-history.value)

    pulled = replace(
        given,
        strain={k: turned(h) for k, h in given.strain.items()},
        rate={k: turned(h) for k, h in given.rate.items()},
        stress={k: turned(h) for k, h in given.stress.items()},
        front_force=turned(given.front_force),
        back_force=turned(given.back_force),
        back_velocity=turned(given.back_velocity),
    )
    span = inertia.valid_span(pulled, RUBBER, BARS, share=0.05, tension=True)
    assert span.window is not None
    assert span.strain[1] > 0.0


def test_every_correction_is_in_the_log(tmp_path):
    """Applied or left out, each with its reason; a heavy specimen gets radial inertia unasked."""
    result = waves(bar_shot(tmp_path / "shot", density=20000.0, more='specimen_density = "2 %"'))
    assert {entry.key for entry in result.corrections} == set(CORRECTIONS)
    log = {entry.key: entry for entry in result.corrections}
    assert log["radial inertia"].applied
    assert "the specimen is soft" in log["radial inertia"].reason
    assert not log["mass"].applied
    assert "carried to the face with the inertia of the bar" in log["mass"].reason
    assert "inertia" in result.validity
    assert result.valid is not None
    rows = {row.quantity.name: row for row in result.budget.contributions}
    assert rows["specimen, density"].quantity.sigma == pytest.approx(400.0)
    assert rows["specimen, density"].shares["peak stress"] > 0.0


@pytest.mark.parametrize(
    ("key", "named"),
    [
        ("mass = true", "nothing lies between a bar's face and the specimen"),
        ("droop = true", "a strain gauge does not discharge"),
        ("separation = true", r"add \[gauges.incident_far\]"),
    ],
)
def test_what_cannot_act_is_refused(tmp_path, key, named):
    folder = bar_shot(tmp_path / "shot", corrections=key)
    with pytest.raises(InputError, match=named):
        load_waves(folder)
    off = bar_shot(tmp_path / "off", corrections=key.replace("true", "false"))
    assert load_waves(off).switches[key.split()[0]] is False


def test_the_log_is_completed_by_what_has_no_entry():
    log = AuditLog()
    log.compare("x", "punching", np.zeros(1), np.ones(1), applied=True, unit="1", reason="made up")
    log.complete({"punching": "is there", "mass": "no mass"})
    assert [(entry.key, entry.applied, entry.reason) for entry in log.corrections] == [
        ("punching", True, "made up"),
        ("mass", False, "no mass"),
    ]


# Punching: limits in closed form, the size of the correction, and unchanged quantities.


def spreading(ratio, terms=4000):
    """Mean sinking of a bar whose side slides in a rigid sleeve, in (1 - nu^2) F / (E a): a Dini series.

    The half-space's response 2 (1 - nu^2) / (E k) to a pressure J0(k r), with J1(k b) = 0, which is the
    series of a constriction's thermal resistance.
    """
    k = jn_zeros(1, terms)
    return 8 * np.sum(j1(k * ratio) ** 2 / (k**3 * j0(k) ** 2)) / (pi * ratio)


def in_half_space_units(ratio, bar=STEEL):
    a = ratio * bar.diameter / 2
    return punching_compliance(bar, a) * bar.youngs_modulus * a / (1 - bar.poisson**2)


def test_a_small_specimen_sinks_as_into_a_half_space():
    """Love: the mean under an even pressure over a circle on a half-space is 16 / (3 pi^2)."""
    near, nearer = in_half_space_units(0.02), in_half_space_units(0.01)
    assert 2 * nearer - near == pytest.approx(16 / (3 * pi**2), rel=1e-3)  # what is left is of order ratio^2


@pytest.mark.parametrize("ratio", [0.1, 0.3, 0.5, 0.7, 0.9])
def test_a_free_side_gives_way_more_than_a_sleeve(ratio):
    """By 1 % of it for a small specimen, whose field the side hardly sees, up to a third near the edge."""
    more = in_half_space_units(ratio) / spreading(ratio)
    assert 1.0 < more < 1.0 + 0.2 * ratio + 0.25 * ratio**4


def test_a_specimen_as_wide_as_the_bar_does_not_punch():
    assert punching_compliance(STEEL, STEEL.diameter / 2) == 0.0


@pytest.mark.parametrize("radius", [0.0, -1e-3, 0.008, float("nan")])
def test_a_radius_outside_its_range_is_refused(radius):
    with pytest.raises(ValueError, match=r"must be > 0 and not exceed the bar's, 0\.0075 m"):
        punching_compliance(STEEL, radius)


def reduction_of(scene):
    first, second = scene.signals()
    faces = face_waves(first, second, find_windows(first, second))
    return reduce(faces, scene.specimen)


def test_the_correction_makes_the_specimen_stiffer_by_both_faces():
    scene = Layer(first=ALUMINIUM, gauges=(0.7, 0.5))
    r = reduction_of(scene)
    bars = (scene.first, scene.second)
    corrected, entry = correct_punching(r, scene.specimen, *bars)
    c1, c2 = (punching_compliance(bar, scene.specimen.radius) for bar in bars)
    both = c1 * r.front_force.value + c2 * r.back_force.value
    change = r.strain["three waves"].value - corrected.strain["three waves"].value
    np.testing.assert_allclose(change * scene.specimen.length, both, atol=1e-15)
    assert entry.size == pytest.approx(np.abs(change).max())
    assert entry.applied
    assert entry.key == "punching"
    for key in ANALYSES:
        assert corrected.stress[key] is r.stress[key]
        # The rate's correction integrates to the strain's, but for the averaging over 3.5 us at the end.
        step = r.time[1] - r.time[0]
        lost = np.sum(r.rate[key].value - corrected.rate[key].value) * step
        drop = r.strain[key].value - corrected.strain[key].value
        assert lost == pytest.approx(drop[-1], abs=0.02 * np.abs(drop).max())


def test_left_out_it_is_listed_with_its_size():
    scene = Layer()
    r = reduction_of(scene)
    same, entry = correct_punching(r, scene.specimen, scene.first, scene.second, apply=False)
    assert same is r
    assert not entry.applied
    assert "would shorten" in entry.reason
    assert entry.size == correct_punching(r, scene.specimen, scene.first, scene.second)[1].size > 0


def test_sigmas_grow_by_the_forces_noise():
    """Scatter of the corrected rate over 300 noisy records against the sigma that is said."""
    scene = Layer(hold=40e-6)
    clean = scene.signals()
    windows = find_windows(*clean)
    rng = np.random.default_rng(2)
    rates = []
    for _ in range(300):
        noisy = [
            replace(
                s,
                strain=replace(
                    s.strain, value=s.strain.value + 8e-6 * rng.normal(size=s.strain.value.size), sigma=8e-6
                ),
            )
            for s in clean
        ]
        r = reduce(face_waves(*noisy, windows), scene.specimen)
        corrected, _ = correct_punching(r, scene.specimen, scene.first, scene.second)
        rates.append((corrected.rate["three waves"].value - r.rate["three waves"].value)[500])
    said = np.sqrt(corrected.rate["three waves"].sigma[500] ** 2 - r.rate["three waves"].sigma[500] ** 2)
    assert np.std(rates) == pytest.approx(said, rel=0.15)  # 4 % scatter of a standard deviation of 300
