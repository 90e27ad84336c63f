"""The settings of `kolsky.identification.identify`."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from kolsky.inverse.forward import Numerics


@dataclass(frozen=True)
class Settings:
    """Free parameters, held parameters and numerical choices of an identification."""

    free: Mapping[str, tuple[float, float] | None] = field(default_factory=lambda: {"stiffness_factor": None})
    """Free parameters and the bounds of their design; None takes the default bounds."""
    held: Mapping[str, float] = field(default_factory=dict)
    """Parameters held at another value than the shot's."""
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
        clash = set(self.free) & set(self.held)
        if clash:
            raise ValueError(f"{', '.join(sorted(clash))}: a parameter is either free or held")
