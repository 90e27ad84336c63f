"""Setup of a tutorial's kernel: the repository's scripts and a shot in its empty folder, and a shell.

A cell that begins with `%%shell` is a bash script. It stops at the first failure, and the page then fails.
IPython's own magic is not used, because it splits the output into pieces of 100 bytes.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def shell(line: str, cell: str) -> None:
    """Run a cell. Show its output, then its warnings."""
    ran = subprocess.run(
        ["bash", "-e", "-o", "pipefail", "-c", cell], capture_output=True, text=True, check=False
    )
    sys.stdout.write(ran.stdout)
    sys.stderr.write(ran.stderr)
    sys.stdout.flush()
    sys.stderr.flush()
    ran.check_returncode()


def load_ipython_extension(ipython) -> None:
    """Set up the kernel: `%load_ext laboratory`."""
    os.environ.pop("FORCE_COLOR", None)  # the kernel sets it; a page has no terminal colours
    shutil.copytree(ROOT / "runs", "runs", ignore=shutil.ignore_patterns("results"))
    ipython.register_magic_function(shell, magic_kind="cell")
