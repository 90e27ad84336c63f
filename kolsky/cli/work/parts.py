"""What the commands have in common: numerical choices, loading a shot, refusing it, saying how it ended.

Standard output holds the answer, with `--json` exactly one object; all else goes to standard error.
"""

import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from kolsky.base.errors import InputError
from kolsky.base.files import usable_folder
from kolsky.cli.progress import bars
from kolsky.cli.work import options
from kolsky.report import printed
from kolsky.shot.load import load_shot
from kolsky.shot.picture_set import PictureSet
from kolsky.shot.records import OpticalData, Shot
from kolsky.shot.schema.reading import folder_of


@dataclass(frozen=True)
class Arithmetic:
    """Precision, device, threads, the end of the data and the element as given on the command line."""

    precision: str
    device: str
    threads: int | None
    past_data: str = "continue"
    element: str = "one_point"
    hourglass: str = "stiffness"
    nearly_incompressible: bool = False

    def numerics(self, mesh: tuple[int, int]) -> Any:
        """The solver's numerical choices.

        Raises
        ------
        InputError
            If the precision, the element or the hourglass control is unknown, or the machine has no such
            device.
        """
        from explicit.device import select_device
        from explicit.elements import ELEMENTS
        from explicit.incompressible import COMPRESSIBLE
        from kolsky.inverse.forward import Numerics

        options.one_of("--precision", self.precision, ("fp64", "fp32"))
        options.one_of("--past-data", self.past_data, ("continue", "stop"))
        options.one_of("--element", self.element, tuple(ELEMENTS))
        options.one_of("--hourglass", self.hourglass, ("stiffness", "viscous"))
        try:
            select_device(self.device)
        except ValueError as error:
            raise InputError(options.COMMAND_LINE, f"--device: {error}") from None
        return Numerics(
            mesh=mesh,
            precision="fp32" if self.precision == "fp32" else "fp64",
            device=self.device,
            threads=self.threads,
            past_data="stop" if self.past_data == "stop" else "continue",
            element=self.element,
            hourglass_form="viscous" if self.hourglass == "viscous" else "stiffness",
            compressible=COMPRESSIBLE if self.nearly_incompressible else None,
        )


def failure(ending: Any) -> dict[str, Any]:
    """When, where and why a run ended."""
    r, y = ending.place
    return {
        "end_time": ending.time,
        "element": ending.element,
        "element_place": {"R": r, "Y": y},
        "cause": ending.outcome.cause,
        "cure": ending.outcome.cure,
    }


def load(shot: Path, out: Path | None, *inside: str) -> tuple[Shot, Path]:
    """The shot, and the folder its results go to: refused now if unusable, not after the work."""
    place = out or folder_of(shot) / "results"

    def measure(pictures: PictureSet) -> OpticalData:
        from kolsky.shot.optical_data import measured

        with bars() as progress:
            return measured(pictures, usable_folder(place), progress=progress)

    loaded = load_shot(shot, measure=measure)
    return loaded, usable_folder(place.joinpath(*inside))


@contextmanager
def usable(shot: Shot) -> Iterator[None]:
    """A shot that cannot be worked with is bad input: one line, exit code 2."""
    try:
        yield
    except ValueError as error:
        raise InputError(shot.folder, str(error)) from error


def since(started: float) -> str:
    """Seconds since `started`, as printed."""
    return f"{perf_counter() - started:.1f} s"


def tell(
    answers: list[str],
    rows: Mapping[str, Any],
    said: Any,
    *,
    rest: Mapping[str, Any],
    warnings: Iterable[str],
) -> None:
    """The answer on stdout, as lines or as one JSON object; with JSON, the rest goes to stderr."""
    if said is None:
        print("\n".join([*answers, *printed.columns({**rows, **rest})]))
    else:
        print(json.dumps(said, indent=2, allow_nan=False))
        print("\n".join(printed.columns(rest)), file=sys.stderr)
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
