"""Options that several commands share, and the shot that a command is about.

A record of options, such as `SolverOptions`, is spread over the signature of a command when the program is
made, see `with_settings`.
"""

import functools
import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.terminal import quietly

if TYPE_CHECKING:
    from kolsky.inverse.forward import Numerics
    from kolsky.pictures.picture_set import PictureSet
    from kolsky.shot.records import OpticalData, Shot


ShotPath = Annotated[Path, typer.Argument(metavar="SHOT", help="A shot's folder, or its shot.toml.")]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="FOLDER", help="Where results go.", show_default="SHOT/results"),
]
OutFolder = Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Where results go.")]
Figures = Annotated[
    str, typer.Option(metavar="FORMATS", help="Also save each figure as a file, e.g. pdf,svg,png,csv.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object (SI units) instead of a table.")]

Numbers = Annotated[
    list[str] | None,
    typer.Option(
        "-p", "--parameter", metavar="NAME=VALUE", help="Hold a parameter at this value (SI or with unit)."
    ),
]
Mesh = Annotated[str, typer.Option(metavar="NRxNY", help="Elements across the radius x along the length.")]
Precision = Annotated[str, typer.Option(help="Arithmetic of the solver: fp64 or fp32.")]
Device = Annotated[str, typer.Option(help='"cpu", a CUDA device such as "cuda:0", or "cuda".')]
Threads = Annotated[int | None, typer.Option(min=1, help="CPU threads.", show_default="all cores")]

HeaderLine = Annotated[
    int | None, typer.Option(min=0, help="Line of the column names; 0: none.", show_default="found")
]


@dataclass(frozen=True)
class SolverOptions:
    """Numerical choices of the solver as the command line gives them.

    Every field is an option of a command that has a parameter of this type, see `with_settings`.
    """

    element: Annotated[
        str,
        typer.Option(help="one_point, or fbar: fully integrated, three times as expensive."),
    ] = "one_point"
    hourglass: Annotated[str, typer.Option(help="Hourglass control of one_point: stiffness or viscous.")] = (
        "stiffness"
    )
    nearly_incompressible: Annotated[
        bool,
        typer.Option(
            "--nearly-incompressible",
            help="Run at poisson = 0.495 and correct it on coarser meshes: cheaper above 0.499.",
        ),
    ] = False
    precision: Precision = "fp64"
    device: Device = "cpu"
    threads: Threads = None
    past_data: Annotated[
        str,
        typer.Option(
            metavar="CHOICE",
            help="Beyond the last point of the quasi-static curve: continue on its tangent, or stop the run.",
        ),
    ] = "continue"

    def numerics(self, mesh: tuple[int, int]) -> "Numerics":
        """Settings of the solver on a mesh.

        ``mesh``: elements across the radius and along the length. Raises InputError if the precision, the
        element or the hourglass control is unknown, or the machine has no such device.
        """
        from explicit.device import select_device
        from explicit.elements import ELEMENTS
        from explicit.incompressible import COMPRESSIBLE
        from kolsky.inverse.forward import Numerics

        texts.one_of("--precision", self.precision, ("fp64", "fp32"))
        texts.one_of("--past-data", self.past_data, ("continue", "stop"))
        texts.one_of("--element", self.element, tuple(ELEMENTS))
        texts.one_of("--hourglass", self.hourglass, ("stiffness", "viscous"))
        try:
            select_device(self.device)
        except ValueError as error:
            raise InputError(
                texts.COMMAND_LINE,
                f"--device: {error}",
                cure="give cpu, cuda or cuda:N; `kolsky doctor` lists the devices",
            ) from None
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


Quiet = Annotated[
    bool,
    typer.Option("--quiet", "-q", help="Print the answer and its warnings only: no progress, no wall time."),
]


def with_settings(command: Callable[..., None]) -> Callable[..., None]:
    """Make one option of every field of a command's records, and add `--quiet`.

    ``command``: a function of typed options. The fields of a parameter whose type is a dataclass take its
    place in the signature; their annotations are `typer.Option`, and the record is made from what was given.
    """
    hints = get_type_hints(command, include_extras=True)
    records: dict[str, Any] = {name: hint for name, hint in hints.items() if is_dataclass(hint)}
    parameters: list[inspect.Parameter] = []
    for parameter in inspect.signature(command).parameters.values():
        if parameter.name not in records:
            parameters.append(parameter.replace(annotation=hints[parameter.name]))
            continue
        record = records[parameter.name]
        given = parameter.default
        annotations = get_type_hints(record, include_extras=True)
        parameters += [
            parameter.replace(
                name=field.name,
                default=field.default if given is inspect.Parameter.empty else getattr(given, field.name),
                annotation=annotations[field.name],
            )
            for field in fields(record)
        ]
    parameters.append(
        inspect.Parameter("quiet", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Quiet)
    )

    @functools.wraps(command)
    def spread(*, quiet: bool = False, **given: Any) -> None:
        made = {
            name: record(**{field.name: given.pop(field.name) for field in fields(record)})
            for name, record in records.items()
        }
        with quietly(quiet):
            command(**given, **made)

    spread.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    spread.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    del spread.__wrapped__  # type: ignore[attr-defined]
    return spread


def load(shot: Path, out: Path | None, *inside: str, forks: bool = True) -> "tuple[Shot, Path]":
    """The shot, and the folder its results go to: refused now if unusable, not after the work.

    Parameters
    ----------
    shot
        A shot's folder, or its shot.toml.
    out
        Where results go; by default the folder "results" of the shot.
    inside
        Folders inside it.
    forks
        Whether pictures may be correlated by several processes.

    Raises
    ------
    InputError
        If the shot cannot be used, or the folder cannot be written to.
    """
    from kolsky.base.files import usable_folder
    from kolsky.cli.terminal import progress_bars
    from kolsky.schema.shot_file import folder_of
    from kolsky.shot.load import load_shot

    place = out or folder_of(shot) / "results"

    def measure(pictures: "PictureSet") -> "OpticalData":
        from dic.processes import allow_forks
        from kolsky.base.process import keep_freed_memory
        from kolsky.shot.optical_data import measured

        keep_freed_memory()
        with progress_bars() as progress, allow_forks() if forks else nullcontext():
            return measured(pictures, usable_folder(place), progress=progress)

    loaded = load_shot(shot, measure=measure)
    return loaded, usable_folder(place.joinpath(*inside))


@contextmanager
def usable(shot: "Shot") -> Iterator[None]:
    """Make bad input of a shot that cannot be worked with: one line, exit code 2."""
    try:
        yield
    except ValueError as error:
        raise InputError(
            shot.folder,
            str(error),
            cure="correct shot.toml or the option that it names; `kolsky check` shows what was read",
        ) from error
