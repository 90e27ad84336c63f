"""`kolsky specimen fit`: constants of a law fitted to whole specimens in slow tests."""

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.options import AsJson, Device, Figures

if TYPE_CHECKING:
    from kolsky.specimen.reading import Specification
    from kolsky.specimen.studies import StudyRow

SpecPath = Annotated[Path, typer.Argument(metavar="SPEC", help="A SPEC.toml: material, specimens, files.")]
OutOfSpec = Annotated[
    Path | None,
    typer.Option("--out", metavar="FOLDER", help="Where results go.", show_default="SPEC's name/results"),
]


def specimen_fit(
    spec: SpecPath,
    out: OutOfSpec = None,
    resolution: Annotated[
        str,
        typer.Option(
            metavar="FACTORS", help="Also fit on meshes this many times as fine as 20 x 5 x 1 cells."
        ),
    ] = "",
    noise: Annotated[
        str, typer.Option(metavar="SIGMAS", help="Also fit with noise of these sizes added to the force [N].")
    ] = "",
    draws: Annotated[int, typer.Option(min=1, help="Draws of each size of --noise.")] = 3,
    steps_alone: Annotated[
        bool, typer.Option("--steps-alone", help="Of a sheet, also fit every step alone.")
    ] = False,
    stiffness_map: Annotated[
        str,
        typer.Option("--map", metavar="NXxNY", help="Of a sheet, also map its stiffness by so many blocks."),
    ] = "",
    vtu: Annotated[bool, typer.Option("--vtu", help="Also write the last sample for ParaView.")] = False,
    stills: Annotated[
        bool, typer.Option("--stills", help="Also draw the last sample in 3-D by PyVista (extra: scene).")
    ] = False,
    device: Device = "cpu",
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Fit a law to whole specimens: their force curves, or a sheet's displacement field and pad force.

    Writes specimen.html, specimen.json, specimen.h5, tables, and the fitted law as curves that a shot.toml
    can name.
    """
    started = perf_counter()
    formats = texts.figure_formats(figures)
    factors = texts.whole_numbers("--resolution", resolution) if resolution else []
    sigmas = texts.numbers("--noise", noise) if noise else []
    blocks = texts.mesh("--map", stiffness_map) if stiffness_map else None
    from kolsky.base.files import usable_folder
    from kolsky.cli.terminal import print_result, since
    from kolsky.specimen.reading import read_specification

    if stills:
        _require_drawing()
    read = read_specification(spec, device=device)
    folder = usable_folder(out or read.toml.path.with_suffix("") / "results")
    if read.declared.field is not None:
        if factors or sigmas:
            option = "--resolution" if factors else "--noise"
            raise InputError(texts.COMMAND_LINE, "is for force curves", key=option, cure="remove it")
        shown = {"vtu": vtu, "stills": stills, "as_json": as_json}
        _fit_sheet(read, folder, started, formats, alone=steps_alone, blocks=blocks, **shown)
        return
    if steps_alone or blocks:
        option = "--steps-alone" if steps_alone else "--map"
        raise InputError(texts.COMMAND_LINE, "is for a sheet", key=option, cure="remove it")
    from kolsky.report.pages.specimen import constant_rows, printed
    from kolsky.report.specimen_folder import write_specimen_results
    from kolsky.report.specimen_view import view_of
    from kolsky.specimen import output
    from kolsky.specimen.fit import fit

    groups = read.declared.fit.together or {name: [name] for name in read.samples}
    if not read.samples:
        raise read.toml.error("tests", "have no data", cure="name a file, or `kolsky specimen simulate`")
    fits = []
    for name, members in groups.items():
        others = [read.test(other) for other in read.samples if other not in members]
        try:
            fits.append(
                fit(
                    name,
                    [read.test(member) for member in members],
                    read.constants,
                    predicted=others,
                    starts=read.declared.fit.starts,
                    seed=read.declared.fit.seed,
                    method=read.declared.fit.method,
                )
            )
        except ValueError as error:
            raise read.toml.error(f"fit.together.{name}", f"cannot be fitted: {error}") from None
    view = view_of(read.name, fits)
    studies = _studies(read, factors, sigmas, draws)
    write_specimen_results(
        folder, view, read.inputs, formats=formats, vtu=vtu, stills=stills, studies=studies
    )
    rows = {
        f"{row['fit']}: {row['name']}": f"{row['value']}, {row['interval']}, {row['verdict']}"
        for row in constant_rows(view)
    }
    print_result(
        rows | printed(view),
        output.fits_json(fits, read.inputs) if as_json else None,
        rest={"page": folder / "specimen.html", "wall time": since(started)},
        warnings=view.warnings,
    )


def _require_drawing() -> None:
    """Refuse --stills before a fit is begun where they cannot be drawn."""
    from kolsky.report.scene.drawing import CannotRender, offscreen_pyvista

    try:
        offscreen_pyvista()
    except CannotRender as error:
        cure = "leave --stills out, or install what it needs; --vtu is for ParaView"
        raise InputError(texts.COMMAND_LINE, str(error), key="--stills", cure=cure) from None


def _studies(
    read: "Specification", factors: list[int], sigmas: list[float], draws: int
) -> "dict[str, list[StudyRow]]":
    from kolsky.specimen.studies import noise_study, resolution_study

    first = read.test(next(iter(read.samples)))
    made = {}
    if factors:
        made["resolution"] = resolution_study(
            first, read.constants, factors=factors, orders=("hex8", "hex27"), base=(20, 5, 1)
        )
    if sigmas:
        made["noise"] = noise_study(first, read.constants, sigmas=sigmas, repeats=draws)
    return made


def _fit_sheet(
    read: "Specification",
    folder: Path,
    started: float,
    formats: tuple[str, ...],
    *,
    alone: bool,
    blocks: tuple[int, int] | None,
    vtu: bool,
    stills: bool,
    as_json: bool,
) -> None:
    from kolsky.cli.terminal import print_result, since
    from kolsky.report.pages.specimen import printed, sheet_rows
    from kolsky.report.specimen_folder import write_sheet_results
    from kolsky.report.specimen_view import sheet_view_of
    from kolsky.specimen import output
    from kolsky.specimen.field_fit import fit_field, fit_steps
    from kolsky.specimen.field_reading import read_field
    from kolsky.specimen.stiffness_map import stiffness_map as stiffness_map_of

    measured = read_field(read)
    try:
        found = fit_field(measured.problem)
    except ValueError as error:
        raise read.toml.error("field", f"cannot be fitted: {error}") from None
    steps = fit_steps(found.problem) if alone else []
    mapped = stiffness_map_of(found.problem, blocks) if blocks else None
    view = sheet_view_of(read.name, measured, found, steps, mapped)
    inputs = {**read.inputs, **measured.inputs}
    write_sheet_results(folder, view, inputs, formats=formats, vtu=vtu, stills=stills)
    rows = {row["name"]: f"{row['value']}, {row['interval']}, {row['verdict']}" for row in sheet_rows(view)}
    print_result(
        rows | printed(view),
        output.field_json(found, steps) | {"inputs": inputs} if as_json else None,
        rest={"page": folder / "specimen.html", "wall time": since(started)},
        warnings=view.warnings,
    )
