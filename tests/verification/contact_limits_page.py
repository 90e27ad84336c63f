"""The text of the page on contact's limits and ledgers."""

import numpy as np
from contact_limits import (
    ENERGY_TOLERANCE,
    FITTED,
    FRICTION_ORDER,
    GAP_TOLERANCE,
    MOMENTUM_TOLERANCE,
    ORDER_TOLERANCE,
    PRESS_TOLERANCE,
    PULL_TOLERANCE,
    SLIPPING,
    STATIC_TOLERANCE,
    TITLE,
    Result,
    order_of_friction,
    orders,
)
from contact_limits_runs import (
    DRAG,
    FRICTION,
    LAWS,
    N_STEPS,
    PULLED,
    RELEASE,
    SLOW,
    STEP,
    STIFFNESS,
    same_bits,
    twice,
)
from friction import name
from friction_runs import COARSE, compress, force_difference, known
from friction_runs import FRICTION as STATIC
from scene import table

SET = {"friction": "f = {:g}", "release_stress": "{:g} Pa"}
"""How a law's parameter is written."""


def ledgers(result: Result) -> str:
    """Every step of an impact, by law."""
    rows = [
        [
            ", ".join([law.replace("_", " "), *(SET[name].format(x) for name, x in LAWS[law].items())]),
            f"{1e6 * entry.penetration:.2g}",
            str(entry.rolled),
            f"{entry.momentum:.0e}",
            f"{100 * entry.energy:.4f}",
            f"{100 * entry.friction:.2f}",
            f"{100 * entry.impact:.2f}",
            f"{entry.tension:.2f}",
        ]
        for law, entry in result.ledgers.items()
    ]
    header = [
        "law",
        "deepest node [µm]",
        "side nodes on the platen",
        "momentum [-]",
        "energy [% of work]",
        "friction [% of work]",
        "impact [% of work]",
        "smallest force [N]",
    ]
    return table(header, rows)


def penalty(result: Result) -> str:
    """Distance of the penalty law from the kinematic one."""
    d, fits = result.penalty, orders(result)
    rows = [
        [
            f"{k:.0e}",
            f"{1e6 * result.depth[i]:.2g}",
            f"{1e6 * d.outline[i]:.2g}",
            f"{100 * d.force[i]:.2g}",
            f"{100 * d.impulse[i]:.2g}",
        ]
        for i, k in enumerate(STIFFNESS)
        if i % 2 == 0
    ]
    names = ("penetration", "outline", "force", "impulse")
    rows.append(["order in 1/k", *(f"{fits[n].order:.3f} ± {fits[n].standard_error:.3f}" for n in names)])
    header = ["k [Pa/m]", "deepest node [µm]", "outline, rms [µm]", "force, rms [%]", "impulse [%]"]
    return table(header, rows)


def friction(result: Result) -> str:
    """Distance of Coulomb's law from the rough one."""
    d = result.friction
    rows = [
        [f"{f:g}", f"{1e6 * d.outline[i]:.2g}", f"{100 * d.force[i]:.2g}", f"{100 * d.impulse[i]:.2g}"]
        for i, f in enumerate(FRICTION)
        if i % 2 == 1
    ]
    return table(["f", "outline, rms [µm]", "force, rms [%]", "impulse [%]"], rows)


def static() -> str:
    """Both formulations against the static solutions of GetFEM."""
    rows = []
    for f, hard, soft in zip(STATIC, compress(COARSE), compress(COARSE, contact="penalty"), strict=True):
        reference = known(f)
        rows.append(
            [
                name(f),
                f"{100 * reference.compression[-1]:.0f} %",
                *(f"{100 * np.abs(force_difference(x, reference)).max():.2f}" for x in (hard, soft)),
                f"{100 * np.abs(soft.force / hard.force - 1.0).max():.4f}",
                f"{1e6 * soft.penetration:.3f}",
            ]
        )
    header = ["f", "up to", "Coulomb − GetFEM [%]", "penalty − GetFEM [%]", "penalty − Coulomb [%]"]
    return table([*header, "penetration [µm]"], rows)


def release(result: Result) -> str:
    """Impacts by release stress."""
    r = result.release
    rows = [
        [
            "∞" if np.isinf(stress) else f"{1e-3 * stress:g}",
            f"{r.force_transmission[i].min():.2f}",
            f"{r.force_flyer[i].min():.2f}",
            f"{1e3 * r.impulse_transmission[i, -1]:.4f}",
        ]
        for i, stress in enumerate(RELEASE)
    ]
    rows[0][0] += ": same bits as rough" if same_bits(r, 0, result.rough) else ": NOT rough"
    rows[-1][0] += ": same bits as bonded" if same_bits(r, -1, result.bonded) else ": NOT bonded"
    header = ["release stress [kPa]", "smallest transmission force [N]", "smallest flyer force [N]"]
    return table([*header, "impulse [mN s]"], rows)


def pulled(result: Result) -> str:
    """Force at release over stress times area."""
    rows = [
        [f"{1e-3 * stress:g}", *(f"{value:.4f}" for value in result.pull[i])]
        for i, stress in enumerate(PULLED)
    ]
    return table(
        ["release stress [kPa]", "flyer: force / (stress × area) [-]", "transmission platen [-]"], rows
    )


def text(result: Result) -> str:
    """The page."""
    fit = order_of_friction(result)
    last = FRICTION[result.friction.outline > 0.0].max()
    slope = f"{fit.order:.2f} ± {fit.standard_error:.2f}"
    worst = np.abs(result.press - 1.0).max()
    bonded, released = twice()
    return f"""# {TITLE}

**What is checked.** No law lets a node through a platen, at any step, past the point where the side surface
has rolled on; the platens' impulses are the specimen's momentum, to round-off, and the ledger of energy
closes, through stick and slip and through letting go. The laws lead into each other: Coulomb's into the rough
one for f towards infinity, the releasing one into the rough and into the bonded one, and a penalty
formulation into the kinematic one. Static solutions with friction by another program are on the page
[Coulomb friction](friction.md).

**What is regularised.** In the kinematic laws nothing: a pressed node sticks with velocity 0 or slides with
f times the normal impulse, with no penalty and no threshold of velocity between the two. The penalty law
is regularised by springs of stiffness k per area: it penetrates by pressure over k, and before it slides it
moves by up to f times that. It serves as a second formulation.

**Independent source.** The balance of momentum; the closed forms of a uniform state; for the kinematic laws
the penalty formulation.

**Set-up.** 16 × 22 elements, neo-Hookean, E = 80 kPa, ν = 0.495, β = 2.5e-5 s, faces and side with one law,
2.6 m/s to 1.5 ms (60 %).

**Ledgers.** {N_STEPS} steps of {1e6 * STEP:g} µs, all nodes at every one. Two places within a step give its
velocity, so the momentum is compared with the impulses and not integrated.

{ledgers(result)}

(Penalty with the default stiffness, 1e13 Pa/m. Between two nodes the surface is straight and cannot be deeper
than they are.)

**Penalty to kinematic,** f = 0.3:

{penalty(result)}

(Order fitted from {STIFFNESS[FITTED][0]:.0e} Pa/m on.) In a static frictionless compression to 20 % every
node of a face penetrates by pressure over stiffness, within {worst:.0e}.

Slow loading as on the page [Coulomb friction](friction.md), 16 × 22 elements, largest difference of the
force; both formulations are as far from the third program as the mesh is:

{static()}

**Coulomb to rough.** Only nodes whose pressure is below their shear stress over f still slip. The outline
approaches the rough one with the order {slope} in 1/f up to f = {FRICTION[SLIPPING][-1]:g}; beyond,
single landings decide, and past f = {last:g} the bits are the same.

{friction(result)}

**Release.** A node lets go when its tensile contact stress, impulse over interval and over its undeformed
area, reaches the release stress, and is rough from then on. Impacts:

{release(result)}

Slow pull within {1e3 * SLOW:g} ms, 6 × 8 elements, ν = 0, α = {DRAG:g} 1/s: the stress is uniform but for
terms of the size of the strain (5 % in the last row), and no force can be larger than stress times area.

{pulled(result)}

Pulled by 5 %, pressed by 5 % and pulled again (ν = 0.495), bonded faces pull with {-bonded[0, 0]:.2f} N and
{-bonded[2, 0]:.2f} N. Faces that let go at 1 kPa pull with {-released[0, 0]:.3f} N, press with
{released[1, 1]:.2f} N (bonded {bonded[1, 1]:.2f} N) and pull no more.

**Tolerance.** Penetration {1e6 * GAP_TOLERANCE:.0e} µm, round-off of a height, and 1 µm for the penalty.
Momentum {MOMENTUM_TOLERANCE:.0e}: places known to 1e-18 m, 0.6 µm apart. Energy
{100 * ENERGY_TOLERANCE:g} %. Order of the penalty 1 within {ORDER_TOLERANCE:g}; of friction not below
{FRICTION_ORDER:g}, less its scatter: theory gives 1, but nodes stick and slip one by one. Penetration over
its closed form {PRESS_TOLERANCE:.0e}: what still moves. Force of the pull {100 * PULL_TOLERANCE:g} % below
the closed form: half of the strain. Slow loading, penalty against Coulomb: {100 * STATIC_TOLERANCE:g} %.
"""
