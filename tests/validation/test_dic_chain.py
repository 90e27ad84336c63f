"""The chain on a known-answer shot: its results, and the effect of bad pictures.

The pictures are a part of open-01, a shot with a known surface at every time. The cameras are the true ones,
so the tests need no calibration. `test_dic_shot.py` tests the whole chain.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import tifffile
from memory_pictures import Memory
from shared_data import data
from synthetic_dic import true_rig

from dic import FrameOutcome, PointOutcome, StereoRig
from dic.bodies.region import Region, find_regions
from dic.chain import ChainError, ChainSettings, measure
from dic.chain.follow_bodies import (
    displacement_of,
    follow,
    match_flyer,
    match_specimen,
    rim_in,
    translations_of,
)
from dic.chain.inputs import inspect_pictures
from dic.chain.test_frame import fit_test_frame
from dic.correlation import Correlation, Shape
from dic.images import open_pictures
from dic.tracking import Tracking

STATIC, STEP, LAST = 6, 2, 44  # static frames taken, and every so many-th frame from then on, to this one
CROP = (192.0, 192.0)
SPECIMEN = Region(((30.0, 6.0), (95.0, 6.0), (95.0, 121.0), (30.0, 121.0)))
SETTINGS = ChainSettings(
    toward_flyer="up",
    zero=(60.0, 122.0),
    strip_half_width=0.6e-3,
    radius=4.75e-3,
    length=6.5e-3,
    largest_sigma=10e-6,
    step=9,
    tracking=Tracking(correlation=Correlation(subset=21, shape=Shape.QUADRATIC)),
)


def recorded(frames) -> Memory:
    return Memory(tuple(frames), bits=12, crop_offset=CROP)


Case = SimpleNamespace


def chosen() -> np.ndarray:
    return np.concatenate([np.arange(STATIC), np.arange(12, LAST, STEP)])


@pytest.fixture(scope="module")
def case() -> Case:
    folder = data("shots", "open-01")
    stacks = [tifffile.imread(folder / f"cam{k}.tif")[chosen()] for k in (0, 1)]
    times = np.loadtxt(folder / "frames.csv", delimiter=",", skiprows=1)[:, 1]
    with np.load(folder / "truth_surface.npz") as stored:
        surface = {name: stored[name] for name in ("t", "y", "r", "d")}
    return Case(
        series=(recorded(stacks[0]), recorded(stacks[1])), rig=true_rig(folder).cropped(CROP, CROP),
        t=times[chosen()], static=np.arange(len(chosen())) < STATIC, truth=surface,
    )  # fmt: skip


def run(case: Case, series=None, rig=None, **options):
    return measure(
        series or case.series, rig or case.rig, options.pop("settings", SETTINGS), t=case.t,
        static=case.static, specimen=SPECIMEN, **options,
    )  # fmt: skip


@pytest.fixture(scope="module")
def clean(case: Case):
    return run(case)


def outline_error(result, truth: dict[str, np.ndarray]) -> np.ndarray:
    """Measured minus true radius of every point of the centre line [m]."""
    line, errors = result.centre, []
    for frame in np.unique(line.frame):
        of = line.frame == frame
        y, r = (
            np.array([np.interp(result.t[frame], truth["t"], column) for column in truth[name].T])
            for name in ("y", "r")
        )
        order = np.argsort(y)
        errors.append(line.Z[of] - np.interp(line.y[of], y[order], r[order]))
    return np.concatenate(errors)


def changed(series: tuple[Memory, Memory], camera: int, frames, change) -> tuple[Memory, Memory]:
    """The series with some pictures of one camera changed; None from `change` removes them."""
    pictures = list(series[camera].frames)
    for frame in frames:
        pictures[frame] = change(pictures[frame])
    new = replace(series[camera], frames=tuple(pictures))
    return (new, series[1]) if camera == 0 else (series[0], new)


def others_stand(result, clean, frames, *, share: float = 0.98, within: float = 10e-6) -> None:
    """Outside `frames`, points live as without the fault and lie where they lay."""
    kept = np.ones(len(result.t), dtype=bool)
    kept[frames] = False
    common = min(result.specimen.surface.n_points, clean.specimen.surface.n_points)
    assert common == clean.specimen.surface.n_points
    one, other = result.specimen.surface, clean.specimen.surface
    alive = one.valid[kept] & other.valid[kept]
    assert alive.sum() >= share * other.valid[kept].sum()
    apart = np.linalg.norm(one.position[kept] - other.position[kept], axis=2)[alive]
    # A gap may make a point take another reference: three sigma of Z, 4 um with subsets of 21 px.
    assert np.percentile(apart, 99) < within


def test_the_outline_is_right_within_its_sigma(case, clean):
    error = outline_error(clean, case.truth)
    assert error.size > 100
    assert np.sqrt(np.mean(error**2)) < 5e-6  # the target
    # subsets of 21 px every 9 px know a row to 4 um and rows near the ends to 8: three sigma of those
    assert np.abs(error).max() < 25e-6
    assert np.abs(error / clean.centre.sigma).max() < 5.0  # some hundred values of one distribution
    # Neighbouring rows share pixels, so a few tens of values are independent: 0.5 to 1.5 is 4 sigma of a
    # standard deviation from 20 of them, less what sigma overstates.
    assert 0.4 < np.std(error / clean.centre.sigma) < 1.5


def test_rest_is_rest(case, clean):
    noise = clean.noise
    assert noise.n_frames == STATIC
    # Along the surface sigma counts the noise of frame and reference; the reference's is common to all
    # frames, so that through the frames about 1/sqrt 2 of it is seen. Off the surface there is none of the
    # reference's. 6 frames x 80 points fix that to 5 %, pictures to 10 %.
    assert np.all(noise.ratio[:2] > 0.55)
    assert np.all(noise.ratio[:2] < 0.9)
    assert 0.8 < noise.ratio[2] < 1.2
    assert abs(clean.placement.radius - 4.75e-3) < 4.0 * clean.placement.radius_sigma
    assert np.all(np.isfinite(clean.strain_noise))
    assert {remark.name for remark in clean.remarks} <= {"points without a place at rest", "uncertain rows"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("camera", "change", "outcome"),
    [
        (0, lambda picture: None, FrameOutcome.UNREADABLE),
        (1, lambda picture: picture // 16, FrameOutcome.BLACK),
    ],
    ids=["missing", "black"],
)
def test_a_missing_or_black_frame_is_a_gap(case, clean, camera, change, outcome):
    noise = np.random.default_rng(1).integers(0, 12, (128, 128)).astype(np.uint16)
    dark = change if outcome is FrameOutcome.UNREADABLE else (lambda picture: noise + 40)
    result = run(case, changed(case.series, camera, [12], dark))
    assert result.frames[camera][12] == outcome
    assert result.outcome[12] == outcome
    assert np.count_nonzero(result.outcome) == 1
    assert np.all(result.specimen.surface.outcome[12] == PointOutcome.NO_PICTURE)
    assert any(f"camera {camera}, frame 12" in remark.text for remark in result.remarks)
    others_stand(result, clean, [12])


@pytest.mark.slow
def test_a_black_first_frame_moves_the_reference(case, clean):
    result = run(case, changed(case.series, 1, [0], lambda picture: picture * 0 + 50))
    assert result.outcome[0] == FrameOutcome.BLACK
    assert any(remark.name == "another reference" for remark in result.remarks)
    off = outline_error(result, case.truth)
    assert np.sqrt(np.mean(off**2)) < 5e-6  # the limits for the whole test
    assert np.abs(off).max() < 25e-6


@pytest.mark.slow
def test_swapped_cameras_are_named(case):
    first, second = case.series
    with pytest.raises(ChainError, match="cameras are exchanged"):
        run(case, (second, first))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("camera", "off", "words"), [(0, (0.0, 5.0), "y by [-+]5"), (1, (0.0, -8.0), "y by [-+]8")]
)
def test_a_wrong_crop_offset_is_named_with_its_size(case, camera, off, words):
    cameras = list(case.rig.cameras)
    cameras[camera] = cameras[camera].cropped(off)
    with pytest.raises(ChainError, match=rf"crop offset of .* is off.*{words}"):
        run(case, rig=StereoRig((cameras[0], cameras[1])))


@pytest.mark.slow
@pytest.mark.parametrize("camera", [0, 1])
def test_a_crop_offset_along_the_lines_of_sight_is_remarked_on(case, camera):
    """8 px along the epipolar lines leave 0.04 px across them: not refused, but told."""
    cameras = list(case.rig.cameras)
    cameras[camera] = cameras[camera].cropped((8.0, 0.0))
    result = run(case, rig=StereoRig((cameras[0], cameras[1])))
    assert [r.text for r in result.remarks if r.name == "crop offset" and "x by -" in r.text]


@pytest.mark.slow
def test_the_travel_with_camera_1_cut_off_is_right_or_refused(case):
    """Of 186 frames camera 1 has 60 %; the flyer's region is declared in the last, which it has not."""
    folder = data("shots", "open-01")
    stacks = [list(tifffile.imread(folder / f"cam{k}.tif")) for k in (0, 1)]
    n = len(stacks[0])
    stacks[1][int(0.6 * n) :] = [None] * (n - int(0.6 * n))
    times = np.loadtxt(folder / "frames.csv", delimiter=",", skiprows=1)[:n, 1]
    pictures = (recorded(stacks[0]), recorded(stacks[1]))
    settings = replace(SETTINGS, length=6.5e-3, length_sigma=6.5e-6)
    static = np.arange(n) < 12
    inputs = inspect_pictures(pictures, static).with_cameras(case.rig, settings, times, static)
    flyer = Region(((0.0, 0.0), (127.0, 0.0), (127.0, 69.0), (0.0, 69.0)), n - 1)
    still = inspect_pictures((recorded(stacks[0][:12]), recorded(stacks[1][:12])), static[:12])
    still = still.with_cameras(case.rig, settings, times[:12], static[:12])
    try:
        body = follow(inputs, [match_flyer(inputs, flyer)])[0]
    except ChainError:
        return  # refused; what an error says has tests of its own (`test_dic_travel_checks.py`)
    rest = fit_test_frame(still, follow(still, [match_specimen(still, SPECIMEN)])[0], body)
    rim, seen = rim_in(inputs, body, rest.placement), translations_of(inputs, body, rest.placement)
    axial = displacement_of(inputs, body, rest.placement, rim, seen)
    off = axial.displacement - np.interp(axial.t, case.truth["t"], case.truth["d"])
    assert np.abs(off).max() < 5.0 * np.hypot(axial.rest_sigma, 1e-6)


@pytest.mark.slow
def test_cameras_out_of_sync_are_named(case):
    first, second = case.series
    early = replace(second, frames=(second.frames[0], *second.frames[:-1]))
    result = run(case, (first, early))
    named = [remark for remark in result.remarks if remark.name == "out of step"]
    assert len(named) == 1
    # Picture k of camera 1 shows what camera 0 sees one frame later under that number.
    assert "camera 0 is late by 1.00" in named[0].text


def patch(value: int, place=(slice(60, 90), slice(45, 75))):
    def change(picture: np.ndarray) -> np.ndarray:
        new = picture.copy()
        new[place] = value
        return new

    return change


@pytest.mark.slow
@pytest.mark.parametrize("value", [4095, 1500], ids=["saturated or flashed", "speckles gone"])
def test_a_spoilt_patch_costs_its_own_points_only(case, clean, value):
    frames = [12, 13, 14]
    result = run(case, changed(case.series, 0, frames, patch(value)))
    body, before = result.specimen, clean.specimen
    x, y = before.pixels[0][12].T
    half = 10
    far = (x < 45 - half - 2) | (x > 75 + half + 2) | (y < 60 - half - 2) | (y > 90 + half + 2)
    deep = (x > 50) & (x < 70) & (y > 65) & (y < 85)
    assert deep.sum() >= 2
    assert not body.surface.valid[12, deep].any()  # nothing is made of a grey patch
    assert body.surface.valid[12, far].sum() >= 0.95 * before.surface.valid[12, far].sum()
    others_stand(result, clean, frames, share=0.95)


@pytest.mark.slow
def test_speckles_that_stay_away_end_as_lost_points(case, clean):
    frames = range(10, len(case.t))
    result = run(case, changed(case.series, 0, frames, patch(1500)))
    x, y = clean.specimen.pixels[0][10].T
    deep = (x > 52) & (x < 68) & (y > 67) & (y < 83)
    assert not result.specimen.surface.valid[10:, deep].any()
    assert np.all(result.outcome == FrameOutcome.VALID)
    others_stand(result, clean, frames)


@pytest.mark.slow
def test_a_flash_over_the_whole_picture_is_a_frame_or_nothing(case, clean):
    def flash(picture: np.ndarray) -> np.ndarray:
        return np.minimum(picture.astype(int) * 4, 4095).astype(np.uint16)

    result = run(case, changed(case.series, 0, [11], flash))
    surface = result.specimen.surface
    if result.outcome[11] == FrameOutcome.VALID:
        apart = surface.position[11] - clean.specimen.surface.position[11]
        both = surface.valid[11] & clean.specimen.surface.valid[11]
        # Clipped speckles keep their edges: 0.3 px at 18 px per mm is 17 um.
        assert np.all(np.linalg.norm(apart[both], axis=1) < 100e-6)
    else:
        assert result.outcome[11] == FrameOutcome.SATURATED
    others_stand(result, clean, [11])


def test_nothing_at_rest_is_refused(case):
    dark = changed(case.series, 0, range(STATIC), lambda picture: None)
    with pytest.raises(ChainError, match="0 usable static pictures"):
        run(case, dark)


def test_settings_are_checked():
    with pytest.raises(ValueError, match="toward_flyer must be one of up"):
        replace(SETTINGS, toward_flyer="north")
    with pytest.raises(ValueError, match="radius must be a positive length"):
        replace(SETTINGS, radius=-1.0)


TRUE = {"open-01": (5.04, 122.18, 69.39), "open-02": (1.93, 118.84, 58.33)}
"""Rows of camera 0, half-way across, where the cameras of truth.json put the specimen's ends at rest and the
flyer's edge in the last frame [px]."""


@pytest.mark.parametrize("name", TRUE)
def test_regions_are_a_pixel_clear_of_the_true_edges(name):
    pictures = open_pictures(data("shots", name) / "cam0.tif", bits=12)
    n = pictures.n_frames
    found = find_regions(pictures, np.arange(n) < 12, np.ones(n, dtype=bool), toward="up")
    top, bottom, edge = TRUE[name]
    (x0, y0), _, (x1, y1), _ = found.specimen.corners
    assert (x0, x1) == (0.0, pictures.shape[1] - 1)  # the sides of the specimen are out of view
    assert 0.9 <= y0 - top <= 2.0
    assert 0.5 <= bottom - y1 <= 2.0
    assert found.edge[1] == pytest.approx(bottom, abs=1.0)  # the chain looks for it within 2 px
    assert found.flyer.frame == n - 1
    assert 0.9 <= edge - found.flyer.corners[2][1] <= 2.0
