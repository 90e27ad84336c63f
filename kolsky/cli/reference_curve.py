"""The options of `kolsky material baseline`; its body is in `kolsky.cli.work.baseline`."""

from pathlib import Path
from typing import Annotated

import typer

from kolsky.cli.shared import AsJson, listed, refusing_bad_input

Column = typer.Option(metavar="COLUMN", help="By name or number.", show_default=False)


def baseline(
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
            metavar="COLUMN", help="Radius at mid-height, which finds the friction.", show_default=False
        ),
    ] = "",
    unit: Annotated[
        list[str] | None,
        typer.Option(metavar="COLUMN=UNIT", help="Unit of a column; repeat for more.", show_default="found"),
    ] = None,
    header_line: Annotated[
        int | None, typer.Option(min=0, help="Line of the column names; 0: none.", show_default="found")
    ] = None,
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
    figures: Annotated[
        str, typer.Option(metavar="FORMATS", help="Also save the figure, e.g. pdf,svg,png.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Average quasi-static tests to the curve of the material: toe, machine, scatter, end friction.

    Writes the curve with its uncertainties, E_a over strain and time, and the table for shot.toml.
    """
    columns = {
        "strain": strain,
        "stress": stress,
        "displacement": displacement,
        "force": force,
        "time": time,
        "bulge": bulge,
    }
    with refusing_bad_input():
        from kolsky.cli.work.baseline import make_baseline
        from kolsky.cli.work.baselinetests import Given

        make_baseline(
            Given(
                files=files,
                columns={what: column for what, column in columns.items() if column},
                units=unit or [],
                convention=convention,
                branch=branch,
                header_line=header_line,
                diameter=diameter,
                length=length,
                compliance=compliance,
                toe=toe,
                friction=friction,
                friction_sigma=friction_sigma,
                bulge_sigma=bulge_sigma,
                scale_sigma=scale_sigma,
                poisson=poisson,
                points=points,
                last=last,
                conditioned=conditioned,
            ),
            out=out,
            formats=listed(figures),
            as_json=as_json,
        )
