"""Commands of `kolsky`, called in this process, and the tables that they write."""

import csv
import json
from pathlib import Path
from typing import Any

from click.testing import Result
from typer.testing import CliRunner

from kolsky.cli import app


def run_kolsky(*words: object, code: int = 0) -> Result:
    """Output of a command. It must end with this exit code."""
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exit_code == code, done.output
    return done


def json_of(*words: object) -> Any:
    """Output of a successful command with ``--json``."""
    return json.loads(run_kolsky(*words, "--json").stdout)


def rows_of(path: Path) -> list[dict[str, str]]:
    """Rows of a table with commas, by heading."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
