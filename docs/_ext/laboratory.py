"""What a tutorial's kernel needs: the repository's scripts and shipped shot in its empty folder, and a shell.

A cell with `%%shell` in front is a script of bash that stops at the first failure, which then fails the page.
The magic of IPython for this sends its output in pieces of 100 bytes, through the middle of lines.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def shell(line: str, cell: str) -> None:
    """Run a cell; show what it printed, then what it warned of."""
    ran = subprocess.run(
        ["bash", "-e", "-o", "pipefail", "-c", cell], capture_output=True, text=True, check=False
    )
    sys.stdout.write(ran.stdout)
    sys.stderr.write(ran.stderr)
    sys.stdout.flush()
    sys.stderr.flush()
    ran.check_returncode()


def load_ipython_extension(ipython) -> None:
    """Set the place up: `%load_ext laboratory`."""
    os.environ.pop("FORCE_COLOR", None)  # set by the kernel; a page has no colours of a terminal
    shutil.copytree(ROOT / "runs", "runs", ignore=shutil.ignore_patterns("results"))
    ipython.register_magic_function(shell, magic_kind="cell")
