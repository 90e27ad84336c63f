"""`kolsky plan`: where and when a measurement would tell most, and how well parameters would be known."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

from kolsky.base.errors import InputError
from kolsky.base.files import filling
from kolsky.base.units import UnitError, quantity
from kolsky.cli.progress import bars
from kolsky.cli.work import options
from kolsky.cli.work.parts import Arithmetic, load, since, tell, usable
from kolsky.report.formats import FIGURES


@dataclass(frozen=True)
class Wishes:
    """What the planned instruments can do, as texts of the command line; empty: as the shot's own."""

    outline_sigma: str = ""
    force_sigma: str = ""
    frame_rate: str = ""
    points: str = ""
    clearance: str = ""
    window: str = ""
    rates: str = ""
    heights: str = ""
    discrepancy: str = "mesh"

    def changes(self) -> dict[str, Any]:
        """Fields of `kolsky.studies.planning.instruments.Instruments` that are not the shot's own, SI."""
        found: dict[str, Any] = {}
        for field, option, unit in (
            ("outline_sigma", "--outline-sigma", "m"),
            ("force_sigma", "--force-sigma", "N"),
            ("points", "--points", "1/m"),
            ("clearance", "--clearance", "m"),
        ):
            text = getattr(self, field)
            if text:
                found[field] = _quantity(option, text, unit)
        if self.frame_rate:
            rate = _quantity("--frame-rate", self.frame_rate, "1/s")
            if not rate > 0.0:
                raise InputError(
                    options.COMMAND_LINE, "must be > 0", key="--frame-rate", value=self.frame_rate
                )
            found["frame_interval"] = 1.0 / rate
        if self.window:
            ends = self.window.split(":")
            if len(ends) != 2:
                raise InputError(
                    options.COMMAND_LINE,
                    f"--window {self.window!r} cannot be read",
                    cure='write START:END, e.g. "0 ms:1.2 ms"',
                )
            found["window"] = tuple(_quantity("--window", end, "s") for end in ends)
        return found


def plan(
    shot: Path,
    *,
    free: Sequence[str],
    held: Mapping[str, float],
    wishes: Wishes,
    reach: float,
    mesh: tuple[int, int],
    arithmetic: Arithmetic,
    out: Path | None,
    formats: Sequence[str],
    as_json: bool,
) -> None:
    """Foretell what a test like the shot would tell, write and print.

    Parameters
    ----------
    shot
        A shot's folder, or its shot.toml.
    free
        Parameters to be estimated together; the usual three if empty.
    held
        Values of parameters that are not the shot's own.
    wishes
        What the planned instruments can do.
    reach
        Range of the slopes over the parameters' scales.
    mesh, arithmetic
        Numerical choices.
    out
        Where results go.
    formats
        Also save the figures, in these formats.
    as_json
        Print one JSON object instead of a table.

    Raises
    ------
    InputError
        If an option cannot be read, the shot cannot be used, or results cannot be written.
    """
    started = perf_counter()
    for name in formats:
        options.one_of("--figures", name, FIGURES)
    options.one_of("--discrepancy", wishes.discrepancy, ("mesh", "none"))
    changes = wishes.changes()
    names = tuple(options.ranges("--free", [_bare(name) for name in free])) if free else None
    rates = _numbers("--rates", wishes.rates)
    counts = _numbers("--heights", wishes.heights)
    if any(count != round(count) or count < 1.0 for count in counts):
        raise InputError(
            options.COMMAND_LINE, "must be whole numbers from 1", key="--heights", value=wishes.heights
        )
    loaded, folder = load(shot, out)
    numerics = arithmetic.numerics(mesh)
    from kolsky.report.canvas import save_figures
    from kolsky.report.figures import PLANS
    from kolsky.studies.planning import output
    from kolsky.studies.planning import plan as planned
    from kolsky.studies.planning.instruments import instruments_of

    with usable(loaded), bars() as progress:
        found = planned.plan(
            loaded,
            names=names or planned.NAMES,
            held=held,
            instruments=lambda prepared: replace(instruments_of(prepared), **changes),
            rates=rates or planned.RATES,
            heights=[int(count) for count in counts] or (1, 2, 3),
            reach=reach,
            discrepancy=(0.0, 0.0) if wishes.discrepancy == "none" else None,
            numerics=numerics,
            progress=progress,
        )
    said = output.to_json(found)
    with filling(folder) as partial:
        output.write_hdf5(partial / "plan.h5", found)
        output.write_csv(partial, found)
        (partial / "plan.json").write_text(json.dumps(said, indent=2, allow_nan=False), encoding="utf-8")
        if formats:
            save_figures(partial / "figures", found, formats=tuple(formats), registry=PLANS)
    tell(
        [],
        output.rows(found),
        said if as_json else None,
        rest={"folder": folder, "wall time": since(started)},
        warnings=[f"{part}: {e.unseen}" for part, e in found.expected.items() if e.unseen],
    )


def _bare(text: str) -> str:
    if "=" in text:
        raise InputError(
            options.COMMAND_LINE,
            f"--free {text!r}: a plan has no bounds",
            cure=f"write --free {text.partition('=')[0]}, and its value with -p",
        )
    return text


def _quantity(option: str, text: str, unit: str) -> float:
    try:
        return quantity(text, unit)
    except UnitError as error:
        raise InputError(options.COMMAND_LINE, f"{option} {text!r}: {error}") from None


def _numbers(option: str, text: str) -> list[float]:
    """ "0.5, 1, 2" as numbers."""
    try:
        return [float(part) for part in text.split(",") if part.strip()]
    except ValueError:
        raise InputError(
            options.COMMAND_LINE,
            f"{option} {text!r} cannot be read",
            cure="write numbers with commas, e.g. 1,2",
        ) from None
