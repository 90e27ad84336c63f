"""`kolsky material reference-curve`: quasi-static tests to the curve that a shot's stiffness refers to."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.options import AsJson, Figures, HeaderLine
from kolsky.cli.reference_curve_options import ends_of, refuse_columns, specimen_of, toe_of, units_of

if TYPE_CHECKING:
    from kolsky.material.reference_curve import Pull, ReferenceCurve

Column = typer.Option(metavar="COLUMN", help="By name or number.", show_default=False)


def reference_curve(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Repeats of one test.")],
    convention: Annotated[
        str, typer.Option(help="Sign of the files' columns: tension-positive or compression-positive.")
    ],
    branch: Annotated[str, typer.Option(help="compression or tension.")],
    strain: Annotated[str, Column] = "",
    stress: Annotated[str, Column] = "",
    displacement: Annotated[str, Column] = "",
    force: Annotated[str, Column] = "",
    time: Annotated[str, Column] = "",
    bulge: Annotated[
        str,
        typer.Option(
            metavar="COLUMN", help="Radius at mid-height, fitted with the force.", show_default=False
        ),
    ] = "",
    unit: Annotated[
        list[str] | None,
        typer.Option(metavar="COLUMN=UNIT", help="Unit of a column; repeat for more.", show_default="found"),
    ] = None,
    header_line: HeaderLine = None,
    diameter: Annotated[str | None, typer.Option(help='Of the specimen, e.g. "9.5 mm".')] = None,
    length: Annotated[str | None, typer.Option(help='Of the specimen, e.g. "6.5 mm".')] = None,
    compliance: Annotated[
        str | None, typer.Option(help='Of machine and load cell, e.g. "0.2 um/N".', show_default="none")
    ] = None,
    toe: Annotated[
        str,
        typer.Option(
            metavar="none|KIND:LOW:HIGH", help="line or gaussian, continued from these strains to zero."
        ),
    ] = "none",
    friction: Annotated[
        str,
        typer.Option(
            help="What held the ends: none, bonded, rough, Coulomb's coefficient, or free (with --bulge)."
        ),
    ] = "none",
    friction_sigma: Annotated[
        float, typer.Option(min=0.0, help="Standard uncertainty of that number.")
    ] = 0.0,
    bulge_sigma: Annotated[str | None, typer.Option(help='Of the radius, e.g. "5 um".')] = None,
    scale_sigma: Annotated[
        str, typer.Option(help="Relative standard uncertainty of force and section, common to all tests.")
    ] = "0 %",
    poisson: Annotated[
        float, typer.Option(min=0.0, max=0.4999, help="Poisson's ratio of the shot, for the friction.")
    ] = 0.499,
    points: Annotated[int, typer.Option(min=8, max=10000, help="Points of the curve.")] = 60,
    last: Annotated[
        float | None,
        typer.Option("--last-strain", help="Where the curve ends.", show_default="the tests' end"),
    ] = None,
    conditioned: Annotated[
        bool,
        typer.Option("--conditioned", help="Also the last loading ramp of each record, as its own curve."),
    ] = False,
    out: Annotated[Path, typer.Option("--out", metavar="FILE.csv", help="The curve.")] = Path("curve.csv"),
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Average quasi-static tests to the curve of the material: toe, machine, scatter, end friction.

    Writes the curve with its uncertainties, E_a over strain and time, and the table for shot.toml.
    """
    formats = texts.figure_formats(figures)
    if out.suffix != ".csv":
        raise InputError(texts.COMMAND_LINE, "is no table", key="--out", value=str(out), allowed="FILE.csv")
    from kolsky.base.files import filling, usable_folder
    from kolsky.cli.terminal import print_result
    from kolsky.material import reference_curve as curves
    from kolsky.material.end_friction.problem import CorrectionNumerics
    from kolsky.material.reference_curve_files import (
        BRANCHES,
        CONVENTIONS,
        curve_table,
        read_uniaxial_test,
        summary,
        write_curve,
        write_modulus,
    )

    folder = usable_folder(out.parent)
    if friction == "free" and not bulge:
        raise InputError(
            texts.COMMAND_LINE,
            "--friction free needs --bulge: the radius at mid-height finds the friction",
            cure="measure the radius at mid-height and give it with --bulge",
        )
    if (bulge != "") != (bulge_sigma is not None):
        raise InputError(texts.COMMAND_LINE, "--bulge and --bulge-sigma belong together", cure="give both")
    size = specimen_of(diameter, length)
    try:
        treatment = curves.Treatment(
            toe=toe_of(toe),
            compliance=0.0 if compliance is None else texts.physical("--compliance", compliance, "m/N"),
            scale_sigma=texts.physical("--scale-sigma", scale_sigma, "1"),
            specimen=size,
            ends=ends_of(friction, friction_sigma),
            bulge_sigma=0.0
            if bulge_sigma is None
            else texts.physical("--bulge-sigma", bulge_sigma, "m", positive=True),
            points=points,
            last=last,
            numerics=CorrectionNumerics(poisson=poisson),
        )
    except ValueError as error:
        raise InputError(
            texts.COMMAND_LINE,
            str(error),
            cure="correct the option; `kolsky material reference-curve --help` shows each",
        ) from None
    texts.one_of("--convention", convention, CONVENTIONS)
    texts.one_of("--branch", branch, BRANCHES)
    columns = {
        what: column
        for what, column in (
            ("strain", strain),
            ("stress", stress),
            ("displacement", displacement),
            ("force", force),
            ("time", time),
            ("bulge", bulge),
        )
        if column
    }
    refuse_columns(columns, size)
    units = units_of(unit or [], columns)
    tests, hashes = [], {}
    for path in files:
        test, digest = read_uniaxial_test(
            path,
            columns,
            convention=convention,
            branch=branch,
            units=units,
            header_line=header_line,
            specimen=size,
        )
        if str(path) in hashes:
            raise InputError(path, "is named twice", cure="a test counts once")
        hashes[str(path)] = digest
        tests.append(test)
    pulls: tuple[Pull, ...] = ("first", "conditioned") if conditioned else ("first",)
    try:
        found = {pull: curves.reference_curve(tests, treatment, pull=pull) for pull in pulls}
    except ValueError as error:
        raise InputError(
            texts.COMMAND_LINE,
            str(error),
            cure="correct the option; `kolsky material reference-curve --help` shows each",
        ) from error
    names = {"first": out.stem, "conditioned": f"{out.stem}_conditioned"}
    with filling(folder) as partial:
        for pull, made in found.items():
            write_curve(partial / f"{names[pull]}.csv", made)
            write_modulus(partial / f"{names[pull]}_modulus.csv", made)
            if formats:
                from kolsky.report.canvas import save_figures

                save_figures(partial / f"{names[pull]}_figures", made, formats=formats)
        other = f"{names['conditioned']}.csv" if conditioned else None
        table = curve_table(out.name, found["first"], other)
        (partial / f"{out.stem}.toml").write_text(table, encoding="utf-8")
    rows: dict[str, Any] = {}
    for pull, made in found.items():
        rows |= _rows(made, f"{pull}: " if conditioned else "")
    said = {"inputs": hashes, "curves": {pull: summary(made) for pull, made in found.items()}}
    print_result(
        rows,
        said if as_json else None,
        rest={"curve": out, "for shot.toml": folder / f"{out.stem}.toml"},
        warnings=list(dict.fromkeys(remark for made in found.values() for remark in made.remarks)),
    )


def _rows(made: "ReferenceCurve", before: str) -> dict[str, Any]:
    """The lines that a terminal gets of a curve; `before` stands before every name."""
    modulus, friction = made.modulus, made.friction
    strain = made.band.strain
    rows: dict[str, Any] = {
        f"{before}tests": len(made.tests),
        f"{before}strains": f"{strain[0]:.4g} to {strain[-1]:.4g}",
        f"{before}mean E_a": f"{modulus.mean / 1e3:.4g} ± {2.0 * modulus.mean_sigma / 1e3:.2g} kPa (k = 2)",
    }
    offsets = [one.offset for one in made.tests]
    if any(offsets):
        rows[f"{before}zero of strain"] = f"{min(offsets):.4g} to {max(offsets):.4g}"
    if friction is not None:
        ratio = friction.ratio
        rows[f"{before}stiffer by end friction"] = f"{ratio.min():.3f} to {ratio.max():.3f} times"
        if friction.coefficient is not None:
            sigma = f" ± {2.0 * friction.sigma:.2g} (k = 2)" if friction.sigma > 0.0 else ""
            rows[f"{before}friction"] = f"{friction.coefficient:.3g}{sigma}"
        best = friction.models[0]
        rows[f"{before}law behind it"] = f"{best.name}, {100.0 * best.misfit:.2g} % from the test (rms)"
        for model in friction.models[1:]:
            if model.weight > 0.01:
                rows[f"{before}or"] = f"{model.name} (weight {model.weight:.2g})"
    return rows
