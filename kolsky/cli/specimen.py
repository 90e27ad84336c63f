"""`kolsky specimen new`, `fit`, `simulate` and `plan`: whole specimens in slow tests."""

import functools
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from kolsky.base.files import usable_folder, write_folder
from kolsky.base.options import Option
from kolsky.cli import texts
from kolsky.cli.new import write_template
from kolsky.cli.options import Figures, Vtu
from kolsky.cli.terminal import print_result, progress_bars
from kolsky.inverse.settings import Device

if TYPE_CHECKING:
    from kolsky.bodies.specimen_fit import Expected
    from kolsky.bodies.specimen_reading import Specification
    from kolsky.report.body_views import SheetView, SpecimenView


_SpecPath = Annotated[Path, typer.Argument(metavar="SPEC", help="A SPEC.toml: material, specimens, files.")]
_OutOfSpec = Annotated[
    Path | None, Option("Where results go.", metavar="FOLDER", show_default="SPEC's name/results")
]


def specimen_new(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the new specification.")],
) -> None:
    """Write an annotated SPEC.toml of slow tests; an existing one is left unchanged."""
    write_template(folder, "specimen.toml", "fill it in, then: kolsky specimen fit {}")


def specimen_fit(
    spec: _SpecPath,
    out: _OutOfSpec = None,
    steps_alone: Annotated[bool, Option("For a sheet: also fit every step separately.")] = False,
    vtu: Vtu = False,
    device: Device = "cpu",
    figures: Figures = (),
) -> None:
    """Fit a law to whole specimens: their force curves, or a sheet's displacement field and pad force.

    Writes specimen.html, specimen.json, specimen.h5, tables, and the fitted law as curves that a shot.toml
    can name.
    """
    from kolsky.bodies.specimen_reading import read_specification

    read = read_specification(spec, device=device)
    folder = usable_folder(out or read.toml.path.with_suffix("") / "results")
    if read.declared.field is not None:
        _fit_sheet(read, folder, figures, each_step=steps_alone, vtu=vtu)
        return
    _refuse({"--steps-alone": steps_alone}, "is for a sheet")
    from kolsky.bodies import specimen_output
    from kolsky.bodies.specimen_fit import fit
    from kolsky.report.body_views import view_of
    from kolsky.report.result_folder import write_specimen_results

    groups = read.declared.fit.together or {name: [name] for name in read.samples}
    if not read.samples:
        raise read.toml.error("tests", "have no data", cure="name a file, or `kolsky specimen simulate`")
    fits = []
    for name, members in groups.items():
        others = [read.test(other) for other in read.samples if other not in members]
        with read.toml.refusing(f"fit.together.{name}", "cannot be fitted"):
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
    view = view_of(read.name, fits)
    write_specimen_results(folder, view, read.inputs, formats=figures, vtu=vtu)
    _print_fit(view, specimen_output.fits_json(fits, read.inputs), folder)


def _print_fit(view: "SpecimenView | SheetView", content: dict[str, Any], folder: Path) -> None:
    """Print the constants and numbers of a page."""
    from kolsky.report.pages.bodies import constant_rows, specimen_rows
    from kolsky.results.numbers import row_lines

    rows = row_lines(constant_rows(view), 2) | specimen_rows(view)
    print_result(rows, content, files={"page": folder / "specimen.html"}, warnings=view.warnings)


_refuse = functools.partial(texts.refuse, cure="remove it")


def _fit_sheet(
    read: "Specification", folder: Path, figures: tuple[str, ...], *, each_step: bool, vtu: bool
) -> None:
    from kolsky.bodies import specimen_output
    from kolsky.bodies.sheet_checks import fit_measured, one_change
    from kolsky.bodies.sheet_fit import fit_steps
    from kolsky.bodies.sheet_reading import read_field
    from kolsky.report.body_views import sheet_view_of
    from kolsky.report.result_folder import write_specimen_results

    measured = read_field(read)
    section = read.declared.field
    assert section is not None  # `read_field` refuses a file without it
    with read.toml.refusing("field", "cannot be fitted"), progress_bars() as progress:
        measured, result = fit_measured(
            measured,
            gate=section.points.gate,
            progress=lambda done, most: progress("simulations of a search, at most", done, most),
        )
        change = one_change(measured, result)
    steps = fit_steps(result.problem) if each_step else []
    view = sheet_view_of(read.name, measured, result, steps, change=change)
    inputs = {**read.inputs, **measured.inputs}
    write_specimen_results(folder, view, inputs, formats=figures, vtu=vtu)
    content = specimen_output.field_json(result, steps) | {"one_change": change, "inputs": inputs}
    _print_fit(view, content, folder)


def specimen_simulate(
    spec: _SpecPath,
    out: _OutOfSpec = None,
    seed: Annotated[
        int | None,
        Option("Add noise of the declared sizes, drawn with this seed.", min=0, show_default="none"),
    ] = None,
    vtu: Vtu = False,
    device: Device = "cpu",
) -> None:
    """Simulate the tests of a SPEC with its constants: force curves, strains by volume; a sheet's field.

    Writes a CSV file for each test, or points.csv and pad.csv of a sheet. The SPEC can name these files, as
    data with known constants. A sheet's points and the motion of its pad are those of the SPEC's files.
    """
    from kolsky.bodies.specimen_reading import read_specification, simulate_tests
    from kolsky.report.body_views import BINS, strain_share
    from kolsky.report.result_folder import write_solution_vtu

    read = read_specification(spec, device=device)
    folder = usable_folder(out or Path(read.toml.path.with_suffix("")) / "simulated")
    if read.declared.field is not None:
        _refuse({"--vtu": vtu}, "is for force curves")
        _simulate_sheet(read, folder, seed=seed)
        return
    with read.toml.refusing("tests", "cannot be simulated"):
        simulated = simulate_tests(read, seed=seed)
    files: dict[str, Any] = {}
    tables: dict[str, Any] = {}
    for name, one in simulated.items():
        share = strain_share(name, one.solution, read.models[name].shape.mid_region())
        columns = {"strain from (1)": BINS[:-1], "strain to (1)": BINS[1:]}
        for part, values in (("whole", share.whole), ("middle", share.middle)):
            columns |= {f"share along {a}, {part} (1)": v for a, v in zip("xyz", values, strict=True)}
        tables |= {name: one.columns, f"{name}_strains": columns}
        if vtu:
            files[f"{name}.vtu"] = functools.partial(write_solution_vtu, solution=one.solution)
    write_folder(folder, files, tables)
    rows = {
        name: f"{len(one.force)} samples to {1e3 * one.displacement.max():.4g} mm, "
        f"{one.force[-1].max():.5g} N"
        for name, one in simulated.items()
    }
    content = {
        name: {"displacement_m": one.displacement.tolist(), "force_N": one.force.tolist()}
        for name, one in simulated.items()
    }
    print_result(rows, content, files={"folder": folder})


def _simulate_sheet(read: "Specification", folder: Path, *, seed: int | None) -> None:
    """Write points and pad of a simulated sheet, and print their files."""
    from kolsky.bodies.sheet_reading import read_field, simulate_sheet

    with read.toml.refusing("field", "cannot be simulated"):
        simulated = simulate_sheet(read_field(read), seed=seed)
    write_folder(folder, {}, {"points": simulated.point_columns, "pad": simulated.pad_columns})
    rows = {
        "points": f"{len(simulated.points)} in {len(simulated.frames)} frames",
        "pad": f"to {1e3 * abs(simulated.pad[-1]):.4g} mm, {simulated.force[-1]:.5g} N",
    }
    content = {"pad_m": simulated.pad.tolist(), "force_N": simulated.force.tolist()}
    print_result(rows, content, files={"folder": folder})


def specimen_plan(
    spec: _SpecPath,
    out: _OutOfSpec = None,
    wanted: Annotated[
        str,
        Option("Constants to be estimated well.", metavar="NAMES", show_default="those of the SPEC, or all"),
    ] = "",
    device: Device = "cpu",
) -> None:
    """Compare planned tests of a SPEC, single and combined, by the intervals of the constants they give.

    Every test is simulated once at the declared constants; no data are needed. Shapes to compare are tests
    of one SPEC. For a sheet, the field and the force are compared, single and combined; its points and the
    motion of its pad are those of the SPEC's files. Writes plan.csv and plan.json.
    """
    from kolsky.bodies import specimen_output
    from kolsky.bodies.sheet_reading import plan_sheet, read_field
    from kolsky.bodies.specimen_reading import read_specification
    from kolsky.results import numbers

    read = read_specification(spec, device=device)
    folder = usable_folder(out or read.toml.path.with_suffix("") / "plan")
    problem = None if read.declared.field is None else read_field(read).problem
    free = (read if problem is None else problem).constants.free
    names = texts.listed(wanted) or tuple(read.declared.plan.wanted)
    for name in names:
        if name not in free:
            raise read.toml.error("plan.wanted", f"names {name!r}", allowed=", ".join(free))
    if problem is not None:
        with read.toml.refusing("field", "cannot be simulated"):
            choices = plan_sheet(problem, wanted=names)
    else:
        choices = _plan_tests(read, names)
    content = specimen_output.plan_json(choices, free)
    write_folder(folder, {"plan.json": content}, {"plan": specimen_output.plan_columns(choices, free)})
    rows = {
        " + ".join(one.tests): ", ".join(
            f"{name} ± {numbers.percent(float(value))}"
            for name, value in zip(free, one.relative, strict=True)
        )
        for one in choices
    }
    print_result(rows, content, files={"folder": folder})


def _plan_tests(read: "Specification", names: tuple[str, ...]) -> "list[Expected]":
    from kolsky.bodies.specimen_fit import plan, slopes

    choices = read.declared.plan.compare or [[name] for name in read.models]
    used = list(dict.fromkeys(name for choice in choices for name in choice))
    noise = {
        name: (read.declared.tests[name].sigma_displacement, read.declared.tests[name].sigma_force)
        for name in used
    }
    with read.toml.refusing("tests", "cannot be simulated"):
        whitened, forces = slopes(
            {name: read.models[name] for name in used},
            {name: read.schedule(name) for name in used},
            noise,
            read.constants,
        )
    return plan(choices, whitened, forces, read.constants, wanted=names)
