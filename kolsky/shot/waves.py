"""Tests reduced by classical means: one test, repeated tests with their mean curve, bars pressed together."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kolsky.bars.audit import Switches
from kolsky.bars.guides.propagation import BarsTogether, wave_speed
from kolsky.bars.records import BarSignal, ReducedTest, Reduction
from kolsky.bars.reduction.analyse import analyse
from kolsky.bars.reduction.inputs import SIDES
from kolsky.bars.reduction.repeated_tests import RepeatedTests, repeated_tests
from kolsky.bars.reduction.varied_test import station_of
from kolsky.bars.reduction.windows import averaging_time, incident_arrival
from kolsky.base.errors import InputError
from kolsky.schema.apparatus import UncertaintySection
from kolsky.schema.bars import WavesSection
from kolsky.schema.shot_file import Source, folder_of, is_bar_driven, parsed, shot_toml
from kolsky.shot.bars import declared_settings, load_bars, load_waves
from kolsky.shot.flyer_test import FlyerInput, analyse_flyer
from kolsky.shot.force import incident_channel
from kolsky.shot.load import load_shot
from kolsky.shot.records import Shot

__all__ = ["waves"]


def _load_flyer_test(source: Source, shot: Shot) -> FlyerInput:
    """Load a flyer test for `kolsky waves`."""
    toml = shot_toml(source)
    declared = toml.declared
    section = declared.incident_force
    incident = incident_channel(toml)
    waves = declared.waves or WavesSection()
    if "analysis" in waves.model_fields_set:
        raise toml.error(
            "waves.analysis",
            "is for tests between bars; a flyer test quotes the stress at each face",
            cure="remove it",
        )
    return FlyerInput(
        shot=shot,
        incident=incident,
        mass=0.0 if section is None else section.mass,
        pictured=declared.flyer is None and declared.pictures is not None,
        share=waves.share,
        switches=Switches(waves.corrections),
        uncertainty={
            key: value
            for key, value in (declared.uncertainty or UncertaintySection()).for_waves().items()
            if not isinstance(value, bool)
        },
        settings=declared_settings(toml.content),
    )


Progress = Callable[[str, int, int], None]


def waves(
    shot: str | Path,
    *,
    results: Path | None = None,
    progress: Progress = lambda stage, done, total: None,
) -> ReducedTest:
    """Forces, strain, rate and stress of a test by classical means, with corrections and budget.

    Parameters
    ----------
    shot
        A shot's folder, or its shot.toml.
    results
        Where the surfaces of a shot with pictures are kept; by default the folder "results" of the shot.
    progress
        Told of the steps done, stage by stage.

    Returns
    -------
    ReducedTest
        `kolsky.bars.records.WavesResult` of a test between bars, `kolsky.bars.records.FlyerResult` of a
        flyer's.

    Raises
    ------
    InputError
        If the shot or its files cannot be used.

    Examples
    --------
    >>> import kolsky
    >>> result = kolsky.waves("runs/bar-01")
    >>> result.analysis
    'three waves'
    """
    file = parsed(shot)
    try:
        if "gauges" in file.content or is_bar_driven(file):
            return analyse(load_waves(file), progress=progress)
        from kolsky.shot.optical_data import measured  # brings image correlation: for pictures only

        loaded = load_shot(file, measure=lambda pictures: measured(pictures, results, progress=progress))
        return analyse_flyer(_load_flyer_test(loaded.file or file, loaded), progress=progress)
    except ValueError as error:
        raise InputError(
            file.path.parent, str(error), cure="correct the gauge or bar that it names in shot.toml"
        ) from error


@dataclass(frozen=True)
class RepeatedShots:
    """Repeats of one test, with their mean."""

    names: tuple[str, ...]
    """Names of the shots, in the order of the rows of `mean.repeats.values`."""
    mean: RepeatedTests
    """Mean stress over strain, with its band."""

    def columns(self) -> dict[str, list[float]]:
        """The mean, its 95 % band and every test over strain, as columns of a table."""
        low, high = self.mean.band()
        together = self.mean.repeats
        return {
            "strain (1)": together.axis.tolist(),
            "mean stress (Pa)": together.mean.tolist(),
            "low end of the 95 % band (Pa)": low.tolist(),
            "high end of the 95 % band (Pa)": high.tolist(),
            "scatter between tests (Pa)": together.scatter.tolist(),
            "shared standard uncertainty (Pa)": self.mean.shared.tolist(),
            **{f"{name} (Pa)": row.tolist() for name, row in zip(self.names, together.values, strict=True)},
        }

    def summary(self) -> dict[str, Any]:
        """The largest mean stress with its band, for JSON, SI."""
        low, high = self.mean.band()
        together = self.mean.repeats
        at = int(abs(together.mean).argmax())
        return {
            "tests": list(self.names),
            "strain_range": [float(together.axis[0]), float(together.axis[-1])],
            "largest_mean_stress": {
                "value": float(together.mean[at]),
                "band": [float(low[at]), float(high[at])],
                "strain": float(together.axis[at]),
                "scatter": float(together.scatter[at]),
                "unit": self.mean.unit,
            },
            "remarks": list(together.remarks),
        }


def repeats(
    shots: Sequence[str | Path],
    *,
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
) -> RepeatedShots:
    """Reduce repeats of one test between bars and average their stress over strain.

    Parameters
    ----------
    shots
        Shots' folders, or their shot.toml files; two or more.
    progress
        Told of the shots done.

    Raises
    ------
    InputError
        If two shots have one name, or one cannot be used.
    ValueError
        If there are fewer than two shots, or they have no strains in common.
    """
    paths = [Path(shot) for shot in shots]
    given = [load_waves(path) for path in paths]  # bad input is refused before any work
    found: dict[str, Reduction] = {}
    for number, (path, one) in enumerate(zip(paths, given, strict=True)):
        progress("repeats", number, len(paths))
        if one.name in found:
            raise InputError(
                folder_of(path), f"another shot is called {one.name!r} too", cure="give each its own name"
            )
        try:
            found[one.name] = analyse(one).reduction
        except ValueError as error:
            raise InputError(
                folder_of(path), str(error), cure="correct the gauge or bar that it names in shot.toml"
            ) from error
    progress("repeats", len(paths), len(paths))
    return RepeatedShots(tuple(found), repeated_tests(found))


def wave_speed_of(shot: str | Path) -> tuple[str, BarsTogether, tuple[str, ...]]:
    """Name, wave speed and relative gain of a shot with the bars together, and notes on its files.

    ``shot``: a shot's folder, or its shot.toml with the tables bars, recorders and gauges. Raises InputError
    if the shot or its files cannot be used.
    """
    given = load_bars(Path(shot))
    try:
        incident, transmission = (station_of(given, side).signal for side in SIDES)
        found = _fit_first_pulse(incident, transmission, tension=given.load == "tension")
    except ValueError as error:
        raise InputError(
            folder_of(Path(shot)), str(error), cure="correct the gauge or bar that it names in shot.toml"
        ) from error
    return given.name, found, given.notes


def _fit_first_pulse(incident: BarSignal, transmission: BarSignal, *, tension: bool) -> BarsTogether:
    """Fit wave speed and gain over the pulse up to its first echo; once more where the speed found moves
    that echo.
    """
    speed = incident.bar.wave_speed
    for _ in range(2):
        arrival = incident_arrival(incident, tension=tension)
        lead = 2.0 * averaging_time(incident)
        first = min(arrival.time, arrival.onset) - lead
        way = (incident.position + transmission.position) / speed
        # The pulse returns from the nearer of the far ends; nothing else reaches a gauge before.
        free = min(2.0 * (s.bar.length - s.position) for s in (incident, transmission)) / speed
        last = min(arrival.time + free - lead, transmission.strain.end - way)
        found = wave_speed(
            incident,
            transmission,
            incident_window=(incident.strain.start, incident.strain.end),  # what comes later is not compared
            transmitted_window=(first + way, last + way),
        )
        speed = found.wave_speed
    return found


def residual_columns(found: BarsTogether) -> dict[str, list[float]]:
    """The measured strain and what the fit leaves of it over time, as named columns."""
    return {
        "time (s)": found.time.tolist(),
        "measured strain": found.measured.tolist(),
        "fitted less measured": found.residual.tolist(),
    }


def wave_speed_summary(found: BarsTogether) -> dict[str, object]:
    """The numbers of the fit for JSON, SI."""
    return {
        "wave_speed": {
            "value": found.wave_speed,
            "sigma": found.wave_speed_sigma,
            "unit": "m/s",
            "by_poisson": found.by_poisson,
        },
        "gain": {"value": found.gain, "sigma": found.gain_sigma, "unit": "1"},
        "rms": found.rms,
        "largest": found.largest,
        "plain_rms": found.plain_rms,
        "plain_wave_speed": found.plain_wave_speed,
        "band": found.band if found.band < float("inf") else None,
    }
