"""Settings of an identification and of its runs: free parameters, numerical choices, options of a command.

The command line makes its options from these fields. The module therefore does not import a solver.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Annotated, Literal

from kolsky.base.apparatus import check_interval
from kolsky.base.errors import InputError
from kolsky.base.options import ADVANCED, COMMAND_LINE, NUMERICAL, TOGETHER, Option, check_options
from kolsky.inverse.parameters import PARAMETERS

LEAST_ACROSS = 10
"""Smallest number of elements across the radius of a mesh used to correct for Poisson's ratio."""

FreeParameters = Mapping[str, tuple[float, float] | None]
"""Parameters and the bounds of their search; None for the default bounds."""


def _usable_device(option: str, text: str) -> str:
    """The device if this machine has it. Raises InputError otherwise."""
    from explicit.device import select_device

    try:
        select_device(text)
    except ValueError as error:
        cure = "give cpu, cuda or cuda:N; `kolsky doctor` lists the devices"
        raise InputError(COMMAND_LINE, f"{option}: {error}", cure=cure) from None
    return text


def _compressible() -> float:
    from explicit.incompressible import COMPRESSIBLE

    return COMPRESSIBLE


_numerical = partial(Option, panel=NUMERICAL)
Mesh = Annotated[
    tuple[int, int], _numerical("Elements across the radius x along the length.", metavar="NRxNY")
]
Device = Annotated[str, _numerical('"cpu", a CUDA device such as "cuda:0", or "cuda".', read=_usable_device)]
Threads = Annotated[int | None, _numerical("CPU threads.", min=1, show_default="all cores")]
Seed = Annotated[int, Option("Seed of every random draw.", min=0, panel=ADVANCED)]


@dataclass(frozen=True)
class Numerics:
    """Numerical choices of a run; they are part of every result's provenance.

    Raises ValueError if a choice is unknown or a number outside its range.
    """

    mesh: Mesh = (20, 27)
    grading: float = 2.0
    """Largest over smallest element; the small ones lie at the surface, where the specimen rolls over."""
    safety: float = 0.9
    """Time step divided by the stability limit [-]."""
    precision: Annotated[
        Literal["fp64", "fp32"] | None,
        _numerical(
            "Arithmetic of the solver: fp64 or fp32.",
            metavar="CHOICE",
            show_default="fp64; a search uses fp32 first where nothing slides",
        ),
    ] = None
    """None: double precision, except in a search before its last run, see `for_search`."""
    device: Device = "cpu"
    threads: Threads = None
    past_data: Annotated[
        Literal["continue", "stop"],
        _numerical(
            "Beyond the quasi-static curve's end: continue on its tangent, or stop the run.", metavar="CHOICE"
        ),
    ] = "continue"
    element: Annotated[
        Literal["one_point", "fbar"],
        _numerical("one_point, or fbar: fully integrated, three times as expensive."),
    ] = "one_point"
    hourglass_form: Annotated[
        Literal["stiffness", "viscous"],
        _numerical("Hourglass control of one_point: stiffness or viscous.", name="hourglass"),
    ] = "stiffness"
    compressible: Annotated[
        float | None,
        _numerical(
            "Run at poisson = 0.495 and correct it on coarser meshes: cheaper above 0.499.",
            name="nearly-incompressible",
            on=_compressible,
        ),
    ] = None
    """Poisson's ratio of the runs. Coarser meshes give the correction to the requested ratio, see
    `explicit.run_nearly_incompressible`. None runs the requested ratio directly. Every requested ratio must
    be larger."""

    def __post_init__(self) -> None:
        check_options(self)

    def with_mesh(self, mesh: tuple[int, int]) -> "Numerics":
        """The same choices on another mesh."""
        return replace(self, mesh=mesh)

    def with_other_element(self) -> "Numerics":
        """The same choices with the other element, for the estimate of the mesh error."""
        return replace(self, element="fbar" if self.element == "one_point" else "one_point")

    def for_search(self) -> "Numerics":
        """The same choices for all but the last runs of a search: in single precision, if none is chosen.

        On a coarse mesh its rounding moves an optimum by less than 0.02 of its standard uncertainty. It is
        not used if a surface slides, where single runs jump, nor with a correction for Poisson's ratio.
        """
        if self.precision is not None or self.compressible is not None:
            return self
        return replace(self, precision="fp32")

    def coarser(self) -> "tuple[Numerics, Numerics]":
        """The meshes for the Poisson correction, 1/2 and 3/8 as fine; ValueError if too coarse."""
        if self.mesh[0] < LEAST_ACROSS + 2:
            raise ValueError(
                f"correcting for Poisson's ratio needs {LEAST_ACROSS + 2} elements or more across the "
                f"radius, got {self.mesh[0]}: run it directly"
            )
        share = max(0.5, LEAST_ACROSS / self.mesh[0])
        half = round(share * self.mesh[0]), round(share * self.mesh[1])
        return self.with_mesh(half), self.with_mesh((round(0.75 * half[0]), round(0.75 * half[1])))


@dataclass(frozen=True)
class Settings:
    """Free parameters, held parameters and numerical choices of an identification.

    Raises ValueError if a choice is unknown, a number outside its range, or a parameter both free and held.
    """

    free: Annotated[
        FreeParameters | None,
        Option(
            f"Free parameter and the bounds of its search; repeat for more. {', '.join(PARAMETERS)}.",
            metavar="NAME[=LOW:HIGH]",
            show_default="stiffness_factor, and poisson and damping if the data constrain them",
        ),
    ] = None
    """Free parameters; all others are held. Default: the choice of `kolsky.inverse.problem.choose`."""
    held: Mapping[str, float] = field(default_factory=dict)
    """Parameters held at values that differ from the shot's."""
    hold: tuple[str, ...] = ()
    """Parameters held at the shot's values that would be free by default."""
    numerics: Numerics = field(default_factory=Numerics)
    refined_mesh: Annotated[
        tuple[int, int], Option("Mesh of the final estimate and its check.", metavar="NRxNY", panel=NUMERICAL)
    ] = (48, 64)
    replicates: Annotated[
        int,
        Option(
            "Random draws of the curve's noise, and of the flyer's in several shots or sliding; 0: none.",
            min=0,
            panel=ADVANCED,
        ),
    ] = 32
    replicate_mesh: tuple[int, int] = (16, 22)
    """The mesh of the replicates. The difference of two runs does not need a fine mesh."""
    bayes: Annotated[bool, Option("Sample the posterior too; needs emcee.", panel=ADVANCED)] = False
    pull: Annotated[
        Literal["first", "conditioned"],
        Option("Loading of the quasi-static curve that m refers to: first or conditioned.", panel=ADVANCED),
    ] = "first"
    seed: Seed = 1

    def __post_init__(self) -> None:
        check_options(self)
        clash = set(self.free or ()) & {*self.held, *self.hold} | set(self.held) & set(self.hold)
        if clash:
            raise ValueError(f"{', '.join(sorted(clash))}: a parameter is either free or held, at one value")


def require_finer(refined: tuple[int, int], mesh: tuple[int, int]) -> None:
    """Raise ValueError if a refined mesh is not finer than that of the search in both directions."""
    if not (refined[0] > mesh[0] and refined[1] > mesh[1]):
        raise ValueError(
            f"the refined mesh {refined} must be finer than that of the search {mesh}: the mesh error is "
            "extrapolated from both"
        )


MOST_NODES = 24


@dataclass(frozen=True)
class JointSettings:
    """Settings of a joint identification: free and held parameters, unknowns of each shot, numerics.

    Raises ValueError if a number is outside its range, or if the refined mesh is not finer.
    """

    free: Mapping[str, tuple[float, float] | None] | None = None
    """Shared free parameters and bounds, None for default ones. Default: those free in every shot."""
    held: Mapping[str, float] = field(default_factory=dict)
    """Parameters held at values that differ from those of the shots."""
    hold: tuple[str, ...] = ()
    """Parameters held at the shots' values that would be free by default."""
    numerics: Numerics = field(default_factory=lambda: Numerics(mesh=(16, 22)))
    refined_mesh: tuple[int, int] = (32, 43)
    replicates: int = 24
    """Number of draws of each flyer motion and curve; with 0, weights and intervals lack their noise."""
    curve_nodes: Annotated[
        int, Option("Estimate the curve too, at this number of strains (4 to 24).", min=0, panel=TOGETHER)
    ] = 0
    """Number of free nodes of the curve: 0 or 4 to `MOST_NODES`. They replace the stiffness factor."""
    curve_roughness: Annotated[
        float, Option("Standard deviation of the second difference of the nodes' logarithms.", panel=TOGETHER)
    ] = 0.1
    gain_each: Annotated[
        float,
        Option(
            'Standard uncertainty of each shot\'s gain, "0.5 %".', metavar="PERCENT", unit="1", panel=TOGETHER
        ),
    ] = 0.0
    """Standard uncertainty of the force scale of each shot, in addition to a shared calibration [-]."""
    scatter: Annotated[bool, Option("Assume no specimen-to-specimen scatter.", panel=TOGETHER)] = True
    """True if the shots may differ in stiffness beyond their noise; the scatter is estimated."""
    seed: int = 1

    def __post_init__(self) -> None:
        check_options(self)
        check_interval("[0, inf)", seed=self.seed, replicates=self.replicates)
        if self.curve_nodes and not 4 <= self.curve_nodes <= MOST_NODES:
            raise ValueError(f"curve_nodes must be 0 or 4 to {MOST_NODES}, got {self.curve_nodes}")
        if not 0.0 < self.curve_roughness < 10.0:
            raise ValueError(f"curve_roughness must be in (0, 10), got {self.curve_roughness}")
        if not 0.0 <= self.gain_each < 1.0:
            raise ValueError(f"gain_each must be in [0, 1), got {self.gain_each}")
        if self.numerics.compressible is not None:
            raise ValueError("a joint identification runs Poisson's ratio directly: leave the correction out")
        require_finer(self.refined_mesh, self.numerics.mesh)

    def of_one(self) -> Settings:
        """The free and held parameters as settings for a single shot."""
        return Settings(free=self.free, held=self.held, hold=self.hold, numerics=self.numerics)
