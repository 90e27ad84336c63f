"""`kolsky report`: the page of an identified shot, made again from its result and its files."""

from time import perf_counter

from kolsky.cli import texts
from kolsky.cli.options import AsJson, Figures, Out, ShotPath


def report(shot: ShotPath, out: Out = None, figures: Figures = "", as_json: AsJson = False) -> None:
    """Write report.html of an identified shot again, from its result and its files; nothing is simulated.

    Needs the results of `kolsky identify`, in SHOT/results or the folder of --out.
    """
    started = perf_counter()
    formats = texts.figure_formats(figures)
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
