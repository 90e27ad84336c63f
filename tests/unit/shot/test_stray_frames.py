"""Frames of a flyer that contradict their neighbours are detected, get no weight and are named."""

from pathlib import Path
from shutil import copytree

import numpy as np
import pytest

from kolsky.pictures.frames import STRAY_SIGMAS, STRAY_STEPS, stray_frames
from kolsky.shot.load import load_shot

ROOT = Path(__file__).resolve().parents[3]
SIGMA = 1e-6
TIME = 7e-6 * np.arange(160)


def rising(within: float, speed: float = 3.0, start: float = 1e-4) -> np.ndarray:
    """Displacement of a flyer whose velocity rises as a line from rest to `speed` in a time."""
    t = np.clip(TIME - start, 0.0, None)
    return speed * np.where(t < within, 0.5 * t**2 / within, t - 0.5 * within)


@pytest.mark.parametrize("within", [7e-6, 2e-5, 9e-5])
def test_a_sudden_start_is_no_stray_frame(within: float) -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        noisy = rising(within) + SIGMA * rng.standard_normal(TIME.size)
        assert not stray_frames(TIME, noisy, np.full(TIME.size, SIGMA))[0].any()


def test_a_cubic_leaves_nothing_and_a_step_is_measured_whole() -> None:
    path = 1e-3 + 2.0 * TIME + 3e2 * TIME**2 - 1e4 * TIME**3
    for row in (0, 1, 80, 158, 159):
        moved = path.copy()
        moved[row] += 5.9e-3
        stray, off = stray_frames(TIME, moved, np.full(TIME.size, SIGMA))
        assert np.flatnonzero(stray).tolist() == [row]
        assert off[row] == pytest.approx(5.9e-3, rel=1e-6)


def test_both_limits_hold() -> None:
    """At rest 20 standard deviations of what is left, of a moving flyer three of its steps.

    A cubic's value in the middle of symmetric frames is a quadratic's: shares S4 - S2 t^2, of sum one.
    """
    t = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])
    shares = np.array([(np.sum(t**4) - x**2 * np.sum(t**2)) for x in t])
    shares /= shares.sum()
    spread = np.sqrt(1.0 + np.sum(shares**2))
    rest = np.zeros(TIME.size)
    sigma = np.full(TIME.size, SIGMA)
    for factor, found in ((0.99, 0), (1.01, 1)):
        moved = rest.copy()
        moved[80] = factor * STRAY_SIGMAS * SIGMA * spread
        assert stray_frames(TIME, moved, sigma)[0].sum() == found
        moved = 3.0 * TIME  # 21 um a frame
        moved[80] += factor * STRAY_STEPS * 3.0 * 7e-6
        assert stray_frames(TIME, moved, sigma)[0].sum() == found


def test_many_of_them_are_noise_of_another_kind() -> None:
    moved = rising(5e-5)
    moved[10:160:10] += 2e-3
    assert not stray_frames(TIME, moved, np.full(TIME.size, SIGMA))[0].any()


def test_a_stray_frame_of_a_shot_is_named_and_has_no_weight(tmp_path: Path) -> None:
    folder = tmp_path / "open-01"
    copytree(ROOT / "runs" / "open-01", folder, ignore=lambda *_: ["results"])
    before = load_shot(folder)
    lines = (folder / "flyer.csv").read_text().splitlines()
    row = next(k for k, line in enumerate(lines) if line.startswith("57,"))
    cells = lines[row].split(",")
    cells[-1] = f"{float(cells[-1]) + 3.0:.4f}"
    lines[row] = ",".join(cells)
    (folder / "flyer.csv").write_text("\n".join(lines) + "\n")
    after = load_shot(folder)
    assert before.flyer.notes == ()
    (note,) = after.flyer.notes
    assert note.startswith(f"flyer.csv line {row + 1}: frame 57 of the flyer is +3 mm off")
    changed = np.flatnonzero(after.flyer.sigma != before.flyer.sigma)
    assert after.flyer.sigma[changed] == pytest.approx([3e-3], rel=0.01)
