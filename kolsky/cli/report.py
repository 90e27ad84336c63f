"""`kolsky report` and `film`: page, stills and films of an identified shot, from its result and files."""

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.options import AsJson, Figures, Out, ShotPath


def report(shot: ShotPath, out: Out = None, figures: Figures = "", as_json: AsJson = False) -> None:
    """Write report.html of an identified shot again, from its result and its files; nothing is simulated.

    Needs the results of `kolsky identify`, in SHOT/results or the folder of --out. The folder of several
    shots identified together, which has a joint.h5, gets its joint.html and tables again.
    """
    started = perf_counter()
    formats = texts.figure_formats(figures)
    if (shot / "joint.h5").is_file() and not (shot / "shot.toml").exists():
        _joint(shot, out, formats, started, as_json=as_json)
        return
    from kolsky.base.files import filling
    from kolsky.cli.options import load, usable
    from kolsky.cli.terminal import print_result, since
    from kolsky.report.result_folder import PAGE, read_identify_results, write_identify_page
    from kolsky.shot.recordings import shot_recordings

    loaded, folder = load(shot, out)
    found = read_identify_results(folder, loaded)
    with usable(loaded):
        recordings = shot_recordings(loaded, folder)
    with filling(folder) as partial:
        write_identify_page(partial, found, recordings, formats, processes=2)
    rows = {"shot": loaded.name, "report": str(folder / PAGE)}
    if formats:
        rows["figures"] = str(folder / "figures")
    print_result(rows, rows if as_json else None, rest={"wall time": since(started)}, warnings=found.warnings)


def _joint(folder: Path, out: Path | None, formats: Sequence[str], started: float, *, as_json: bool) -> None:
    """The page of several shots identified together, from their result file."""
    from kolsky.base.files import usable_folder
    from kolsky.cli.identify_shots import answer_lines
    from kolsky.cli.terminal import print_result, since
    from kolsky.report.result_folder import write_results
    from kolsky.results.joint import read_joint_hdf5

    found = read_joint_hdf5(folder / "joint.h5")
    place = usable_folder(out or folder)
    write_results(place, found, formats=formats)
    rows = {"shots": ", ".join(part.name for part in found.shots), "report": str(place / "joint.html")}
    print_result(
        rows,
        rows if as_json else None,
        answers=answer_lines(found),
        rest={"wall time": since(started)},
        warnings=found.warnings,
    )


_STILLS = "png"
_SERIES = "vtu"


def film(
    shot: ShotPath,
    field: Annotated[str, typer.Option(help="What colours it: stretch, pressure or energy.")] = "stretch",
    formats: Annotated[
        str,
        typer.Option(
            "--format", metavar="FORMATS", help="png (stills), mp4, gif, vtu (ParaView); several by commas."
        ),
    ] = "png",
    every: Annotated[int, typer.Option(min=1, help="Show every n-th recorded time.")] = 1,
    rate: Annotated[float, typer.Option(min=1.0, max=120.0, help="Pictures a second of a film.")] = 25.0,
    stills: Annotated[int, typer.Option(min=1, max=1000, help="Number of stills.")] = 6,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Render the specimen of an identified shot between its platens, half of it cut away.

    Needs the results of `kolsky identify`; writes into their folder film.
    """
    started = perf_counter()
    from kolsky.report.scene.drawing import CannotRender, require_pyvista
    from kolsky.report.scene.film import FILMS, writer_for
    from kolsky.report.scene.scene_data import FIELDS

    texts.one_of("--field", field, tuple(FIELDS))
    wanted = texts.listed(formats)
    for name in wanted:
        texts.one_of("--format", name, (*FILMS, _STILLS, _SERIES))
        if name != _SERIES:
            try:
                require_pyvista()
            except CannotRender as error:
                raise InputError(
                    texts.COMMAND_LINE,
                    f"--format {name}: {error}",
                    cure="choose another --format, or install what it needs",
                ) from None
        if name in FILMS:
            try:
                writer_for(name)
            except ImportError as error:
                raise InputError(
                    texts.COMMAND_LINE,
                    f"--format {name}: {error}",
                    cure="choose another --format, or install what it needs",
                ) from None
    from kolsky.cli.options import load, usable
    from kolsky.cli.terminal import counted, print_result, progress_bars, since

    loaded, folder = load(shot, out)
    from kolsky.base.files import filling
    from kolsky.report.paraview import write_vtu
    from kolsky.report.result_folder import RESULT_FILE
    from kolsky.report.scene.film import write_film, write_stills
    from kolsky.report.scene.scene_data import scene_of, solid_of
    from kolsky.results.hdf5 import read_identification

    result = read_identification(folder / RESULT_FILE)
    solid = solid_of(loaded.curve, result)
    written: list[str] = []
    with usable(loaded), filling(folder / "film") as partial, progress_bars() as progress:
        stage = scene_of(result, field=field, solid=solid)
        try:
            if _STILLS in wanted:
                written += [path.name for path in write_stills(partial, stage, stills)]
            for name in (name for name in wanted if name in FILMS):
                frames = len(range(0, len(stage.times), every))
                report = counted(progress, f"pictures, {name}", frames)
                path = partial / f"{field}.{name}"
                written.append(write_film(path, stage, every=every, rate=rate, progress=report).name)
        except CannotRender as error:
            raise InputError(
                texts.COMMAND_LINE, str(error), cure="`kolsky doctor` says what is missing"
            ) from None
        if _SERIES in wanted:
            series = write_vtu(partial, result.response, stage.mesh.quads, every=every)
            written.append(f"{series[-1].name} and {len(series) - 1} meshes")
    summary = {"shot": loaded.name, "field": field, "folder": str(folder / "film"), "files": written}
    shown = {**summary, "files": ", ".join(written)}
    print_result(shown, summary if as_json else None, rest={"wall time": since(started)})
