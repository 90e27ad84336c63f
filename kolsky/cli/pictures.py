"""The options of `kolsky dic` and `calibrate`: pictures and cameras."""

from pathlib import Path
from typing import Annotated

import typer

from kolsky.cli.shared import AsJson, Out, ShotPath, listed, refusing_bad_input


def dic(
    shot: ShotPath,
    out: Out = None,
    device: Annotated[
        str, typer.Option(help='Where pictures are correlated: "cpu" or a CUDA device such as "cuda:0".')
    ] = "cpu",
    again: Annotated[bool, typer.Option("--again", help="Correlate even if the result is there.")] = False,
    csv: Annotated[bool, typer.Option("--csv", help="Also write the points of every frame as CSV.")] = False,
    vtp: Annotated[bool, typer.Option("--vtp", help="Also write the surfaces for ParaView.")] = False,
    figures: Annotated[
        str, typer.Option(metavar="FORMATS", help="Also save each figure alone, e.g. pdf,svg,png,csv.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Correlate a shot's pictures: surfaces, outline and the flyer's travel, each with its sigma.

    Writes dic.h5, dic.html, centreline.csv, flyer.csv and the reporting table into SHOT/results. `kolsky
    identify` does the same by itself for a shot without exports.
    """
    with refusing_bad_input():
        from kolsky.cli.work.dic import correlate

        correlate(
            shot,
            out=out,
            device=device,
            again=again,
            csv=csv,
            vtp=vtp,
            formats=listed(figures),
            as_json=as_json,
        )


def calibrate(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A calibration.toml, a shot.toml with a table calibration, or the folder of one.",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FOLDER", help="Where results go.", show_default="results")
    ] = None,
    export: Annotated[
        str,
        typer.Option(
            metavar="FORMATS", help="Also write the cameras as vic3d, dice, matchid, opencorr, dice-text."
        ),
    ] = "",
    figures: Annotated[
        str, typer.Option(metavar="FORMATS", help="Also save each figure alone, e.g. pdf,svg,png,csv.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Calibrate two cameras from pictures of a target, with the covariance of all parameters.

    Writes rig.yml, calibration.html and calibration.csv.
    """
    with refusing_bad_input():
        from kolsky.cli.work.calibrate import calibrate as run

        run(
            source,
            out=out,
            exports=listed(export),
            formats=listed(figures),
            as_json=as_json,
        )
