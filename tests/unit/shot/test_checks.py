"""Thresholds, signs and ends of the checks of a shot, tested on both sides with numbers by hand."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kolsky.base.apparatus import Transducer
from kolsky.base.errors import InputError
from kolsky.base.records import CentreLine, FlyerMotion, Recording
from kolsky.pictures.frames import body_moves, flyer_covers, flyer_moves, frames_agree, sound_at_rest
from kolsky.readers.measured_tables import FrameTable
from kolsky.shot.curve import check_curve
from kolsky.shot.force import check_baseline, check_range, check_sign, check_signal
from kolsky.shot.load import window
from kolsky.shot.records import ForceChannel
from kolsky.shot.summary import Entry
from kolsky.shot.surface import check_outline

FILE = Path("file.csv")
LENGTH, DIAMETER = 5e-3, 8e-3


class Toml:
    """What the checks read of a shot file."""

    def __init__(self, **sections: dict[str, Any]) -> None:
        said: dict[str, dict[str, Any]] = {
            "force": {"full_scale": 2.0, "bits": None, "layout": None, "baseline": (-2e-4, -1e-5)},
            "frames": {"static": 4, "clock_offset": 0.0},
            "specimen": {"length": LENGTH, "diameter": DIAMETER},
            "window": {"start": None, "end": None},
        }
        for name, section in sections.items():
            said[name] = {**said[name], **section}
        self.declared = SimpleNamespace(**{name: SimpleNamespace(**s) for name, s in said.items()})

    def error(self, key: str, message: str, **rest: Any) -> InputError:
        return InputError("shot.toml", message, key=key, **rest)


def recording(value: Any, interval: float = 1e-6) -> Recording:
    value = np.asarray(value, dtype=float)
    return Recording(interval * np.arange(value.size), value, "CH1", "V", FILE, "0", first_line=2)


def refused(check, *args, **options) -> str:
    with pytest.raises(InputError) as caught:
        check(*args, **options)
    return str(caught.value)


# The range of the recorder.


def test_a_sample_at_full_scale_is_clipped_and_one_below_is_not() -> None:
    check_range(recording([0.0, 1.999, -1.999]), Toml().declared.force)
    for value in (2.0, -2.0, 2.5):
        said = refused(check_range, recording([0.0, 0.1, value, 0.2, value]), Toml().declared.force)
        assert "file.csv line 4:" in said
        assert "first of 2 samples" in said


def test_the_last_codes_of_a_recorder_are_clipped() -> None:
    """8 bits over ± 2 V: codes of 2 / 128 V from -128 to 127. The largest is 1.984375 V, the one below
    1.96875 V; half a code between them is the limit, 2 (1 - 1.5 / 128) = 1.9765625 V."""
    toml = Toml(force={"bits": 8})
    check_range(recording([0.0, 126 * 2.0 / 128, -126 * 2.0 / 128]), toml.declared.force)
    check_range(recording([0.0, 1.9765]), toml.declared.force)
    for value in (127 * 2.0 / 128, -128 * 2.0 / 128, 1.9766):
        assert "is clipped" in refused(check_range, recording([0.0, value]), toml.declared.force)


def test_what_rises_from_every_sample_to_the_next_is_a_clock() -> None:
    """A recorder's time column declared as the voltage; one sample that does not rise makes it a signal."""
    said = refused(check_signal, recording(1e-6 * np.arange(40)), Toml())
    assert "rises from each of its 40 samples to the next" in said
    rising = 1e-6 * np.arange(40)
    rising[20] = rising[19]
    check_signal(recording(rising), Toml())
    check_signal(recording(1e-6 * np.arange(20)), Toml())  # too short to tell


# The zero of the force.


def noise(samples: int) -> np.ndarray:
    return 1e-3 * (-1.0) ** np.arange(samples)


def test_a_baseline_has_twenty_samples_that_differ() -> None:
    check_baseline(noise(20), 0.0, Toml())
    assert "holds 19 samples" in refused(check_baseline, noise(19), 0.0, Toml())
    assert "holds the same value 0.25 V 30 times" in refused(check_baseline, np.full(30, 0.25), 0.0, Toml())


def test_a_baseline_ends_at_the_last_static_frame_at_the_latest() -> None:
    check_baseline(noise(30), -1e-5, Toml())
    assert "overlaps the flyer's motion" in refused(check_baseline, noise(30), -1.01e-5, Toml())


def test_a_quiet_span_after_the_test_is_a_baseline() -> None:
    """Frames to 1 ms; 100 samples alternate by 2 mV, so that a half's mean is known to 0.283 mV at most."""
    late = {"baseline": (1.1e-3, 1.2e-3), "time_constant": None}
    volts = 1e-3 * (-1.0) ** np.arange(100)
    check_baseline(volts, 0.0, Toml(force=late), last=1e-3)
    assert "overlaps the flyer's motion" in refused(check_baseline, volts, 0.0, Toml(force=late), last=1.1e-3)
    # The steps are 2 mV: sigma sqrt(2) mV, six standard deviations of the difference 6 * 0.2 * sqrt(2) mV.
    step = np.where(np.arange(100) < 50, 0.0, 1.0)
    limit = 6.0 * 0.2 * np.sqrt(2.0) * 1e-3
    check_baseline(volts + 0.97 * limit * step, 0.0, Toml(force=late), last=1e-3)
    moved = volts + 1.03 * limit * step
    assert "is not quiet: its halves differ by +0.00175 V" in refused(
        check_baseline, moved, 0.0, Toml(force=late), last=1e-3
    )
    charged = {**late, "time_constant": 0.1}
    assert "time_constant" in refused(check_baseline, volts, 0.0, Toml(force=charged), last=1e-3)
    few = refused(check_baseline, volts[:15], 0.0, Toml(), last=1e-3)
    assert "holds 15 samples" in few
    assert "a quiet span after the last frame at 1000 us is sufficient" in few


def channel(**changed: Any) -> ForceChannel:
    volts = np.array([0.5, 0.7, 0.5, 0.7, 1.6, 2.6, 1.6])
    given = {
        "recording": recording(volts, interval=1e-3),
        "transducer": Transducer(sensitivity=0.02, compression_sign=1, full_scale=5.0),
        "baseline": (1e-3, 4e-3),
        "clock_offset": 1e-3,
    }
    return ForceChannel(**{**given, **changed})


def test_the_clock_offset_is_added_to_the_recorder() -> None:
    np.testing.assert_array_equal(channel(clock_offset=2.5e-4).time, 1e-3 * np.arange(7) + 2.5e-4)
    np.testing.assert_array_equal(channel(clock_offset=-2.5e-4).time, 1e-3 * np.arange(7) - 2.5e-4)


def test_the_baseline_is_on_the_clock_of_the_shot_with_both_ends() -> None:
    """Samples 0 to 3 lie at 1, 2, 3 and 4 ms of the shot's clock."""
    assert channel().baseline_volts().tolist() == [0.5, 0.7, 0.5, 0.7]
    assert channel(baseline=(1.5e-3, 3e-3)).baseline_volts().tolist() == [0.7, 0.5]


@pytest.mark.parametrize("sign", [1, -1])
def test_force_is_volts_above_the_zero_over_the_sensitivity(sign: int) -> None:
    """(1.6 - 0.6) V / (0.02 V/N) = 50 N, positive in compression."""
    found = channel(
        transducer=Transducer(sensitivity=0.02, compression_sign=sign, full_scale=5.0)
    ).raw_force()
    np.testing.assert_allclose(found[4:], sign * np.array([50.0, 100.0, 50.0]), rtol=1e-13)  # round-off


# The sign of the force.


def pushed(by: float) -> FlyerMotion:
    time = 1e-5 * np.arange(11)
    return FlyerMotion(time, by * time / time[-1], np.full(11, 1e-6))


def test_a_flyer_that_went_a_tenth_of_the_length_decides_the_sign() -> None:
    time, pulling = 1e-5 * np.arange(11), np.full(11, -3.0)
    span = (0.0, 1e-4)
    check_sign(pulling, time, span, pushed(0.0999 * LENGTH), Toml())  # too little to tell
    assert "the specimen pulls, by 3 N" in refused(
        check_sign, pulling, time, span, pushed(0.1001 * LENGTH), Toml()
    )
    check_sign(-pulling, time, span, pushed(0.5 * LENGTH), Toml())


def test_only_the_window_decides_the_sign() -> None:
    time = 1e-5 * np.arange(21)
    force = np.where(time <= 1e-4 + 1e-9, 1.0, -100.0)
    check_sign(force, time, (0.0, 1e-4 + 1e-9), pushed(0.5 * LENGTH), Toml())
    assert "pulls" in refused(check_sign, force, time, (0.0, 1.1e-4 + 1e-9), pushed(0.5 * LENGTH), Toml())


# The flyer at rest, its first motion, its furthest place.


def flyer(displacement: Any) -> tuple[FrameTable, FlyerMotion]:
    d = np.asarray(displacement, dtype=float)
    frame = np.arange(d.size)
    table = FrameTable(path=FILE, sha256="0", frame=frame)
    return table, FlyerMotion(1e-5 * frame, d, np.full(d.size, 1e-6))


def test_a_static_frame_is_within_six_sigmas_of_the_mean_of_all_four() -> None:
    """One of four at d lies 3 d / 4 from their mean: six sigmas of 1 um are reached at d = 8 um."""
    table, motion = flyer([0.0, 0.0, 0.0, 7.99e-6, 1e-3])
    flyer_moves(table, motion, 1e-6, Toml())
    table, motion = flyer([0.0, 0.0, 0.0, 8.01e-6, 1e-3])
    said = refused(flyer_moves, table, motion, 1e-6, Toml())
    assert "file.csv line 5: frame 3 is" in said
    assert "more than 6 times flyer.sigma" in said


def test_a_flyer_moves_by_more_than_six_sigmas_and_less_than_the_length() -> None:
    flyer_moves(*flyer([0.0] * 4 + [6.01e-6]), 1e-6, Toml())
    assert "never moves" in refused(flyer_moves, *flyer([0.0] * 4 + [5.99e-6]), 1e-6, Toml())
    flyer_moves(*flyer([0.0] * 4 + [0.999 * LENGTH]), 1e-6, Toml())
    assert "exceeds the specimen's length" in refused(flyer_moves, *flyer([0.0] * 4 + [LENGTH]), 1e-6, Toml())


def test_a_flyer_moves_toward_the_specimen() -> None:
    assert "away from the specimen" in refused(flyer_moves, *flyer([0.0] * 4 + [-1e-3]), 1e-6, Toml())


def test_a_body_that_is_back_at_rest_did_not_move() -> None:
    """One of twelve static frames 8 um off, ten sigmas: the others after it are where they were."""
    rest, still = 11.5e-5, [0.0] * 12
    odd = [*still[:4], 8e-6, *still[5:], 1e-3]
    motion = sound_at_rest(flyer(odd)[1], rest)
    np.testing.assert_allclose(motion.sigma[[3, 4, 5]], [1e-6, 8e-6, 1e-6])
    assert motion.displacement[4] == pytest.approx(8e-6)
    assert "8 um from its place" in motion.notes[0]
    body_moves(motion, rest, FILE, Toml())
    # one that lasts to the end of the static frames is a motion, and four of twelve are no accident
    for moved in ([*still[:9], 2e-5, 2e-5, 2e-5, 1e-3], [*([2e-5] * 4), *still[4:], 1e-3]):
        assert "frames.static" in refused(
            body_moves, sound_at_rest(flyer(moved)[1], rest), rest, FILE, Toml()
        )


def test_warm_air_at_rest_is_no_motion() -> None:
    """0.5 um of what successive frames have in common, beside 0.05 um of their own: 0.6 um is no motion."""
    motion = flyer([0.0, 0.0, 0.0, 0.8e-6, 1e-3])[1]
    motion = replace(motion, sigma=np.full(5, 5e-8))
    assert "frames.static" in refused(body_moves, motion, 3.5e-5, FILE, Toml())
    body_moves(replace(motion, shared_sigma=np.full(5, 5e-7), shared_memory=1e-4), 3.5e-5, FILE, Toml())


def test_a_body_in_pictures_rests_and_moves_by_its_own_sigmas() -> None:
    rest = 3.5e-5
    body_moves(flyer([0.0, 0.0, 0.0, 7.99e-6, 1e-3])[1], rest, FILE, Toml())
    assert "frames.static" in refused(
        body_moves, flyer([0.0, 0.0, 0.0, 8.01e-6, 1e-3])[1], rest, FILE, Toml()
    )
    body_moves(flyer([0.0] * 4 + [6.01e-6])[1], rest, FILE, Toml())
    assert "never moves" in refused(body_moves, flyer([0.0] * 4 + [5.99e-6])[1], rest, FILE, Toml())
    assert "moves away" in refused(body_moves, flyer([0.0] * 4 + [-1e-3])[1], rest, FILE, Toml())
    assert "exceeds" in refused(body_moves, flyer([0.0] * 4 + [LENGTH])[1], rest, FILE, Toml())


# The clocks of the frames.


def frames(times: Any, digit: float = 1e-8) -> FrameTable:
    times = np.asarray(times, dtype=float)
    return FrameTable(
        path=Path("frames.csv"), sha256="0", frame=np.arange(times.size), time=times, digit=digit
    )


def test_times_agree_within_half_a_digit_of_both_files() -> None:
    """Digits of 1e-8 and 3e-8 s: 2e-8 s apart is allowed, and no more."""
    expected = frames([0.0, 1e-5, 2e-5])
    for shift, agree in ((1.99e-8, True), (-1.99e-8, True), (2.01e-8, False), (-2.01e-8, False)):
        time = expected.time + np.array([0.0, 0.0, shift])
        table = FrameTable(path=FILE, sha256="0", frame=expected.frame, time=time, digit=3e-8)
        if agree:
            frames_agree(table, expected)
        else:
            assert "file.csv line 4: frame 2 has the time" in refused(frames_agree, table, expected)


def test_times_of_another_unit_or_trigger_are_named() -> None:
    expected = frames(1e-5 * np.arange(5))
    for factor, shift, cure in (
        (1e3, 0.0, "its times are 1000 times those"),
        (1e-6, 0.0, "its times are 1e-06 times those"),
        (1.0, 2e-3, "its times are 2000 us later throughout"),
        (1.0, -58.3, "its times are -58.300000000 s later throughout"),
        (1.05, 0.0, "are two columns swapped?"),
        (900.0, 0.0, "are two columns swapped?"),
    ):
        table = FrameTable(
            path=FILE, sha256="0", frame=expected.frame, time=factor * expected.time + shift, digit=1e-12
        )
        assert cure in refused(frames_agree, table, expected)


def test_the_flyer_covers_the_frames_up_to_the_window_on_the_shot_clock() -> None:
    """Frames at 0 to 40 us and a clock offset of +5 us: frame 4 is at 45 us."""
    all_frames = frames(1e-5 * np.arange(5))
    table, _ = flyer([0.0, 0.0, 0.0, 0.0])
    late = Toml(frames={"clock_offset": 5e-6}, window={"end": 4.4e-5})
    flyer_covers(table, all_frames, late)
    within = Toml(frames={"clock_offset": 5e-6}, window={"end": 4.6e-5})
    assert "frame 4 is beyond the flyer record" in refused(flyer_covers, table, all_frames, within)


# The window.

FRAME_TIME = 1e-5 * np.arange(101)


def span(toml: Toml, scope_time: np.ndarray | None = None, flyer_end: float = 1e-3, **rest: Any) -> Any:
    time = 1e-6 * np.arange(-100, 1101) if scope_time is None else scope_time
    return window(toml, FRAME_TIME, flyer_end, recording(np.zeros(time.size)), time, **rest)


def test_the_window_runs_from_the_last_static_frame_to_the_last_covered_one() -> None:
    assert span(Toml()) == (FRAME_TIME[3], FRAME_TIME[100])
    short = 1e-6 * np.arange(-100, 976)  # ends at 975 us: frames 98, 99 and 100 of 101 are beyond
    assert span(Toml(), short) == (FRAME_TIME[3], FRAME_TIME[97])


def test_a_twentieth_of_the_frames_may_be_beyond_the_force() -> None:
    """Of 101 frames five are 4.95 %, six 5.94 %."""
    assert span(Toml(), 1e-6 * np.arange(-100, 956)) == (FRAME_TIME[3], FRAME_TIME[95])
    assert "6 of 101 camera frames are beyond" in refused(span, Toml(), 1e-6 * np.arange(-100, 946))


def test_the_window_ends_before_symmetry_does() -> None:
    assert span(Toml(), symmetry_end=FRAME_TIME[60]) == (FRAME_TIME[3], FRAME_TIME[59])


def test_a_declared_start_lies_in_the_static_frames() -> None:
    assert span(Toml(window={"start": FRAME_TIME[1]}))[0] == FRAME_TIME[1]
    assert span(Toml(window={"start": FRAME_TIME[3]}))[0] == FRAME_TIME[3]
    assert "window.start" in refused(span, Toml(window={"start": FRAME_TIME[3] + 1e-9}))
    assert "window.start" in refused(span, Toml(window={"start": FRAME_TIME[0] - 1e-9}))
    late = 1e-6 * np.arange(31, 1101)
    assert "begins at 31 us, after the window's start at 30 us" in refused(span, Toml(), late)


def test_a_declared_end_is_covered_by_frames_flyer_and_force() -> None:
    assert span(Toml(window={"end": 9e-4}))[1] == 9e-4
    assert span(Toml(window={"end": 5e-4}), flyer_end=5e-4)[1] == 5e-4
    assert "window.end" in refused(span, Toml(window={"end": 5.1e-4}), flyer_end=5e-4)
    assert "window.end" in refused(span, Toml(window={"end": FRAME_TIME[100] + 1e-9}))
    assert "window.end" in refused(span, Toml(window={"end": 9.5e-4}), 1e-6 * np.arange(-100, 946))
    assert "window.end" in refused(span, Toml(window={"end": FRAME_TIME[3]}))


# The outline.


def line(Z: Any, y: Any = None, time: float = 0.0) -> CentreLine:
    Z = np.atleast_1d(np.asarray(Z, dtype=float))
    y = np.full(Z.size, 0.5 * LENGTH) if y is None else np.atleast_1d(np.asarray(y, dtype=float))
    return CentreLine(
        time=np.full(Z.size, time), frame=np.zeros(Z.size, dtype=int), y=y, Z=Z, sigma=np.full(Z.size, 1e-6)
    )


def outlined(made: CentreLine) -> None:
    check_outline(made, FILE, 0.0, (0.0, 1.0), Toml(), line_of=lambda row: row + 7)


def test_points_lie_before_the_axis_and_a_tenth_around_the_specimen() -> None:
    """The length is 5 mm: y from -0.5 to 5.5 mm."""
    for y in (-0.499e-3, 5.499e-3):
        outlined(line([4e-3, 4e-3], y=[2e-3, y]))
    for y in (-0.501e-3, 5.501e-3):
        assert "file.csv line 8: y above" in refused(outlined, line([4e-3, 4e-3], y=[2e-3, y]))
    assert "file.csv line 8: Z from the axis is 0 mm" in refused(outlined, line([4e-3, 0.0]))


def test_the_outline_at_rest_is_as_high_as_a_specimen_of_the_declared_length() -> None:
    """The length is 5 mm: some point at 1 mm or above."""
    outlined(line([4e-3, 4e-3], y=[1.001e-3, 0.2e-3]))
    said = refused(outlined, line([4e-3, 4e-3], y=[0.999e-3, 0.2e-3]))
    assert "reaches 0.999 mm above the transmission platen; it must reach at least 20 %" in said
    assert "specimen's length of 5 mm" in said
    outlined(line(4e-3, y=0.2e-3, time=0.5))  # no frame at rest says how high it is


def test_no_point_is_further_out_than_three_radii() -> None:
    """The radius is 4 mm: at most 12 mm."""
    outlined(line([4e-3, 4e-3, 11.999e-3]))
    for Z in (12.001e-3, 1e308):
        assert "file.csv line 9: Z from the axis is" in refused(outlined, line([4e-3, 4e-3, Z]))


def test_some_point_lies_in_the_window() -> None:
    outlined(line(4e-3, time=1.0))
    assert "no point is inside the window" in refused(outlined, line(4e-3, time=1.01))


# The quasi-static curve.

RATIO = SimpleNamespace(unit=1.0)
COMPRESSED = SimpleNamespace(branch="compression", convention="tension positive", strain=RATIO)
TENSED = SimpleNamespace(branch="tension", convention="tension positive", strain=RATIO)


def curve(strain: Any, stress: Any, section: Any) -> None:
    strain, stress = np.asarray(strain, dtype=float), np.asarray(stress, dtype=float)
    table: Any = SimpleNamespace(path=FILE, first_line=2)
    check_curve(strain, stress, table, section)


def test_a_curve_has_five_points_away_from_rest() -> None:
    strain = -0.1 * np.arange(6)
    curve(strain, 1e3 * strain, COMPRESSED)
    assert "has 4 points away from rest" in refused(curve, strain[:5], 1e3 * strain[:5], COMPRESSED)


@pytest.mark.parametrize(
    ("row", "strain", "stress", "words"),
    [
        (2, 0.2, 200.0, "the strain is in tension"),
        (3, -1.0, -1e3, "would leave no length"),
        (2, -0.2, 200.0, "opposite sign"),
        (0, 0.0, 1.0, "at zero strain"),
        (3, -0.2, -200.0, "does not move on"),
    ],
)
def test_a_curve_is_one_branch_of_one_sign(row: int, strain: float, stress: float, words: str) -> None:
    e = -0.1 * np.arange(6)
    s = 1e3 * e
    e[row], s[row] = strain, stress
    said = refused(curve, e, s, COMPRESSED)
    assert f"file.csv line {row + 2}: " in said
    assert words in said


def test_strains_beyond_twenty_are_none() -> None:
    strain = np.linspace(0.0, 20.0, 6)
    curve(strain, 1e3 * strain, TENSED)
    assert "is not a strain of an elastomer" in refused(curve, 1.001 * strain, 1e3 * strain, TENSED)


@pytest.mark.parametrize(
    ("value", "unit", "written"),
    [
        (9.5e-3, "m", "9.5 mm"), (4e-6, "m", "4 um"), (-9.99e-5, "m", "-99.9 um"), (1e-4, "m", "0.1 mm"),
        (0.0, "m", "0 mm"), (25e-6, "s", "25 us"), (0.0999, "s", "99900 us"),
        (58.300025, "s", "58.300025000 s"), (870.0, "kg/m^3", "870 kg/m^3"), (3341, "", "3341"),
        ("bonded", "", "bonded"),
    ],
)  # fmt: skip
def test_a_length_below_a_tenth_of_a_millimetre_is_in_micrometres(
    value: float | str, unit: str, written: str
) -> None:
    assert Entry("a", "b", value, unit).written() == written
