"""Specifications of synthetic shots, their truth, and their signals."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import trapezoid

from explicit.relaxation import uniaxial_stress
from kolsky.base.errors import InputError
from kolsky.base.records import MaterialCurve
from kolsky.schema.apparatus import UncertaintySection
from kolsky.shot.load import load_shot
from kolsky.studies.budget.realisation import factors_of
from kolsky.virtual import instruments
from kolsky.virtual.instruments import free_outline, measure_curve, measure_outline, side_displacement
from kolsky.virtual.material import law_of
from kolsky.virtual.motion import Ramp, path_of, ramp_of
from kolsky.virtual.schema import MotionTable, Specification
from kolsky.virtual.shot_file import _uncertainty, declared_sizes, shot_tables, specification_of, yeoh_of
from kolsky.virtual.specification import Draw, Series, read_specification, stream
from kolsky.virtual.truth import KNOT, Job, SurfaceHistory, TruthError, middle, simulate_truths

# The truth of a synthetic shot: the flyer's motion, a tilting flyer, the exports of the measurement.

TINY = {"truth": {"mesh": [8, 11]}, "motion": {"compression": "12 %"}, "frames": {"rate": "60 kHz"}}


def specification(**tables: dict[str, Any]) -> Specification:
    merged = {**TINY, **tables}
    return Specification.model_validate(merged)


def test_ramp_reaches_its_compression_at_its_end() -> None:
    """Compression x length at the end, speed x (1 - slowdown) there, velocity the slope of the path."""
    motion = MotionTable.model_validate({"compression": "40 %", "slowdown": "30 %", "speed": "2 m/s"})
    ramp, end = ramp_of(motion, 6.5e-3)
    t = ramp.start + np.array([-1e-5, 0.0, end])
    assert ramp.displacement(t) == pytest.approx([0.0, 0.0, 0.4 * 6.5e-3], rel=1e-12)
    assert ramp.velocity(t) == pytest.approx([0.0, 0.0, 2.0 * 0.7], rel=1e-12)
    fine = ramp.start + np.linspace(0.0, end, 20_001)
    slope = np.gradient(ramp.displacement(fine), fine)
    assert slope[1:-1] == pytest.approx(ramp.velocity(fine)[1:-1], abs=2e-5)
    with pytest.raises(ValueError, match="which must be above 0"):
        ramp_of(MotionTable.model_validate({"compression": "2 %", "rise": "1 ms"}), 6.5e-3)


def test_frames_lie_about_the_start_by_their_phase() -> None:
    job = Job.of(specification(frames={"rate": "60 kHz", "static": 5, "phase": "40 %"}))
    assert (job.frames <= 0.0).sum() == 5
    assert job.frames[4] == pytest.approx(-0.4 / 60e3)
    assert job.end - 1.0 / 60e3 < job.frames[-1] <= job.end


def test_uniaxial_stress_of_known_laws() -> None:
    """Neo-Hooke: mu (lam - lam^-2). Ogden of one term: (2 mu / a)(lam^(a-1) - lam^(-a/2-1))."""
    lam = np.array([0.4, 0.8, 1.0, 1.3])
    neo = law_of("neo_hookean", {"mu": 7.0}, 25e3)
    assert uniaxial_stress(neo, lam) == pytest.approx(25e3 * (lam - lam**-2), abs=1e-9)
    ogden = law_of("ogden1", {"mu1": 1.0, "alpha1": 3.0}, 12e3)
    expected = 2 * 12e3 / 3.0 * (lam**2 - lam**-2.5)
    assert uniaxial_stress(ogden, lam) == pytest.approx(expected, abs=1e-9)
    with pytest.raises(ValueError, match="has the constants mu"):
        law_of("neo_hookean", {"C10": 1.0}, 25e3)


def test_curve_is_the_quasi_static_one_whatever_m() -> None:
    q = specification(
        material={"stiffness_factor": 2.0}, quasi_static={"sigma": "0 %"}, imperfections={"curve": "-5 %"}
    )
    strain, stress = measure_curve(q, shot=0)
    law = law_of(q.material.law, q.material.parameters, q.material.shear_modulus)
    assert stress == pytest.approx(0.95 * uniaxial_stress(law, 1.0 + strain), abs=1e-9)


def test_a_truth_of_both_elements_is_their_mean() -> None:
    """Forces, outline and the tilt of an off-centre specimen; the flyer's path is one."""
    kinds = ("fbar", "one_point", "middle")
    first, second, both = simulate_truths(
        [
            specification(truth={"mesh": [8, 11], "element": kind}, imperfections={"off_centre": "1 mm"})
            for kind in kinds
        ]
    )
    for name in ("transmitted", "incident"):
        ends = [getattr(one, name) for one in (first, second)]
        assert np.ptp(ends, axis=0).max() > 0.0
        assert getattr(both, name) == pytest.approx(np.mean(ends, axis=0), rel=1e-14)
    for name in ("r", "y", "tilt"):
        ends = [getattr(one.surface, name) for one in (first, second)]
        assert np.ptp(ends, axis=0).max() > 0.0
        assert getattr(both.surface, name) == pytest.approx(np.mean(ends, axis=0), rel=1e-14)
    for one in (first, second):
        assert np.array_equal(both.surface.displacement, one.surface.displacement)


def test_a_truth_of_both_elements_says_which_run_ended_early() -> None:
    lost = TruthError("gel: the simulation ended INVERTED")
    (reached,) = simulate_truths([specification()])
    assert middle([reached, lost]) is lost
    assert middle([lost, reached]) is lost


def test_tilt_moves_the_camera_side_and_leaves_the_force() -> None:
    """A pitch of theta at the end: what is seen of the flyer gains theta x its radius, the outline's last
    point on the flyer's side loses theta x the specimen's radius of height, forces keep their values."""
    right, wrong = simulate_truths([specification(), specification(imperfections={"tilt": "0.5 deg"})])
    theta = np.radians(0.5)
    assert np.array_equal(right.transmitted, wrong.transmitted)
    assert np.array_equal(right.incident, wrong.incident)
    gained = side_displacement(wrong) - side_displacement(right)
    share = right.surface.displacement / (0.12 * 6.5e-3)
    # The pitch is kept at knots 0.25 us apart and read between them.
    assert gained == pytest.approx(7.5e-3 * theta * share, abs=1e-10)
    height = right.surface.y[-1, -1] - wrong.surface.y[-1, -1]
    assert height == pytest.approx(4.75e-3 * theta * share[-1], abs=1e-9)


def test_off_centre_specimen_turns_the_flyer_back() -> None:
    """I theta(T) = -e int (T - t) F dt with I = m (3 R^2 + h^2) / 12; the outline comes nearer by e."""
    q = specification(imperfections={"off_centre": "0.2 mm"}, exports={"outline_sigma": "1e-9 m"})
    truth, right = simulate_truths([q, specification()])
    inertia = 0.026 * (3 * 7.5e-3**2 + 20e-3**2) / 12
    end = truth.surface.time[-1]
    before = truth.force_time <= end
    left = (end - truth.force_time) * truth.incident
    expected = -0.2e-3 / inertia * trapezoid(left[before], truth.force_time[before])
    # The last frame lies up to a knot past the last force before it.
    assert truth.surface.tilt[-1] == pytest.approx(expected, rel=2e-3)
    rest = measure_outline(q, truth, shot=0).Z[:14]
    assert rest == pytest.approx(4.75e-3 + 0.2e-3, abs=1e-8)
    assert np.array_equal(truth.transmitted, right.transmitted)


def test_partial_slip_is_true_and_not_declared() -> None:
    q = specification(imperfections={"slip_friction": 0.1})
    assert Job.of(q).contact == ("coulomb", "coulomb")
    assert Job.of(specification()).contact == ("bonded", "bonded")
    surface = SurfaceHistory(Job.of(q).frames, *[np.zeros(0)] * 4)
    assert shot_tables(q, surface)["interface"] == {"faces": "bonded", "side": "bonded"}


def test_a_batch_gives_each_shot_the_same_bits() -> None:
    one = specification()
    other = specification(material={"stiffness_factor": 1.2}, motion={"compression": "15 %"})
    alone, together = simulate_truths([one])[0], simulate_truths([other, one])[1]
    assert np.array_equal(alone.transmitted, together.transmitted)
    assert np.array_equal(alone.surface.r, together.surface.r)
    assert alone.force_time[1] - alone.force_time[0] == pytest.approx(KNOT)


def test_free_outline_leaves_out_what_lies_on_a_platen() -> None:
    y = np.array([[0.0, 0.0, 0.5, 1.0, 2.0, 3.0, 3.0]]) * 1e-3
    r = np.array([[4.0, 4.4, 5.0, 5.5, 5.6, 5.0, 4.7]]) * 1e-3
    surface = SurfaceHistory(np.zeros(1), r, y, np.zeros(1), np.zeros(1))
    height, radius = free_outline(surface, 0)
    assert height[0] == 0.0
    assert radius[0] == pytest.approx(4.4e-3)
    assert height[-1] == pytest.approx(3e-3)
    assert radius[-1] == pytest.approx(5.0e-3)
    assert (np.diff(height) > 0.0).all()


def test_a_ramp_that_slows_is_its_integral() -> None:
    ramp = Ramp(start=0.0, speed=3.0, rise=5e-5, slowdown=0.2, over=1e-3)
    t = np.linspace(0.0, 1.05e-3, 100_001)
    speed = ramp.velocity(t)
    path = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) * (t[1] - t[0])])
    assert ramp.displacement(t) == pytest.approx(path, abs=1e-11)
    assert speed[-1] == pytest.approx(3.0 * 0.8)


def test_a_sampled_motion_goes_through_its_samples(tmp_path: Path) -> None:
    t = np.linspace(0.0, 4e-4, 41)
    (tmp_path / "motion.csv").write_text(
        "time (s),displacement (m)\n" + "".join(f"{a + 1e-3:.9g},{2.0 * a**2 * 1e3 + 1e-3:.9g}\n" for a in t)
    )
    q = specification(motion={"kind": "sampled", "file": "motion.csv", "compression": "3 %"})
    path, end = path_of(q, tmp_path)
    assert path.displacement(q.motion.start + t) == pytest.approx(2e3 * t**2, abs=1e-10)
    assert path.velocity(q.motion.start + np.array([-1e-5, 2e-4])) == pytest.approx([0.0, 0.8], abs=1e-5)
    # 3 % of 6.5 mm, at the first sample that has it: 2000 t^2 = 0.195 mm at 0.3122 ms.
    assert end == pytest.approx(3.2e-4)


# A specification from a shot.


def test_yeoh_through_a_curve_of_its_own() -> None:
    """P = 2 (lam - lam^-2)(C10 + 2 C20 x + 3 C30 x^2) with x = I1 - 3 gives its constants back."""
    lam = np.linspace(1.0, 0.4, 40)
    x = lam**2 + 2.0 / lam - 3.0
    stress = 2.0 * (lam - lam**-2) * 12e3 * (1.0 + 2.0 * 0.1 * x + 3.0 * 0.02 * x**2)
    constants, modulus = yeoh_of(MaterialCurve(lam, stress, 0.01 * np.abs(stress)))
    assert modulus == pytest.approx(24e3, rel=1e-9)
    assert constants == pytest.approx({"C10": 1.0, "C20": 0.1, "C30": 0.02}, rel=1e-7)


def test_declared_uncertainties_become_sizes() -> None:
    given = {"specimen_length": 0.003, "damping": 5e-6, "poisson": 2e-4, "sensitivity": 0.0, "friction": 0.1}
    assert declared_sizes(given) == {
        "imperfections.length": "0.003",
        "imperfections.damping": "5e-06 s",
        "imperfections.poisson": 2e-4,
    }


def test_specification_of_open_01(tmp_path: Path) -> None:
    shot = load_shot(Path(__file__).parents[3] / "runs" / "open-01")
    made = specification_of(shot, tmp_path, answer={"stiffness_factor": 1.12})
    q = read_specification(made).shot(0).quantities
    assert q.specimen.length == pytest.approx(6.5e-3)
    assert q.material.stiffness_factor == 1.12
    # truth.json of the shot: 74 kPa / 3 and 1 : 0.1 : 0.02, here through a curve with 0.2 % of noise.
    assert q.material.shear_modulus == pytest.approx(74e3 / 3.0, rel=0.01)
    assert q.transmitted.noise == pytest.approx(1.64e-3, rel=0.05)
    assert q.frames.static == 12
    assert q.motion.kind == "sampled"


def test_lengths_have_metres_and_shares_none() -> None:
    given = {"length_in_pictures": 2e-6, "y_offset": 1e-6, "specimen_length": 1e-3, "poisson": 3e-4}
    written = _uncertainty(given)
    assert written == {
        "length_in_pictures": "2e-06 m",
        "y_offset": "1e-06 m",
        "specimen_length": "0.001",
        "poisson": 3e-4,
    }
    read = UncertaintySection.model_validate(written)
    assert read.length_in_pictures == 2e-6
    assert "length_in_pictures" not in read.for_identify()
    assert "length_in_pictures" not in read.for_waves()


# Random specifications: ranges, streams, and error messages.

HEAD = "format = 1\n[population]\nshots = {n}\n[population.draw]\n"
DRAWS = (
    '"specimen.diameter" = { low = "8 mm", high = "12 mm" }',
    '"material.stiffness_factor" = { low = 0.5, high = 2.0, spread = "log" }',
    '"scope.bits" = { low = 10, high = 14 }',
    '"imperfections.length" = { mean = "1 %", sigma = "0.5 %", spread = "normal" }',
    '"material" = { choose = [{ law = "neo_hookean", parameters = { mu = 1.0 } }, { poisson = 0.498 }] }',
)


def series(folder: Path, *draws: str, n: int = 400) -> Series:
    path = folder / "SPEC.toml"
    path.write_text(HEAD.format(n=n) + "\n".join(draws), encoding="utf-8")
    return read_specification(path)


def test_drawn_values_fill_their_ranges(tmp_path: Path) -> None:
    shots = [shot.quantities for shot in series(tmp_path, *DRAWS)]
    diameter = np.array([q.specimen.diameter for q in shots])
    factor = np.array([q.material.stiffness_factor for q in shots])
    length = np.array([q.imperfections.length for q in shots])
    assert 8e-3 <= diameter.min() < 8.1e-3
    assert 11.9e-3 < diameter.max() <= 12e-3
    # Of 400 draws a mean is known to sigma / 20; four of these.
    assert diameter.mean() == pytest.approx(10e-3, abs=4 * 4e-3 / np.sqrt(12) / 20)
    assert np.log(factor).mean() == pytest.approx(0.0, abs=4 * np.log(4.0) / np.sqrt(12) / 20)
    assert np.log(factor).std() == pytest.approx(np.log(4.0) / np.sqrt(12), rel=0.15)
    assert length.mean() == pytest.approx(0.01, abs=4 * 0.005 / 20)
    assert length.std() == pytest.approx(0.005, rel=0.15)
    assert {q.scope.bits for q in shots} == {10, 11, 12, 13, 14}
    assert {(q.material.law, q.material.poisson) for q in shots} == {("neo_hookean", 0.499), ("yeoh", 0.498)}


def test_a_shot_is_the_same_whatever_else_is_drawn(tmp_path: Path) -> None:
    few, many = series(tmp_path, DRAWS[0], n=3), series(tmp_path, *DRAWS, n=300)
    assert few.shot(2).quantities.specimen == many.shot(2).quantities.specimen
    assert few.shot(2).quantities.specimen != few.shot(3).quantities.specimen
    assert few.shot(2).name == "virtual-2"
    assert many.shot(2).name == "virtual-002"
    a, b = stream(1, 2, "noise", "flyer"), stream(1, 2, "noise", "outline")
    assert a.random() != b.random()
    assert stream(1, 2, "noise", "flyer").random() != stream(2, 2, "noise", "flyer").random()


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        ('"specimen.diameter" = { low = "8 mm", high = 12.0 }', "unit at one end only"),
        ('"specimen.diameter" = { low = "8 mm", high = "1.2 cm" }', "must be written alike"),
        ('"specimen.diameter" = { low = "12 mm", high = "8 mm" }', "not below low"),
        ('"scope.bits" = { low = 0, high = 3, spread = "log" }', "above 0"),
        ('"scope.bits" = { mean = 12 }', "is not a distribution"),
        ('"specimen.height" = { low = "8 mm", high = "9 mm" }', "is not a known key"),
        ('"name.first" = { low = 1, high = 2 }', "is not a table"),
        ('"material.poisson" = { low = 0.6, high = 0.7 }', r"\[0, 0.49999\]"),
    ],
)
def test_what_cannot_be_drawn_is_refused(tmp_path: Path, draw: str, message: str) -> None:
    text = '"name.first"' in draw
    with pytest.raises(InputError, match=message):
        series(tmp_path, draw) if not text else series_with_name(tmp_path, draw)


def series_with_name(folder: Path, draw: str) -> Series:
    path = folder / "SPEC.toml"
    path.write_text('name = "a"\n' + HEAD.format(n=2) + draw, encoding="utf-8")
    return read_specification(path)


def test_no_shot_beyond_the_population(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"has no shot 4; it must be in \[1, 3\]"):
        series(tmp_path, DRAWS[0], n=3).shot(4)


def test_a_draw_is_written_as_a_person_would() -> None:
    value = Draw(low="8 mm", high="12 mm").value(np.random.default_rng(1))
    number, unit = value.split(" ")
    assert unit == "mm"
    assert 8.0 <= float(number) <= 12.0
    assert len(number) <= 10


@pytest.mark.parametrize("name", ["forty", "small", "paper"])
def test_committed_specifications_are_valid(name: str) -> None:
    """Every shot of the committed populations can be asked for: what is drawn is allowed, its motion ends."""
    found = read_specification(Path(__file__).parents[3] / "runs" / "virtual" / f"{name}.toml")
    for shot in found:
        assert Job.of(shot.quantities, shot.folder).end > 0.0
    assert bool(found.declared.budget) == (name == "paper")  # the one that a budget is made of
    if found.declared.budget:  # and the noise, which every budget has
        assert len(factors_of(found.declared.budget)) == 1 + len(found.declared.budget)


# The chain from newtons to codes: each element is compared with its closed form.

STEP = 2.5e-7


def test_low_pass_follows_a_step_and_a_ramp() -> None:
    """A unit step's answer is 1 - exp(-t / tau), a ramp's a (t - tau + tau exp(-t / tau))."""
    frequency = 100e3
    tau = 1.0 / (2.0 * np.pi * frequency)
    t = STEP * np.arange(400)
    ramp = instruments.low_pass(3.0 * t, STEP, frequency)
    assert ramp == pytest.approx(3.0 * (t - tau + tau * np.exp(-t / tau)), abs=1e-15)
    # A step between two samples is a line of one step: the same answer, averaged over that step.
    step = instruments.low_pass(np.minimum(t / STEP, 1.0), STEP, frequency)
    assert step[1:] == pytest.approx(
        1.0 - tau / STEP * (1.0 - np.exp(-STEP / tau)) * np.exp(-(t[1:] - STEP) / tau), abs=1e-12
    )


def test_low_pass_has_minus_3_db_at_its_frequency() -> None:
    """The amplitude of a sine at the corner is 1 / sqrt 2 of what went in, its phase 45 degrees late."""
    frequency = 20e3
    t = STEP * np.arange(8000)
    out = instruments.low_pass(np.sin(2.0 * np.pi * frequency * t), STEP, frequency)[4000:]
    basis = np.column_stack(
        [np.sin(2.0 * np.pi * frequency * t[4000:]), np.cos(2.0 * np.pi * frequency * t[4000:])]
    )
    a, b = np.linalg.lstsq(basis, out, rcond=None)[0]
    # Lines between samples cut a sine by (omega h)^2 / 12 = 8e-5.
    assert np.hypot(a, b) == pytest.approx(np.sqrt(0.5), rel=2e-4)
    assert np.degrees(np.arctan2(b, a)) == pytest.approx(-45.0, abs=0.02)


def test_droop_of_a_constant_force_is_exponential() -> None:
    """A force that stays is seen to fall to 1/e in a time constant; its integral compensates it."""
    tau, t = 1e-3, STEP * np.arange(8001)
    force = np.minimum(t / STEP, 1.0)
    seen = instruments.droop(force, STEP, tau)
    # After the one step of rise the output is exp(-(t - STEP / 2) / tau) to (STEP / tau)^2.
    assert seen[1:] == pytest.approx(np.exp(-(t[1:] - 0.5 * STEP) / tau), abs=1e-7)
    assert seen[4000] == pytest.approx(np.exp(-1.0), rel=2e-4)
    regained = seen + np.concatenate([[0.0], np.cumsum(0.5 * (seen[1:] + seen[:-1])) * STEP]) / tau
    assert regained == pytest.approx(force, abs=1e-6)  # the trapezoid's error


def test_quantisation_noise_is_a_step_over_root_twelve() -> None:
    """A 12-bit recorder of 1 V full scale has codes 2 / 4096 V apart and that noise."""
    step = 2.0 / 4096
    assert instruments.code_step(1.0, 12) == step
    volts = np.linspace(-0.5, 0.5, 400_001)
    error = instruments.quantised(volts, 1.0, 12) - volts
    assert np.abs(error).max() <= 0.5 * step * (1.0 + 1e-9)
    assert error.std() == pytest.approx(step / np.sqrt(12.0), rel=1e-3)


def test_recorder_clips_at_its_first_and_last_code() -> None:
    """Codes run from -2^(b-1) to 2^(b-1) - 1."""
    seen = instruments.quantised(np.array([-5.0, -1.0, 0.0, 0.9999, 5.0]), 1.0, 8)
    assert seen.tolist() == [-1.0, -1.0, 0.0, 127 / 128, 127 / 128]


def test_delay_and_jitter() -> None:
    """A ramp that arrives late is read lower by slope x delay; jitter makes noise of slope x its sigma."""
    signal, times = 50.0 * STEP * np.arange(4001), np.linspace(2e-4, 9e-4, 5000)
    rng = np.random.default_rng(3)
    late = instruments.sampled(signal, 0.0, STEP, times, delay=7e-6, rng=rng)
    assert late == pytest.approx(50.0 * (times - 7e-6), abs=1e-12)
    shaken = instruments.sampled(signal, 0.0, STEP, times, jitter=2e-7, rng=rng) - 50.0 * times
    # A standard deviation of 5000 values is known to 1 %.
    assert shaken.std() == pytest.approx(50.0 * 2e-7, rel=0.04)
    assert instruments.sampled(signal, 0.0, STEP, np.array([-1e-4]), rng=rng)[0] == 0.0
    with pytest.raises(ValueError, match="the signal ends at"):
        instruments.sampled(signal, 0.0, STEP, np.array([2e-3]), rng=rng)


def test_baseline_and_inertia() -> None:
    """A level at time 0 that drifts; a platen of 7 g at 1000 m/s^2 adds 7 N."""
    assert instruments.baseline(np.array([-1.0, 0.0, 2.0]), 0.003, 0.5).tolist() == [-0.497, 0.003, 1.003]
    assert instruments.with_inertia(np.array([1.0]), 7e-3, np.array([1000.0]))[0] == pytest.approx(8.0)
