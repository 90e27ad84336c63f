"""Options that several commands share, each typed once."""

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts

if TYPE_CHECKING:
    from kolsky.inverse.forward import Numerics

ShotPath = Annotated[Path, typer.Argument(metavar="SHOT", help="A shot's folder, or its shot.toml.")]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="FOLDER", help="Where results go.", show_default="SHOT/results"),
]
OutFolder = Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Where results go.")]
Figures = Annotated[
    str, typer.Option(metavar="FORMATS", help="Also save each figure alone, e.g. pdf,svg,png,csv.")
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
PastData = Annotated[
    str,
    typer.Option(
        metavar="CHOICE",
        help="Past the last point of the quasi-static curve the law continues on its tangent (continue), or "
        "the run ends (stop).",
    ),
]
Element = Annotated[
    str,
    typer.Option(help="one_point, or fbar: fully integrated, nothing to tune, three times as expensive."),
]
Hourglass = Annotated[str, typer.Option(help="Hourglass control of one_point: stiffness or viscous.")]
Corrected = Annotated[
    bool,
    typer.Option(
        "--nearly-incompressible",
        help="Run the mesh at poisson = 0.495 and correct to the wanted one on coarser meshes: cheaper from "
        "0.499 on.",
    ),
]

HeaderLine = Annotated[
    int | None, typer.Option(min=0, help="Line of the column names; 0: none.", show_default="found")
]


@dataclass(frozen=True)
class SolverOptions:
    """Numerical choices of the solver as the command line gives them.

    A command with a parameter of this type has every field as an option of its own, see
    `with_solver_options`.
    """

    element: Element = "one_point"
    hourglass: Hourglass = "stiffness"
    nearly_incompressible: Corrected = False
    precision: Precision = "fp64"
    device: Device = "cpu"
    threads: Threads = None
    past_data: PastData = "continue"

    def numerics(self, mesh: tuple[int, int]) -> "Numerics":
        """Settings of the solver on a mesh.

        Parameters
        ----------
        mesh
            Elements across the radius and along the length.

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


SOLVER_DEFAULTS = SolverOptions()
"""Defaults of the solver's options."""


def with_solver_options(command: Callable[..., None]) -> Callable[..., None]:
    """Put the fields of `SolverOptions`, as options, where a command has a parameter of that type.

    Parameters
    ----------
    command
        A function of typed options; one without such a parameter is returned as it is.
    """
    hints = get_type_hints(command, include_extras=True)
    name = next((name for name, hint in hints.items() if hint is SolverOptions), None)
    if name is None:
        return command
    choices = get_type_hints(SolverOptions, include_extras=True)

    @functools.wraps(command)
    def spread(**given: Any) -> None:
        solver = SolverOptions(**{field.name: given.pop(field.name) for field in fields(SolverOptions)})
        command(**given, **{name: solver})

    parameters: list[inspect.Parameter] = []
    for parameter in inspect.signature(command).parameters.values():
        if parameter.name == name:
            for field in fields(SolverOptions):
                annotation = choices[field.name]
                parameters.append(
                    inspect.Parameter(
                        field.name, parameter.kind, default=field.default, annotation=annotation
                    )
                )
        else:
            parameters.append(parameter.replace(annotation=hints[parameter.name]))
    spread.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    spread.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    del spread.__wrapped__  # type: ignore[attr-defined]
    return spread
