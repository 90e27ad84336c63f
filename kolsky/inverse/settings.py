"""The settings of `kolsky.identification.identify`."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from kolsky.inverse.forward import Numerics


@dataclass(frozen=True)
class Settings:
    """Free parameters, held parameters and numerical choices of an identification."""

    free: Mapping[str, tuple[float, float] | None] | None = None
    """Free parameters and the bounds of their design, None for the default bounds; all others are held.
    Left out, the stiffness factor is free, and Poisson's ratio and damping where the shot can tell them,
    see `kolsky.inverse.free_parameters.choose`."""
    held: Mapping[str, float] = field(default_factory=dict)
    """Parameters held at another value than the shot's."""
    hold: tuple[str, ...] = ()
    """Parameters held at the shot's values that would be free by default."""
    numerics: Numerics = field(default_factory=Numerics)
    """The surrogate's mesh and the arithmetic."""
    refined_mesh: tuple[int, int] = (64, 86)
    """The mesh the answer is given on."""
    replicates: int = 64
    """Draws of the flyer's motion and of the curve, each; 0 leaves their noise out of the interval."""
    replicate_mesh: tuple[int, int] = (16, 22)
    """The mesh of the replicates: a difference of two runs needs no fine one."""
    methods: Literal["surrogate", "all"] = "surrogate"
    """Whether only the surrogate is searched, or least squares on the solver too ("all")."""
    bayes: bool = False
    """Whether the posterior is sampled too (emcee, the extra [bayes])."""
    pull: Literal["first", "conditioned"] = "first"
    """Which quasi-static curve m refers to: that of the first pull, or of the conditioned material."""
    seed: int = 1
    """Seed of every random draw."""

    def __post_init__(self) -> None:
        if self.methods not in ("surrogate", "all"):
            raise ValueError(f'methods must be "surrogate" or "all", got {self.methods!r}')
        if self.pull not in ("first", "conditioned"):
            raise ValueError(f"pull must be 'first' or 'conditioned', got {self.pull!r}")
        clash = set(self.free or ()) & {*self.held, *self.hold} | set(self.held) & set(self.hold)
        if clash:
            raise ValueError(f"{', '.join(sorted(clash))}: a parameter is either free or held, at one value")
