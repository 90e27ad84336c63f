"""The text of the F-bar page."""

from math import log10

import dynamic_bonded as dynamic
import fbar_checks as checks
import fbar_runs as runs
import fbar_tables as tables
import numpy as np
import static_bonded as static
from fbar_checks import Result
from fbar_runs import ELEMENTS
from scene import table


def page(result: Result) -> str:
    """The page's text."""
    orders = {element: runs.small_order(element) for element in ELEMENTS}
    common, wanted = runs.common_forces(), static.reference().force
    landings = [static.compress(mesh, element="one_point").landings[0] for mesh in runs.MESHES]
    collapsed = static.compress((8, 11), element="one_point", hourglass=runs.CHI[0])
    cylinder, flat = tables.hourglass_tables()
    alone, batch = ([runs.cost(element, n) for element in ELEMENTS] for n in (1, 8))
    price = table(
        ["", *tables.NAMES.values(), "ratio"],
        [
            [name, *(f"{1e9 * t:.0f} ns" for t in pair), f"{pair[1] / pair[0]:.1f}"]
            for name, pair in (("one simulation", alone), ("batch of 8", batch))
        ],
    )
    steps = [int(dynamic.simulate(dynamic.Grid(48, 66), element=element).steps[0]) for element in ELEMENTS]
    best = {element: result.single[element].gradient for element in ELEMENTS}
    fall = np.mean([log10(b[0] / b[3]) / log10(100.0**0.75) for b in best.values()])
    return f"""# F-bar element

**What is checked.** The fully integrated quadrilateral with a mean dilatation (`Model.element = "fbar"`; see
[the solver](../theory/solver.md)) beside the one-point quadrilateral with hourglass control
(`"one_point"`): each by itself, in slow and in fast bonded compression, extrapolated to an infinitely fine
mesh, and their price.

**Which one to take.** *One-point* is the default and the one for identification, where thousands of runs are
wanted: with this specimen its dynamic force is as good as F-bar's mesh for mesh, its static force is better
(the fully integrated element is too stiff in shear and bending), and F-bar costs {batch[1] / batch[0]:.1f}
times as much in a batch. Take
*F-bar* to check a result with an element that has nothing to tune and cannot hourglass; for a few elements
across a flat disc or a coarse mesh, where the one-point force depends on χ; whenever the ledger's hourglass
entry passes 1 % of the elastic energy; and where the *shape* matters most: on equal meshes its outline is
nearer to the reference, in slow compression by up to two. The elements' errors differ in size, so that their
difference on a mesh says more of its error than either does alone.

**Independent source.** Closed forms; the energy for the force; the element's own eigenvalues for the step
bound; for the compressions the programs of [static](static_bonded.md) and [dynamic](dynamic_bonded.md)
bonded compression. The dynamic reference is itself made of fully integrated elements, so F-bar shares its
discretisation; the static consensus has elements of second order.

## One element

Set-up of each line as on its own page ([patch](patch.md), [energy](energy.md),
[frictionless](frictionless.md)); for the difference of the energy a distorted mesh squeezed by 40 %, every
corner moved at random by 3 % of an element, ν = 0.495:

{tables.single_table(result)}

The difference falls with the power {fall:.1f} of its step, then rises with round-off.

**Step bound.** Bound over the element's own largest frequency squared (with damping: of the undamped element
with the same stable step), from differences of its forces: least, median and largest of 3 × 192 elements in
a bonded impact at 20, 40 and 60 %. Below 1 the bound fails; far above 1 it wastes steps. β = {checks.BETA:g}
s:

{tables.bounds_table(result)}

The one-point bound leaves out that the pressure works on rotations and may miss by 2 %, well inside the
default safety of 0.9; and it adds radial and axial motion where F-bar's takes the larger, which costs it
about a tenth of the step when the deviator is damped.

## Slow bonded compression

Force error [%], largest error of the radius at mid-height, and rms distance of the outline (FElupe, largest
from 30 % on):

{tables.static_table()}

Two elements that solve one problem have one limit. Fitted to the eight forces at each compression: that
limit, one order, and a constant for each element ("deviation": the largest distance of a mesh from the law):

{tables.common_limits_table()}

The limits contain the loading's own part, 0.1 % at 10 % and at 20 % ([static](static_bonded.md)). At 10 %,
before a node of the side lands, the law holds to {common[0].deviation / wanted[0]:.0e}. The order is the
bonded edge's: the stress there is singular, in a linear incompressible solid with
u ~ r^{runs.STATIC_ORDER / 2:.3f} (Williams 1952), so that no element of low order converges faster than
h^{runs.STATIC_ORDER:.2f} on a uniform mesh. The measured order is lower still, which agrees with the side's
rolling onto the platen: it begins the earlier the finer the mesh (the first node lands at
{100 * landings[0]:.0f} to {100 * landings[-1]:.0f} %, one-point), so a part of it stays below the mesh. From
20 % on the landing of single nodes scatters the forces, and the fitted order with them.

Each element alone, extrapolated with the order of linear theory, as differences from the reference; in
brackets the largest distance of a mesh from the law:

{tables.static_limits_table()}

## Impact

Rms difference of the transmitted force from the reference (FElupe, side sticks) to 1.5 ms, over its
peak [%], and rms distances of the outline:

{tables.impact_table()}

Extrapolated with h², rms differences over the peak [%]:

{tables.impact_limits_table()}

The two limits agree with each other better than either with the reference: from 1 ms on, where nodes land
one by one, it carries the error of its own 48 × 66 mesh.

Fitted order of the 5 kHz force at small strain, toward a mesh of 96 × 132 (second order shows as 2.2):
{orders["one_point"].order:.2f} ± {orders["one_point"].standard_error:.2f} one-point, \
{orders["fbar"].order:.2f} ± {orders["fbar"].standard_error:.2f} F-bar.

## Where hourglass control matters

The default χ = 0.3 was chosen on this specimen. Slow bonded compression, force error [%], and share of the
hourglass energy in the elastic one:

{cylinder}

With too little control on a coarse mesh the edge elements collapse past 50 %, and the ledger shows little of
it: {100 * collapsed.hourglass[-1]:.1f} % of the energy at a
force that is wrong by half.

A flat disc of {1e3 * runs.DISC:g} mm (R/L = 4.75), bonded, slowly:

{flat}

On 16 × 4 the one-point force at 40 % varies by {tables.disc_spread():.0f} % with χ. Neither element is exact
there: F-bar has the stiffness of χ = 1, as it should, since χ = 1 gives the hourglass patterns what full
integration would. The cure is a finer mesh; the two elements side by side tell when it is fine enough.

## Price

One element, step and simulation on one core of the machine that wrote this page, fp64:

{price}

F-bar evaluates the material law at four points, but loads and gathers its corners as often as the other.
Steps to 1.5 ms on 48 × 66: {steps[0]} and {steps[1]}.

**Tolerance.** Patch, energy and closed form as on their pages. Gradient 1e-8: central differences in fp64,
and K/μ = 100. Step bound not below 1 (one-point {checks.BOUND_FLOOR["one_point"]:g}). F-bar static force
{100 * checks.STATIC_TOLERANCE["coarse"]:g} % on 16 × 22 and {100 * checks.STATIC_TOLERANCE["fine"]:g} % on
48 × 66, radius {1e6 * checks.RADIUS_TOLERANCE["coarse"]:g} and {1e6 * checks.RADIUS_TOLERANCE["fine"]:g} µm.
Extrapolated static forces, common or each alone, within {100 * checks.LIMIT_TOLERANCE:g} % of the reference.
5 kHz force {100 * checks.IMPACT_TOLERANCE["coarse"]:g} % on 16 × 22 and
{100 * checks.IMPACT_TOLERANCE["fine"]:g} % on 48 × 66; extrapolated, within {100 * checks.AGREEMENT:g} % of
each other.
"""
