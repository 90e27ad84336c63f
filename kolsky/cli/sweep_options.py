"""A sweep as the command line describes it: its design, the ledger of its runs, who runs them."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kolsky.base.errors import InputError
from kolsky.base.process import process_pool
from kolsky.cli import texts

if TYPE_CHECKING:
    from doe import Box, Design
    from doe.constraints import Constraint
    from doe.designs import DesignKind

DEFAULT = {"friction": (0.0, 2.0), "stiffness_factor": (0.75, 1.25)}
"""Bounds of a sweep whose `--vary` says nothing."""
LEVELS = 10
"""Levels of each parameter then."""


@dataclass(frozen=True)
class DesignChoice:
    """A design of experiments and its region, as given on the command line."""

    kind: str
    """Name of a `doe.designs.DesignKind` at a command line."""
    bounds: Mapping[str, tuple[float, float]]
    """Bounds by name, SI; empty where a file names the parameters."""
    levels: Sequence[int] = ()
    """Levels of a full factorial."""
    runs: int = 64
    """Points of a design that takes any number."""
    seed: int = 1
    """Seed of a random design."""
    generators: str = ""
    """Words of a fractional factorial."""
    points: Path | None = None
    """File of a design somebody else chose."""
    logarithmic: tuple[str, ...] = ()
    """Parameters whose points are spread evenly in their logarithm."""
    where: tuple[str, ...] = ()
    """Constraints as in `doe.constraints.Constraint`."""

    @classmethod
    def of(cls, kind: str, vary: Sequence[str], **more: Any) -> "DesignChoice":
        """The choice from the texts of `--design` and `--vary`; the other fields as they are.

        Raises
        ------
        InputError
            If there is no such design, or a text cannot be read.
        """
        from doe.designs import DESIGNS, design_kind

        texts.one_of("--design", kind, tuple(design.option for design in DESIGNS.values()))
        needs = design_kind(kind).needs
        if "points" in needs:
            texts.none("--vary", vary, f"--design {kind}, whose file names the parameters")
            return cls(kind, {}, **more)
        if "levels" in needs:
            bounds, counts = texts.levels("--vary", vary) if vary else (DEFAULT, [LEVELS] * len(DEFAULT))
            return cls(kind, bounds, counts, **more)
        return cls(kind, texts.spans("--vary", vary) if vary else DEFAULT, **more)

    def design(self) -> "Design":
        """The points.

        A point that breaks a constraint is left out and counted; a design that chooses among candidates
        has only those that meet them.

        Raises
        ------
        InputError
            If options do not go together, or the design cannot be made of them.
        """
        from doe.designs import DESIGNS, design_kind
        from doe.designs.optimal import keep

        kind = design_kind(self.kind)
        for option, given, need in (
            ("--generators", bool(self.generators), "generators"),
            ("--points", self.points is not None, "points"),
        ):
            if given != (need in kind.needs):
                kinds = [other.option for other in DESIGNS.values() if need in other.needs]
                raise InputError(
                    texts.COMMAND_LINE,
                    f"{option} and --design {' or '.join(kinds)} need each other",
                    cure="give both, or neither",
                )
        if self.points is not None and self.logarithmic:
            raise InputError(
                texts.COMMAND_LINE, "--log has no effect on points from a file", cure="leave it out"
            )
        if self.points is not None:
            from kolsky.studies.design_file import read_design

            chosen = read_design(self.points)
            constraints = self._constraints(chosen.box)
        else:
            box = self._box()
            constraints = self._constraints(box)
            chosen = self._chosen(kind, box, constraints)
        try:
            return keep(chosen, *constraints) if constraints else chosen
        except ValueError as error:
            raise InputError(
                texts.COMMAND_LINE, f"--where: {error}", cure="relax it, or take more runs"
            ) from None

    def _box(self) -> "Box":
        from doe import Box
        from kolsky.inverse.parameters import design_box

        linear = design_box(self.bounds)
        bounds = dict(zip(linear.names, zip(linear.lower, linear.upper, strict=True), strict=True))
        try:
            return Box.of(bounds, logarithmic=self.logarithmic)
        except ValueError as error:
            raise InputError(
                texts.COMMAND_LINE, f"--log: {error}", cure="leave it out for a parameter that may be 0"
            ) from None

    def _constraints(self, box: "Box") -> "list[Constraint]":
        from doe.constraints import Constraint

        made = []
        for text in self.where:
            try:
                made.append(Constraint(text, box.names))
            except ValueError as error:
                raise InputError(
                    texts.COMMAND_LINE,
                    f"--where {error}",
                    cure="write an inequality of varied parameters in SI, e.g. "
                    '"friction <= stiffness_factor"',
                ) from None
        return made

    def _chosen(self, kind: "DesignKind", box: "Box", constraints: "list[Constraint]") -> "Design":
        candidates = None
        try:
            if "candidates" in kind.needs and constraints:
                from doe.designs.optimal import grid

                candidates = grid(box)
                for constraint in constraints:
                    candidates = candidates[constraint(candidates)]
            return kind.make(
                box,
                levels=self.levels,
                runs=self.runs,
                rng=self.seed,
                generators=self.generators,
                candidates=candidates,
            )
        except ValueError as error:
            raise InputError(
                texts.COMMAND_LINE,
                f"--design {self.kind}: {error}",
                cure="`kolsky sweep --help` shows what each design needs",
            ) from None


@dataclass(frozen=True)
class Records:
    """The ledger of a sweep as given on the command line."""

    ledger: str = ""
    """The file, "none", or empty for the one among the results."""
    retry: bool = False
    """True to run again those runs that did not complete."""
    shard: tuple[int, int] = (1, 1)
    """Part of the design to run, and number of parts."""
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
                raise InputError(texts.COMMAND_LINE, "--merge needs a ledger", cure="leave out --ledger none")
            return None
        path = Path(self.ledger) if self.ledger else folder / f"{self.stem}.sqlite"
        for other in self.merge:
            if other.resolve() == path.resolve():
                raise InputError(other, "is to be merged into itself", cure="leave out that --merge")
        return path

    def part(self, design: "Design") -> "Design":
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
            raise InputError(texts.COMMAND_LINE, f"--shard: {error}", cure="take fewer parts") from None
        return Design(design.points[rows], design.box, design.kind, design.settings)

    @contextmanager
    def usable(self) -> Iterator[None]:
        """A ledger that cannot be used is bad input: one line, exit code 2."""
        from doe.ledger import LedgerError

        try:
            yield
        except (LedgerError, OSError) as error:
            cure = "give another place with --ledger FILE, or --ledger none; --merge takes ledgers only"
            raise InputError(texts.COMMAND_LINE, f"--ledger: {error}", cure=cure) from error


@dataclass(frozen=True)
class Workers:
    """The processes that share a sweep, as given on the command line."""

    processes: int | None = None
    """Processes on this machine; None for this one alone."""
    dask: str = ""
    """Address of a Dask scheduler, or its scheduler file; empty for none."""

    @contextmanager
    def executor(self) -> Iterator[Any]:
        """The maker of the executor (`doe.executors.ExecutorFactory`); None where this process does the work.

        Raises
        ------
        InputError
            If both kinds are asked for, Dask is not installed, or its scheduler does not answer.
        """
        if self.dask and self.processes is not None:
            raise InputError(
                texts.COMMAND_LINE, "--dask and --processes exclude each other", cure="choose one"
            )
        if self.dask:
            from kolsky.cli.scheduler import client

            with client(self.dask) as cluster:
                yield cluster.get_executor
        elif self.processes is not None:
            yield partial(process_pool, self.processes)
        else:
            yield None

    def threads(self, given: int | None) -> int | None:
        """Threads of each worker: what was given, or the cores shared out among the processes."""
        if given is not None or self.processes is None:
            return given
        return max(1, (os.cpu_count() or 1) // self.processes)
