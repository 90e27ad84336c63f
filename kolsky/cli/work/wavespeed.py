"""`kolsky wavespeed`: c0 and the gauges' relative gain from a shot with the bars together."""

from collections.abc import Sequence
from pathlib import Path

from kolsky.bars.guides.bars_together import BarsTogether, wave_speed
from kolsky.bars.records import BarSignal
from kolsky.bars.reduction.inputs import SIDES
from kolsky.bars.reduction.varied_test import station_of
from kolsky.bars.reduction.windows import averaging_time, incident_arrival
from kolsky.base.errors import InputError
from kolsky.base.files import filling, usable_folder, write_table
from kolsky.cli.work import options
from kolsky.cli.work.parts import tell
from kolsky.report.formats import FIGURES
from kolsky.shot.bars import load_bars
from kolsky.shot.schema.reading import folder_of


def wavespeed(shot: Path, *, out: Path | None, formats: Sequence[str], as_json: bool) -> None:
    """Fit, write and print.

    Parameters
    ----------
    shot
        A shot's folder, or its shot.toml.
    out
        Where results go; by default the folder "results" of the shot.
    formats
        Also save the figure, in these formats.
    as_json
        Print one JSON object instead of a table.

    Raises
    ------
    InputError
        If the shot or its files cannot be used, or results cannot be written.
    """
    for name in formats:
        options.one_of("--figures", name, FIGURES)
    given = load_bars(shot)
    folder = usable_folder(out or folder_of(shot) / "results")
    try:
        incident, transmission = (station_of(given, side).signal for side in SIDES)
        found = _fitted(incident, transmission, given.load == "tension")
    except ValueError as error:
        raise InputError(folder_of(shot), str(error)) from error
    with filling(folder) as partial:
        write_table(
            partial / "wavespeed.csv",
            {
                "time (s)": found.time.tolist(),
                "measured strain": found.measured.tolist(),
                "fitted less measured": found.residual.tolist(),
            },
        )
        if formats:
            from kolsky.report.canvas import save_figures
            from kolsky.report.figures import BARS_TOGETHER

            save_figures(partial / "figures", found, formats=tuple(formats), registry=BARS_TOGETHER)
    tell(
        [],
        {
            "shot": given.name,
            "wave speed c0": f"{found.wave_speed:.2f} ± {2.0 * found.wave_speed_sigma:.2f} m/s (k = 2)",
            "gain, transmission over incident": f"{found.gain:.5f} ± {2.0 * found.gain_sigma:.5f} (k = 2)",
            "residual, rms of peak": f"{100.0 * found.rms:.2f} %",
            "residual, largest of peak": f"{100.0 * found.largest:.2f} %",
            "plain shift, rms": f"{100.0 * found.plain_rms:.2f} % at {found.plain_wave_speed:.1f} m/s",
            "by Poisson's ratio": f"{found.by_poisson:.3g} m/s per unit",
            "by distance": f"{found.wave_speed / found.distance * 1e-3:.3g} m/s per mm",
        },
        _said(given.name, found) if as_json else None,
        rest={"residual": folder / "wavespeed.csv"},
        warnings=[],
    )


def _fitted(incident: BarSignal, transmission: BarSignal, tension: bool) -> BarsTogether:
    """The fit over the pulse up to its first echo; once more where the speed found moves that echo."""
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


def _said(name: str, found: BarsTogether) -> dict[str, object]:
    return {
        "shot": name,
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
