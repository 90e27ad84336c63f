"""Where a sweep's runs are kept, which part of the design is run, and what is taken over from other parts."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kolsky.base.errors import InputError

COMMAND_LINE = Path("command line")


@dataclass(frozen=True)
class Records:
    """The ledger of `kolsky sweep` as given on the command line."""

    ledger: str = ""
    """The file, "none", or empty for the one among the results."""
    retry: bool = False
    """Whether to run again what did not complete."""
    shard: tuple[int, int] = (1, 1)
    """Which part of how many."""
    merge: tuple[Path, ...] = ()
    """Ledgers to take over."""

    @property
    def stem(self) -> str:
        """Name of this part's files: parts run side by side, each with its own."""
        part, parts = self.shard
        return "sweep" if parts == 1 else f"sweep-{part}of{parts}"

    def place(self, folder: Path) -> Path | None:
        """The ledger's file; None if there is to be none.

        Raises
        ------
        InputError
            If a file is to be merged into itself, or ledgers are to be merged into none.
        """
        if self.ledger == "none":
            if self.merge:
                raise InputError(COMMAND_LINE, "--merge needs a ledger", cure="leave out --ledger none")
            return None
        path = Path(self.ledger) if self.ledger else folder / f"{self.stem}.sqlite"
        for other in self.merge:
            if other.resolve() == path.resolve():
                raise InputError(other, "is to be merged into itself", cure="leave out that --merge")
        return path

    def part(self, design: Any) -> Any:
        """The points of a design that this part runs.

        Raises
        ------
        InputError
            If there are more parts than points.
        """
        if self.shard == (1, 1):
            return design
        from doe import Design
        from doe.executors import shard

        try:
            rows = shard(len(design), *self.shard)
        except ValueError as error:
            raise InputError(COMMAND_LINE, f"--shard: {error}") from None
        return Design(design.points[rows], design.box, design.kind, design.settings)

    @contextmanager
    def usable(self) -> Iterator[None]:
        """A ledger that cannot be used is bad input: one line, exit code 2."""
        from doe.ledger import LedgerError

        try:
            yield
        except (LedgerError, OSError) as error:
            cure = "give another place with --ledger FILE, or --ledger none; --merge takes ledgers only"
            raise InputError(COMMAND_LINE, f"--ledger: {error}", cure=cure) from error
