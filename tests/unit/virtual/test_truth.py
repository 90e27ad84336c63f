"""The truth of a synthetic shot: the flyer's motion, a tilting flyer, the exports of the measurement."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import trapezoid

from kolsky.virtual.instruments import free_outline, measure_curve, measure_outline, side_displacement
from kolsky.virtual.material import law_of, uniaxial_stress
from kolsky.virtual.motion import Ramp, flyer_samples, path_of, ramp_of, static_curve
from kolsky.virtual.schema import MotionTable, Specification
from kolsky.virtual.shot_file import shot_tables
from kolsky.virtual.truth import KNOT, Job, SurfaceHistory, TruthError, middle, simulate_truths

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


def test_the_flyer_of_the_whole_test_keeps_its_momentum() -> None:
    """Without a specimen to speak of the flyer flies on at one speed, near the paper's 2.7 m/s."""
    time, path = flyer_samples(
        speed=5.5,
        striker_length=0.25,
        flyer=(0.026, 15e-3, 21e-3),
        specimen=(1e-3, 6.5e-3, 1.0),
        duration=8e-4,
    )
    speed = np.gradient(path, time)[time > 5e-4]
    assert speed.mean() == pytest.approx(2.7, abs=0.3)
    assert path[0] == 0.0


def test_static_curve_is_neo_hookean_where_it_is_slender() -> None:
    compression, force = static_curve(1e-3, 1.0, 2e4)
    lam = 1.0 - compression[100]
    assert force[100] == pytest.approx(2e4 * np.pi * 0.25e-6 * (lam**-2 - lam), rel=1e-6)
