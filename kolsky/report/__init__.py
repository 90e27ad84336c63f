"""Reports and figures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kolsky.identification import Identification

__all__ = ["write_report"]


def write_report(path: Path, identification: Identification) -> None:
    """Write the report of one shot as a single HTML file; see `kolsky.report.page.write_report`."""
    from kolsky.report import page  # Matplotlib is loaded when a report is written, not before

    page.write_report(path, identification)
