"""`kolsky report`, `film` and `rate`: page, films and rate study of identified shots."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from kolsky.base.files import filling, usable_folder
from kolsky.base.options import Option
from kolsky.cli import texts
from kolsky.cli.options import Figures, Out, OutFolder, ShotPath, load, usable
from kolsky.cli.terminal import counted, print_result, progress_bars


def report(shot: ShotPath, out: Out = None, figures: Figures = ()) -> None:
    """Write report.html of an identified shot from its result and its files, without a simulation.

    Needs the results of `kolsky identify`, in SHOT/results or the folder of --out. The folder of several
    shots identified together, which has a joint.h5, gets a new joint.html and tables.
    """
    if (shot / "joint.h5").is_file() and not (shot / "shot.toml").exists():
        _joint(shot, out, figures)
        return
    from kolsky.report.result_folder import PAGE, read_identify_results, write_identify_page
    from kolsky.shot.recordings import shot_recordings

    loaded, folder = load(shot, out)
    result = read_identify_results(folder, loaded)
    with usable(loaded):
        recordings = shot_recordings(loaded, folder)
    with filling(folder) as partial:
        write_identify_page(partial, result, recordings, figures, processes=2)
    rows = {"shot": loaded.name, "report": str(folder / PAGE)}
    if figures:
        rows["figures"] = str(folder / "figures")
    print_result(rows, rows, warnings=result.warnings)


def _joint(folder: Path, out: Path | None, figures: Sequence[str]) -> None:
    """The page of several shots identified together, from their result file."""
    from kolsky.cli.identify import answer_lines
    from kolsky.report.result_folder import write_results
    from kolsky.results.joint import read_joint_hdf5

    result = read_joint_hdf5(folder / "joint.h5")
    place = usable_folder(out or folder)
    write_results(place, result, formats=figures)
    rows = {"shots": ", ".join(part.name for part in result.shots), "report": str(place / "joint.html")}
    print_result(rows, rows, lines=answer_lines(result), warnings=result.warnings)


_STILLS = "png"
_SERIES = "vtu"


def film(
    shot: ShotPath,
    field: Annotated[str, Option("Field of the colours: stretch, pressure, stress or energy.")] = "stretch",
    formats: Annotated[
        str,
        Option(
            "png (stills), mp4, gif, vtu (ParaView); separate several with commas.",
            name="format",
            metavar="FORMATS",
        ),
    ] = "png",
    every: Annotated[int, Option("Show every n-th recorded time.", min=1)] = 1,
    rate: Annotated[float, Option("Frames per second of a film.", min=1.0, max=120.0)] = 25.0,
    stills: Annotated[int, Option("Number of stills.", min=1, max=1000)] = 6,
    out: Out = None,
) -> None:
    """Draw the specimen of an identified shot between its platens, cut along its axis.

    Needs the results of `kolsky identify`; writes into their folder film.
    """
    from kolsky.report.scene.drawing import FILMS
    from kolsky.report.scene.scene_data import FIELDS

    texts.one_of("--field", field, tuple(FIELDS))
    wanted = texts.listed(formats)
    for name in wanted:
        texts.one_of("--format", name, (*FILMS, _STILLS, _SERIES))
        if name in FILMS:
            texts.installed(f"--format {name}", "imageio_ffmpeg", "film")

    loaded, folder = load(shot, out)
    from kolsky.report.paraview import write_vtu
    from kolsky.report.result_folder import RESULT_FILE
    from kolsky.report.scene.drawing import write_film, write_stills
    from kolsky.report.scene.scene_data import mesh_of, scene_of, solid_of
    from kolsky.results.hdf5 import read_identification

    result = read_identification(folder / RESULT_FILE)
    values = {name: estimate.value for name, estimate in result.estimates.items()}
    solid = solid_of(loaded.curve, {**result.fixed, **values})
    written: list[str] = []
    with usable(loaded), filling(folder / "film") as partial, progress_bars() as progress:
        stage = scene_of(result, field=field, solid=solid)
        if _STILLS in wanted:
            written += [path.name for path in write_stills(partial, stage, stills)]
        for name in (name for name in wanted if name in FILMS):
            report = counted(progress, f"pictures, {name}", len(range(0, len(stage.times), every)))
            path = partial / f"{field}.{name}"
            written.append(write_film(path, stage, every=every, rate=rate, progress=report).name)
        if _SERIES in wanted:
            series = write_vtu(partial, result.response, mesh_of(result), solid, every=every)
            written.append(f"{series[-1].name} and {len(series) - 1} meshes")
    summary = {"shot": loaded.name, "field": field, "folder": str(folder / "film"), "files": written}
    print_result({**summary, "files": ", ".join(written)}, summary)


def rate(
    shots: Annotated[list[Path], typer.Argument(metavar="SHOT...", help="Identified shots.")],
    group: Annotated[
        str,
        Option("Compare shots with one value of this key of shot.toml, e.g. interface.faces.", metavar="KEY"),
    ] = "",
    strains: Annotated[
        tuple[float, ...], Option("Nominal strains.", metavar="NUMBERS", read=texts.strains)
    ] = (0.1, 0.3, 0.5),
    shared: Annotated[
        float, Option("Relative standard uncertainty that all m have in common.", min=0.0)
    ] = 0.0,
    keep_unexplained: Annotated[bool, Option("Include shots whose data the model does not explain.")] = False,
    out: OutFolder = Path("rates"),
    figures: Figures = (),
) -> None:
    """Compare the stiffness of identified shots over their strain rates: mean, scatter, slope.

    Writes rates.json, rates.html and CSV tables. A slope that the range of rates does not support is
    rejected. A shot whose data the model does not explain is left out and named.
    """
    from kolsky.report.result_folder import write_results
    from kolsky.studies.rates import rate as rates
    from kolsky.studies.rates.output import rows, summary

    folder = usable_folder(out)
    with progress_bars() as progress, texts.refused(cure=_CURE):
        report = rates.rate(
            shots,
            group=group,
            strains=strains,
            shared=shared,
            keep_unexplained=keep_unexplained,
            progress=progress,
        )
    write_results(folder, report, formats=figures)
    print_result(
        {name: text for group in report.groups for name, text in rows(group, report).items()},
        summary(report),
        files={"result": folder / "rates.json", "page": folder / "rates.html"},
        warnings=[remark for group in report.groups for remark in group.remarks],
    )


_CURE = "correct the option; `kolsky rate --help` shows each"
