"""Adds the repository's root to the path: `contributed` is not installed, and tests share helpers."""

import sys
from pathlib import Path

ROOT = str(Path(__file__).resolve().parents[1])
if ROOT not in sys.path:
    sys.path.append(ROOT)  # last: the tests use the installed packages
