"""`kolsky specimen fit`, `simulate` and `plan`: whole specimens in slow tests.

Constants of a law fitted to force curves or to a displacement field; force curves with declared
constants; the tests and shapes that constrain the constants best.
"""

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.options import AsJson, Device, Figures

if TYPE_CHECKING:
    from kolsky.bodies.specimen_reading import Specification
    from kolsky.bodies.specimen_studies import Expected, StudyRow


_SpecPath = Annotated[Path, typer.Argument(metavar="SPEC", help="A SPEC.toml: material, specimens, files.")]
_OutOfSpec = Annotated[
    Path | None,
    typer.Option("--out", metavar="FOLDER", help="Where results go.", show_default="SPEC's name/results"),
]


def specimen_fit(
    spec: _SpecPath,
    out: _OutOfSpec = None,
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
        bool, typer.Option("--steps-alone", help="Of a sheet: also fit every step separately.")
    ] = False,
    stiffness_map: Annotated[
        str,
        typer.Option("--map", metavar="NXxNY", help="Of a sheet: also map its stiffness by NX x NY blocks."),
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
    from kolsky.bodies.specimen_reading import read_specification
    from kolsky.cli.terminal import print_result, since

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
    from kolsky.bodies import specimen_output
    from kolsky.bodies.specimen_fit import fit
    from kolsky.report.body_views import view_of
    from kolsky.report.pages.specimen import constant_rows, printed
    from kolsky.report.specimen_folder import write_specimen_results

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
        specimen_output.fits_json(fits, read.inputs) if as_json else None,
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
    from kolsky.bodies.specimen_studies import noise_study, resolution_study

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
    from kolsky.bodies import specimen_output
    from kolsky.bodies.sheet_fit import fit_field, fit_steps
    from kolsky.bodies.sheet_reading import read_field
    from kolsky.bodies.stiffness_map import stiffness_map as stiffness_map_of
    from kolsky.cli.terminal import print_result, since
    from kolsky.report.body_views import sheet_view_of
    from kolsky.report.pages.specimen import printed, sheet_rows
    from kolsky.report.specimen_folder import write_sheet_results

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
        specimen_output.field_json(found, steps) | {"inputs": inputs} if as_json else None,
        rest={"page": folder / "specimen.html", "wall time": since(started)},
        warnings=view.warnings,
    )


def specimen_simulate(
    spec: _SpecPath,
    out: _OutOfSpec = None,
    seed: Annotated[
        int | None,
        typer.Option(
            min=0, help="Add noise of the declared sizes, drawn with this seed.", show_default="none"
        ),
    ] = None,
    vtu: Annotated[bool, typer.Option("--vtu", help="Also write the last sample for ParaView.")] = False,
    device: Device = "cpu",
    as_json: AsJson = False,
) -> None:
    """Simulate the tests of a SPEC with its constants: force curves, strains by volume; a sheet's field.

    Writes a CSV file a test, or points.csv and pad.csv of a sheet, which the SPEC can name as its files: data
    whose constants are known. A sheet's points and the motion of its pad are those of the SPEC's files.
    """
    started = perf_counter()
    from kolsky.base.files import filling, usable_folder, write_table
    from kolsky.bodies.specimen_reading import read_specification, simulate_tests
    from kolsky.cli.terminal import print_result, since
    from kolsky.report.body_views import BINS, strain_share
    from kolsky.report.specimen_folder import write_solution_vtu

    read = read_specification(spec, device=device)
    folder = usable_folder(out or Path(read.toml.path.with_suffix("")) / "simulated")
    if read.declared.field is not None:
        _simulate_sheet(read, folder, started, seed=seed, vtu=vtu, as_json=as_json)
        return
    try:
        made = simulate_tests(read, seed=seed)
    except ValueError as error:
        raise read.toml.error("tests", f"cannot be simulated: {error}") from None
    with filling(folder) as partial:
        for name, one in made.items():
            write_table(partial / f"{name}.csv", one.columns)
            share = strain_share(name, one.solution, read.models[name].shape.mid_region())
            columns = {"strain from (1)": BINS[:-1], "strain to (1)": BINS[1:]}
            for part, values in (("whole", share.whole), ("middle", share.middle)):
                columns |= {f"share along {a}, {part} (1)": v for a, v in zip("xyz", values, strict=True)}
            write_table(partial / f"{name}_strains.csv", columns)
            if vtu:
                write_solution_vtu(partial / f"{name}.vtu", one.solution)
    rows = {
        name: f"{len(one.force)} samples to {1e3 * one.displacement.max():.4g} mm, "
        f"{one.force[-1].max():.5g} N"
        for name, one in made.items()
    }
    said = {
        name: {"displacement_m": one.displacement.tolist(), "force_N": one.force.tolist()}
        for name, one in made.items()
    }
    print_result(rows, said if as_json else None, rest={"folder": folder, "wall time": since(started)})


def _simulate_sheet(
    read: "Specification", folder: Path, started: float, *, seed: int | None, vtu: bool, as_json: bool
) -> None:
    from kolsky.base.errors import InputError
    from kolsky.base.files import filling, write_table
    from kolsky.bodies.sheet_reading import read_field, simulate_sheet
    from kolsky.cli import texts
    from kolsky.cli.terminal import print_result, since

    if vtu:
        raise InputError(texts.COMMAND_LINE, "is for force curves", key="--vtu", cure="remove it")
    try:
        made = simulate_sheet(read_field(read), seed=seed)
    except ValueError as error:
        raise read.toml.error("field", f"cannot be simulated: {error}") from None
    with filling(folder) as partial:
        write_table(partial / "points.csv", made.point_columns)
        write_table(partial / "pad.csv", made.pad_columns)
    rows = {
        "points": f"{len(made.points)} in {len(made.frames)} frames",
        "pad": f"to {1e3 * abs(made.pad[-1]):.4g} mm, {made.force[-1]:.5g} N",
    }
    said = {"pad_m": made.pad.tolist(), "force_N": made.force.tolist()}
    print_result(rows, said if as_json else None, rest={"folder": folder, "wall time": since(started)})


def specimen_plan(
    spec: _SpecPath,
    out: _OutOfSpec = None,
    wanted: Annotated[
        str,
        typer.Option(metavar="NAMES", help="Constants that count.", show_default="those of the SPEC, or all"),
    ] = "",
    device: Device = "cpu",
    as_json: AsJson = False,
) -> None:
    """Compare the tests of a SPEC before they are made, alone and together, by the intervals they would give.

    Every test is simulated once at the declared constants; no data are needed. Shapes to compare are tests
    of one SPEC. Of a sheet, field and force are compared alone and together; its points and the motion of its
    pad are those of the SPEC's files. Writes plan.csv and plan.json.
    """
    started = perf_counter()
    import json

    from kolsky.base.files import filling, usable_folder
    from kolsky.bodies import specimen_output
    from kolsky.bodies.specimen_reading import read_specification
    from kolsky.cli.terminal import print_result, since
    from kolsky.results import numbers

    read = read_specification(spec, device=device)
    folder = usable_folder(out or read.toml.path.with_suffix("") / "plan")
    free = read.constants.free
    asked = texts.listed(wanted) or tuple(read.declared.plan.wanted)
    for name in asked:
        if name not in free:
            raise read.toml.error("plan.wanted", f"names {name!r}", allowed=", ".join(free))
    found = _plan_sheet(read, asked) if read.declared.field is not None else _plan_tests(read, asked)
    said = specimen_output.plan_json(found, free)
    with filling(folder) as partial:
        specimen_output.write_plan(partial, found, free)
        text = json.dumps(said, indent=2, allow_nan=False)
        (partial / "plan.json").write_text(text, encoding="utf-8")
    rows = {
        " + ".join(one.tests): ", ".join(
            f"{name} ± {numbers.percent(float(value))}"
            for name, value in zip(free, one.relative, strict=True)
        )
        for one in found
    }
    print_result(rows, said if as_json else None, rest={"folder": folder, "wall time": since(started)})


def _plan_sheet(read: "Specification", asked: tuple[str, ...]) -> "list[Expected]":
    from kolsky.bodies.sheet_reading import plan_sheet, read_field

    try:
        return plan_sheet(read_field(read).problem, wanted=asked)
    except ValueError as error:
        raise read.toml.error("field", f"cannot be simulated: {error}") from None


def _plan_tests(read: "Specification", asked: tuple[str, ...]) -> "list[Expected]":
    from kolsky.bodies.specimen_studies import plan, slopes

    choices = read.declared.plan.compare or [[name] for name in read.models]
    used = list(dict.fromkeys(name for choice in choices for name in choice))
    noise = {
        name: (read.declared.tests[name].sigma_displacement, read.declared.tests[name].sigma_force)
        for name in used
    }
    try:
        whitened, forces, _ = slopes(
            {name: read.models[name] for name in used},
            {name: read.schedule(name) for name in used},
            noise,
            read.constants,
        )
    except ValueError as error:
        raise read.toml.error("tests", f"cannot be simulated: {error}") from None
    return plan(choices, whitened, forces, read.constants, wanted=asked)
