"""`kolsky check`: read a shot and show what was understood."""

import json

from kolsky.cli.options import AsJson, ShotPath


def check(shot: ShotPath, as_json: AsJson = False) -> None:
    """Read a shot, refuse what cannot be right, and show what was understood."""
    from kolsky.shot import summary
    from kolsky.shot.load import check_shot

    loaded = check_shot(shot)
    if as_json:
        print(json.dumps(summary.as_json(loaded), indent=2, allow_nan=False))
    else:
        summary.print_table(loaded)
