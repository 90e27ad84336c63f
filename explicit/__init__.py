"""Explicit finite elements for impact on soft axisymmetric specimens: many simulations at once, CPU or GPU.

The inputs of `run` are a constant `Model` and `Samples`. The `Model` contains a `Mesh` such as `cylinder`,
materials, contact laws, the motion of the platens and a support. `Samples` has one row of parameters for each
simulation. `run` returns a `Response` with forces, outlines, an `EnergyLedger` and the `Outcome` of each
simulation. `Sampling` sets the recorded quantities and times. `Stepping` sets the time integration.
`run_side_by_side` runs batches of different models. Laws are in `explicit.materials` and `explicit.contact`,
elements in `explicit.elements`, the relaxation in `explicit.relaxation`, elastic bars in `explicit.bars`.
Each name is loaded when it is first used.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from explicit.aot import ahead_of_time
    from explicit.incompressible import NearlyIncompressible, run_nearly_incompressible
    from explicit.mesh import Mesh, cylinder
    from explicit.model import Model, Samples, Sampling, Stepping
    from explicit.platens import RIGID, CharacteristicBar, MovingSupport, PlatenMotion
    from explicit.response import Ending, EnergyLedger, Outcome, Response
    from explicit.run_batch import Problem, compile_time_loops, run, run_side_by_side

_HOME = {
    "CharacteristicBar": "explicit.platens",
    "Ending": "explicit.response",
    "EnergyLedger": "explicit.response",
    "Mesh": "explicit.mesh",
    "Model": "explicit.model",
    "MovingSupport": "explicit.platens",
    "NearlyIncompressible": "explicit.incompressible",
    "Outcome": "explicit.response",
    "PlatenMotion": "explicit.platens",
    "Problem": "explicit.run_batch",
    "RIGID": "explicit.platens",
    "Response": "explicit.response",
    "Samples": "explicit.model",
    "Sampling": "explicit.model",
    "Stepping": "explicit.model",
    "ahead_of_time": "explicit.aot",
    "compile_time_loops": "explicit.run_batch",
    "cylinder": "explicit.mesh",
    "run": "explicit.run_batch",
    "run_nearly_incompressible": "explicit.incompressible",
    "run_side_by_side": "explicit.run_batch",
}
"""Module of each public name. The imports above repeat this list for type checkers; a test compares both."""

__all__ = [*_HOME]


def __getattr__(name: str) -> Any:
    """Load a public name on first use."""
    if name not in _HOME:
        raise AttributeError(f"module 'explicit' has no attribute {name!r}; it offers {', '.join(_HOME)}")
    from importlib import import_module

    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
