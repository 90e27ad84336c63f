"""The design of a sweep from what the command line says of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from kolsky.base.errors import InputError
from kolsky.cli.work.options import COMMAND_LINE

if TYPE_CHECKING:
    from doe import Box, Design
    from kolsky.cli.work.constraints import Constraint


@dataclass(frozen=True)
class DesignChoice:
    """Which design, over what."""

    kind: str
    """One of `kolsky.cli.work.options.DESIGNS`."""
    bounds: Mapping[str, tuple[float, float]]
    """Bounds by name, SI; empty where a file names the parameters."""
    levels: Sequence[int] = ()
    """Levels of a full factorial."""
    runs: int = 64
    """Points of a design that takes any number."""
    seed: int = 1
    """Of a random design."""
    generators: str = ""
    """Words of a fractional factorial."""
    points: Path | None = None
    """File of a design somebody else chose."""
    logarithmic: tuple[str, ...] = ()
    """Parameters whose points are spread evenly in their logarithm."""
    where: tuple[str, ...] = ()
    """Constraints as in `kolsky.cli.work.constraints.Constraint`."""

    def design(self) -> "Design":
        """The points.

        A point that breaks a constraint is left out and counted; a D-optimal design chooses among the
        candidates that meet them.

        Raises
        ------
        InputError
            If options do not go together, or the design cannot be made of them.
        """
        given = {"--generators": bool(self.generators), "--points": self.points is not None}
        for option, kind in {"--generators": "fractional", "--points": "csv"}.items():
            if given[option] != (self.kind == kind):
                raise InputError(COMMAND_LINE, f"{option} and --design {kind} need each other")
        if self.points is not None and self.logarithmic:
            raise InputError(COMMAND_LINE, "--log has no effect on points from a file", cure="leave it out")
        from doe.designs.optimal import keep
        from kolsky.cli.work.constraints import Constraint

        if self.points is not None:
            from kolsky.cli.work.designfile import read_design

            chosen = read_design(self.points)
            constraints = [Constraint(text, chosen.box.names) for text in self.where]
        else:
            box = self._box()
            constraints = [Constraint(text, box.names) for text in self.where]
            chosen = self._chosen(box, constraints)
        try:
            return keep(chosen, *constraints) if constraints else chosen
        except ValueError as error:
            raise InputError(COMMAND_LINE, f"--where: {error}", cure="relax it, or take more runs") from None

    def _box(self) -> "Box":
        from doe import Box
        from kolsky.inverse.parameters import design_box

        linear = design_box(self.bounds)
        bounds = dict(zip(linear.names, zip(linear.lower, linear.upper, strict=True), strict=True))
        try:
            return Box.of(bounds, logarithmic=self.logarithmic)
        except ValueError as error:
            raise InputError(COMMAND_LINE, f"--log: {error}") from None

    def _chosen(self, box: "Box", constraints: "list[Constraint]") -> "Design":
        from doe import DESIGNS

        try:
            match self.kind:
                case "factorial":
                    return DESIGNS["full_factorial"](box, self.levels)
                case "fractional":
                    return DESIGNS["fractional_factorial"](box, self.generators)
                case "composite":
                    return DESIGNS["central_composite"](box)
                case "box-behnken":
                    return DESIGNS["box_behnken"](box)
                case "d-optimal":
                    from doe.designs.optimal import grid

                    candidates = grid(box)
                    for constraint in constraints:
                        candidates = candidates[constraint(candidates)]
                    return DESIGNS["d_optimal"](box, self.runs, rng=self.seed, candidates=candidates)
                case _:
                    name = {"lhs": "latin_hypercube"}.get(self.kind, self.kind)
                    return DESIGNS[name](box, self.runs, rng=self.seed)
        except ValueError as error:
            raise InputError(COMMAND_LINE, f"--design {self.kind}: {error}") from None
