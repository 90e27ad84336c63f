"""`kolsky report`: the page of an identified shot, made again from its result and its files."""

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

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
    from kolsky.cli.inputs import load, usable
    from kolsky.cli.terminal import print_result, since
    from kolsky.report.result_folder import PAGE, read_identify_results, write_identify_page
    from kolsky.shot.recorded import recorded

    loaded, folder = load(shot, out)
    found = read_identify_results(folder, loaded)
    with usable(loaded):
        recordings = recorded(loaded, folder)
    with filling(folder) as partial:
        write_identify_page(partial, found, recordings, formats, processes=2)
    rows = {"shot": loaded.name, "report": str(folder / PAGE)}
    if formats:
        rows["figures"] = str(folder / "figures")
    print_result(rows, rows if as_json else None, rest={"wall time": since(started)}, warnings=found.warnings)


def _joint(folder: Path, out: Path | None, formats: Sequence[str], started: float, *, as_json: bool) -> None:
    """The page of several shots identified together, from their result file."""
    from kolsky.base.files import usable_folder
    from kolsky.cli.identify_shots import answers
    from kolsky.cli.terminal import print_result, since
    from kolsky.joint.hdf5 import read_joint_hdf5
    from kolsky.report.study_folder import write_joint_results

    found = read_joint_hdf5(folder / "joint.h5")
    place = usable_folder(out or folder)
    write_joint_results(place, found, formats=formats)
    rows = {"shots": ", ".join(part.name for part in found.shots), "report": str(place / "joint.html")}
    print_result(
        rows,
        rows if as_json else None,
        answers=answers(found),
        rest={"wall time": since(started)},
        warnings=found.warnings,
    )
