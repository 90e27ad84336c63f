"""`kolsky check`: read a shot and show what was understood, as a table and as a page."""

import json

from kolsky.cli.options import AsJson, Out, ShotPath


def check(shot: ShotPath, out: Out = None, as_json: AsJson = False) -> None:
    """Read a shot, refuse what cannot be right, and show what was understood.

    Of a test between bars these are the files, the strains at the gauges, arrivals and windows; nothing is
    reduced yet. Beside the table stands a page with the signals on one clock, the window and the outline at
    three times; --json writes none.
    """
    from kolsky.shot import summary
    from kolsky.shot.load import check_shot

    loaded = check_shot(shot)
    if as_json:
        print(json.dumps(summary.as_json(loaded), indent=2, allow_nan=False))
        return
    summary.print_table(loaded)
    from kolsky.base.files import filling, usable_folder
    from kolsky.report.pages.check import PAGE, write_page
    from kolsky.shot.schema.reading import folder_of

    folder = usable_folder(out or folder_of(shot) / "results")
    with filling(folder) as partial:
        write_page(partial / PAGE, loaded)
    print(f"page: {folder / PAGE}")
