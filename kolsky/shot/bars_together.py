"""The bars' wave speed and the gauges' relative gain from a shot with the bars together."""

from pathlib import Path

from kolsky.bars.guides.bars_together import BarsTogether, wave_speed
from kolsky.bars.records import BarSignal
from kolsky.bars.reduction.inputs import SIDES
from kolsky.bars.reduction.varied_test import station_of
from kolsky.bars.reduction.windows import averaging_time, incident_arrival
from kolsky.base.errors import InputError
from kolsky.base.files import write_table
from kolsky.shot.bars import load_bars
from kolsky.shot.schema.reading import folder_of


def wave_speed_of(shot: str | Path) -> tuple[str, BarsTogether, tuple[str, ...]]:
    """Name, wave speed and relative gain of a shot with the bars together, and notes on its files.

    Parameters
    ----------
    shot
        A shot's folder, or its shot.toml with the tables bars, recorders and gauges.

    Raises
    ------
    InputError
        If the shot or its files cannot be used.
    """
    given = load_bars(Path(shot))
    try:
        incident, transmission = (station_of(given, side).signal for side in SIDES)
        found = fit_first_pulse(incident, transmission, tension=given.load == "tension")
    except ValueError as error:
        raise InputError(
            folder_of(Path(shot)), str(error), cure="correct the gauge or bar that it names in shot.toml"
        ) from error
    return given.name, found, given.notes


def fit_first_pulse(incident: BarSignal, transmission: BarSignal, *, tension: bool) -> BarsTogether:
    """Fit wave speed and gain over the pulse up to its first echo; once more where the speed found moves
    that echo.

    Parameters
    ----------
    incident, transmission
        Strain of the two gauges.
    tension
        Whether the first pulse pulls.

    Raises
    ------
    ValueError
        If no pulse is found, or the signals do not hold it.
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


def write_residual(path: Path, found: BarsTogether) -> Path:
    """Write the measured strain and what the fit leaves of it over time."""
    return write_table(
        path,
        {
            "time (s)": found.time.tolist(),
            "measured strain": found.measured.tolist(),
            "fitted less measured": found.residual.tolist(),
        },
    )


def summary(found: BarsTogether) -> dict[str, object]:
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
