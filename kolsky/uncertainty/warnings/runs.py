"""Warnings from the simulations: strain past the curve, hourglass control, lost runs, sliding."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from explicit import Mesh, Response
from explicit.contact import contact_law
from explicit.folding import corner_areas
from kolsky.base.apparatus import SLIDING_LAW, Interface
from kolsky.inverse.parameters import any_slides
from kolsky.inverse.run_table import DesignTable

PAST_CURVE = 0.01
"""Share of the specimen past the quasi-static curve from which on it is said."""
FOLDED = -0.4
"""Area at an element's corner over the undeformed one below which the edge is called folded over [-]: chosen
on impacts with friction of 0.1, 0.3 and 0.5, judged on drawn ones (docs/validation/folding)."""
ARTIFICIAL = 0.01
"""Energy of hourglass control over the strain energy from which on it is said."""


def past_curve(share: float, reached: float, checks: Mapping[str, float]) -> Iterator[str]:
    """Say that the material was strained beyond what the quasi-static test covers.

    Parameters
    ----------
    share : float
        Largest share of the specimen's volume past the curve [-].
    reached : float
        Largest s = sqrt(I1 - 3) [-].
    checks
        "curve_last_s" and "curve_last_strain" of `kolsky.inverse.prepared_shot.PreparedShot.checks`.
    """
    if share > PAST_CURVE:
        last, strain = checks["curve_last_s"], checks["curve_last_strain"]
        yield (
            f"{100.0 * share:.0f} % of the specimen's volume was strained past the quasi-static curve: "
            f"s = sqrt(I1 - 3) reached {reached:.3g}, the curve ends at {last:.3g} (nominal strain "
            f"{strain:+.2g}); from there the law goes on without a test that supports it. "
            f"A curve to a nominal strain of {equivalent_strain(reached, strain):+.2g} would cover it"
        )


def hourglass(response: Response) -> Iterator[str]:
    """Say that hourglass control took part in the answer of the batch's first simulation."""
    if not response.outcomes[0].ok:
        return
    share = float(response.energy.artificial_share()[0])
    if share > ARTIFICIAL:
        yield (
            f"hourglass control stored and dissipated {100.0 * share:.2g} % of the strain energy; refine the "
            "mesh, or check with --element fbar"
        )


def folded(response: Response, mesh: Mesh, interface: Interface, named: Sequence[str]) -> Iterator[str]:
    """Say that the edge of a sliding specimen folded over in the batch's first simulation.

    Where a face slides with friction and its edge rolls onto the platen, the elements there are bent into a
    fold. Once a corner is turned inside out by more than `FOLDED`, the edge comes loose and jumps along the
    platen by up to 0.2 mm, and the run completes all the same (docs/validation/folding).

    Parameters
    ----------
    response
        The batch, with its nodes; one without them is not looked at.
    mesh
        Its mesh.
    interface
        The interface as the shot declares it.
    named
        Parameters that were named; one that slides replaces that interface.
    """
    laws = [contact_law(law) for law in (interface.faces, interface.side)]
    slides = any_slides(named) or any(law.needs_friction for law in laws)
    if not slides or response.nodes is None or not response.outcomes[0].ok:
        return
    worst = corner_areas(mesh, response.nodes[0]).min(axis=2)
    over = np.flatnonzero((worst < FOLDED).any(axis=1))
    if over.size:
        time, element = response.surface_times[over[0]], int(np.argmin(worst[over[0]]))
        r, y = mesh.nodes[mesh.quads[element]].mean(axis=0)
        yield (
            f"from {1e6 * time:.0f} us on the sliding edge is folded over (element {element} at R = "
            f"{1e3 * r:.2f} mm, Y = {1e3 * y:.2f} mm has a corner turned inside out): the edge may jump along"
            " the platen, and its radius and the contact's are not known better than to 0.2 mm; compare with "
            "--element fbar, end the window before, or hold the face"
        )


def lost_runs(table: DesignTable, rest: str = "") -> Iterator[str]:
    """Count the runs that did not complete, by stage and `explicit.Outcome`, and tell the first of each kind.

    Parameters
    ----------
    table
        Every run.
    rest : str
        What the others are for, said behind the count.
    """
    kinds: dict[str, list[int]] = {}
    for run in table.lost:
        kinds.setdefault(f"{table.stage[run]}: {table.outcomes[run]}", []).append(run)
    if kinds:
        counts = ", ".join(f"{len(runs)} in {kind}" for kind, runs in kinds.items())
        yield f"{len(table.lost)} of {len(table.outcomes)} runs did not complete ({counts}){rest}"
    for runs in kinds.values():
        values = zip(table.names, table.points[runs[0]], strict=True)
        point = ", ".join(f"{name} = {value:.4g}" for name, value in values)
        yield f"run {runs[0]} ({point}) ended {table.ending(runs[0]).sentence}"


def run_again(damaged: Sequence[str]) -> Iterator[str]:
    """Name the runs that a ledger held damaged and that were therefore made anew.

    Parameters
    ----------
    damaged
        Beginnings of their keys.
    """
    if damaged:
        said = ", ".join(damaged[:5]) + (", ..." if len(damaged) > 5 else "")
        yield (
            f"{len(damaged)} runs in the ledger were damaged ({said}) and have been run again: check the"
            " disk that it lies on"
        )


def sliding(interface: Interface, named: list[str]) -> Iterator[str]:
    """Say that naming a parameter that slides replaced the declared interface; see
    `kolsky.inverse.forward.Forward.run`."""
    names = [name for name in named if any_slides([name])]
    if names and {interface.faces, interface.side} != {SLIDING_LAW}:
        yield (
            f"with {names[0]} as a parameter, Coulomb's law replaced the interface that the shot declares "
            f"(faces {interface.faces}, side {interface.side}): the specimen may slide and lift off"
        )


def equivalent_strain(s: float, branch: float) -> float:
    """Nominal strain of a uniaxial test with the same I1: lam^2 + 2 / lam = 3 + s^2 on one branch."""
    roots = np.roots([1.0, 0.0, -(3.0 + s**2), 2.0]).real
    lam = roots.max() if branch > 0.0 else roots[roots > 0.0].min()
    return float(lam - 1.0)
