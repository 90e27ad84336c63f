"""Constants of bonded cylinders simulated by FElupe: `python -m populations.bonded_cylinders --out FOLDER`.

Law, constants, Poisson's ratio, slenderness and largest strain differ from specimen to specimen. FElupe, a
separate program (https://felupe.readthedocs.io), computes the force on two meshes of biquadratic elements
with a continuous pressure (Taylor and Hood). Mesh, element, law, contact and Newton iteration are its own.
The nodes of the side touch the platen one by one and do not slip on it. Noise is added to each reading.
`kolsky material fit` fits the constants; size, ends and law are declared. For each constant that is reported
as determined, the study counts how often the k = 2 interval contains the true value. The folder stores every
answer, so an interrupted study can be continued. `--refit` repeats the fits with the stored forces.
"""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from typer.testing import CliRunner

from explicit.arrays import FloatArray
from explicit.materials import bulk_modulus
from kolsky.cli.commandline import app
from populations.driver import RESULTS, command, results, write

FILE = RESULTS / "bonded_cylinders.json"
SPECIMENS = 20
READINGS = 20
NOISE = 2e-3
"""Standard deviation of a reading over its value [-]."""
DIAMETER = 40e-3
"""Diameter of every specimen [m]; a force is proportional to its square."""
SLENDERNESS = (0.2, 1.2)
"""Length over diameter [-]."""
STRAIN = (0.05, 0.30)
"""Largest nominal strain [-]."""
POISSON = (0.4981, 0.4999)
"""Range of Poisson's ratio that the assumed 0.499 ± 0.001 of the command covers [-]."""
LAWS = ("neo_hookean", "reduced_polynomial", "mooney_rivlin_2", "gent")
COARSER = 2.0 / 3.0
"""Number of elements along a side of FElupe's first mesh over that of the second [-]."""


Slope = Callable[[FloatArray], FloatArray]
"""A function of the first invariant."""
PENALTY = 100.0
"""Contact stiffness of a node over the mean stiffness of its elements [-]. With FElupe's default 1 the side
penetrates the platen."""
STEP = 0.01
"""Largest step of compression [-]."""


@dataclass(frozen=True)
class Invariants:
    """W = U(I1) + C01 (I2 - 3) + K/2 (J - 1)^2, with I1 and I2 of the isochoric deformation.

    The interface is that of FElupe's materials: arrays of shape [3, 3, ..., points, elements].
    """

    first: Slope
    """U' [Pa]."""
    second: Slope
    """U'' [Pa]."""
    C01: float
    """Constant of the second invariant, C01 [Pa]."""
    bulk: float
    """Bulk modulus K [Pa]."""
    x = (np.eye(3), np.zeros(0))
    """Shapes of the deformation gradient and of the (absent) state variables."""

    def gradient(self, x: list[FloatArray]) -> list[FloatArray | None]:
        """First Piola-Kirchhoff stress [Pa]."""
        F = x[0]
        J, T = _volume(F)
        I1 = np.einsum("ij...,ij...->...", F, F)
        cut = J ** (-2.0 / 3.0)
        P = self.first(cut * I1) * cut * (2.0 * F - 2.0 / 3.0 * I1 * T) + self.bulk * (J - 1.0) * J * T
        C = np.einsum("ki...,kj...->ij...", F, F)
        I2 = 0.5 * (I1**2 - np.einsum("ij...,ij...->...", C, C))
        G = 2.0 * (I1 * F - np.einsum("ik...,kj...->ij...", F, C))
        return [P + self.C01 * cut**2 * (G - 4.0 / 3.0 * I2 * T), None]

    def hessian(self, x: list[FloatArray]) -> list[FloatArray]:
        """dP/dF [Pa], shape [3, 3, 3, 3, ...]."""
        F = x[0]
        J, T = _volume(F)
        e = np.eye(3)
        I1 = np.einsum("ij...,ij...->...", F, F)
        cut = J ** (-2.0 / 3.0)
        one = np.einsum("ik,jl->ijkl", e, e)[(..., *(None,) * (F.ndim - 2))]
        TT, TX = _dyad(T, T), np.einsum("il...,kj...->ijkl...", T, T)
        d1 = cut * (2.0 * F - 2.0 / 3.0 * I1 * T)
        A = self.second(cut * I1) * _dyad(d1, d1) + self.first(cut * I1) * cut * (
            2.0 * one - 4.0 / 3.0 * (_dyad(F, T) + _dyad(T, F)) + I1 * (2.0 / 3.0 * TX + 4.0 / 9.0 * TT)
        )
        A += self.bulk * J * ((2.0 * J - 1.0) * TT - (J - 1.0) * TX)
        C, B = np.einsum("ki...,kj...->ij...", F, F), np.einsum("ik...,jk...->ij...", F, F)
        I2 = 0.5 * (I1**2 - np.einsum("ij...,ij...->...", C, C))
        G = 2.0 * (I1 * F - np.einsum("ik...,kj...->ij...", F, C))
        dG = 2.0 * (
            2.0 * _dyad(F, F)
            + I1 * one
            - np.einsum("ik...,jl->ijkl...", B, e)
            - np.einsum("il...,kj...->ijkl...", F, F)
            - np.einsum("ik,lj...->ijkl...", e, C)
        )
        more = dG - 4.0 / 3.0 * (_dyad(G, T) + _dyad(T, G)) + I2 * (4.0 / 3.0 * TX + 16.0 / 9.0 * TT)
        return [A + self.C01 * cut**2 * more]


def _dyad(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("ij...,kl...->ijkl...", a, b))


def _volume(F: FloatArray) -> tuple[FloatArray, FloatArray]:
    """J and the inverse's transpose."""
    import felupe as fem

    J = fem.math.det(F)
    return J, fem.math.transpose(fem.math.inv(F, J))


def compression_force(
    law: Invariants, radius: float, length: float, strain: FloatArray, mesh: tuple[int, int]
) -> FloatArray:
    """Force [N] at nominal compressive strains, shape [n]. The mesh gives the elements across the radius and
    the half length."""
    import felupe as fem

    from populations.felupe_impact import bilinear_mesh, graded

    # An element at the edge is a fifth as long as one in the middle.
    linear = bilinear_mesh(graded(0.5 * length, mesh[1], 5.0), graded(radius, mesh[0], 5.0))
    fine = fem.mesh.convert(linear, order=2, calc_points=True, calc_midfaces=True)
    fine.update(points=np.vstack([fine.points, [[0.5 * length, 1.5 * radius]]]))
    fine.points_without_cells = fine.points_without_cells[:-1]  # this point of the platen may move
    field = fem.FieldsMixed(
        fem.RegionBiQuadraticQuad(fine), n=3, axisymmetric=True, mesh=linear, disconnect=False
    )
    body = fem.SolidBody(fem.ThreeFieldVariation(law), field)
    x, top, platen = fine.points, 0.5 * length, len(fine.points) - 1
    near = 1e-9 * length
    side = np.flatnonzero((np.abs(x[:, 1] - radius) < near) & (x[:, 0] < top - near))
    contact = fem.ContactRigidPlane(
        field,
        side,
        platen,
        [-1.0, 0.0],
        friction=np.inf,
        multiplier=PENALTY,
        multiplier_tangential=0.1 * PENALTY,
        items=[body],
    )
    bounds = {
        "axis": fem.Boundary(field[0], fy=0.0, skip=(1, 0)),
        "middle": fem.Boundary(field[0], fx=0.0, skip=(0, 1)),
        "glue": fem.Boundary(field[0], fx=top, skip=(1, 0)),
        "move": fem.Boundary(field[0], fx=top, skip=(0, 1)),
    }
    middle = np.flatnonzero(np.abs(x[:-1, 0]) < near)
    force, now = [], 0.0
    for end in strain:
        for to in np.linspace(now, end, int(np.ceil((end - now) / STEP - 1e-9)) + 1)[1:]:
            bounds["move"].update(-to * top)
            fixed, free = fem.dof.partition(field, bounds)
            given = fem.dof.apply(field, bounds, fixed)
            fem.newtonraphson(
                items=[body, contact], dof0=fixed, dof1=free, ext0=given, tol=1e-6, verbose=False, maxiter=30
            )
        now = end
        inner = body.assemble.vector(field).toarray().ravel()[: 2 * len(x)].reshape(-1, 2)
        force.append(float(inner[middle, 0].sum()))
    return np.array(force)


@dataclass(frozen=True)
class Cylinder:
    """One specimen."""

    law: str
    constants: dict[str, float]
    """Constants by name, in SI units."""
    poisson: float
    slenderness: float
    """Length over diameter [-]."""
    strain: float
    """Largest nominal strain [-]."""

    @property
    def length(self) -> float:
        """Undeformed length [m]."""
        return self.slenderness * DIAMETER

    @property
    def felupe(self) -> Invariants:
        """The law as FElupe's material."""
        c = self.constants
        if self.law == "gent":
            mu, Jm = c["mu"], c["Jm"]
            bulk = float(bulk_modulus(mu, self.poisson))
            return Invariants(
                lambda I1: 0.5 * mu / (1.0 - (I1 - 3.0) / Jm),
                lambda I1: 0.5 * mu / Jm / (1.0 - (I1 - 3.0) / Jm) ** 2,
                0.0,
                bulk,
            )
        C10 = 0.5 * c["mu"] if "mu" in c else c["C10"]
        C20, C01 = c.get("C20", 0.0), c.get("C01", 0.0)
        return Invariants(
            lambda I1: C10 + 2.0 * C20 * (I1 - 3.0),
            lambda I1: 2.0 * C20 + 0.0 * I1,
            C01,
            float(bulk_modulus(2.0 * (C10 + C01), self.poisson)),
        )


def drawn(seed: int) -> list[Cylinder]:
    """The specimens of a seed. Slenderness and strain are stratified over their ranges, in independent random
    order."""
    rng = np.random.default_rng(seed)
    places = [rng.permutation(SPECIMENS) + rng.uniform(0.0, 1.0, SPECIMENS) for _ in range(2)]
    made = []
    for k, (tall, far) in enumerate(np.transpose(places) / SPECIMENS):
        law = LAWS[k % len(LAWS)]
        mu, share = float(10.0 ** rng.uniform(3.5, 5.5)), float(rng.uniform(0.1, 0.5))
        constants = {
            "neo_hookean": {"mu": mu},
            "reduced_polynomial": {"C10": 0.5 * mu, "C20": 0.5 * mu * share},
            "mooney_rivlin_2": {"C10": 0.5 * mu * (1.0 - share), "C01": 0.5 * mu * share},
            "gent": {"mu": mu, "Jm": 4.0 / share},
        }[law]
        made.append(
            Cylinder(
                law,
                constants,
                float(rng.uniform(*POISSON)),
                float(SLENDERNESS[0] + np.ptp(SLENDERNESS) * tall),
                float(STRAIN[0] + np.ptp(STRAIN) * far),
            )
        )
    return made


def force_of(one: Cylinder, elements: int = 14) -> tuple[FloatArray, FloatArray, float]:
    """Strains [-] and forces [N] by FElupe, and its largest relative change to the finer of two meshes [-].

    The corner between face and side is singular, so the error is proportional to the element size. Richardson
    extrapolation of order 1 from the two meshes removes it (Richardson 1911). The nodes of the side land one
    by one, so the change between the meshes is irregular. It is replaced by a parabola over the strain.
    """
    strain = np.linspace(0.0, one.strain, READINGS + 1)[1:]
    along = int(np.clip(round(elements * one.slenderness), 0.5 * elements, elements))
    fine, coarse = (
        compression_force(
            one.felupe, 0.5 * DIAMETER, one.length, strain, (round(s * elements), round(s * along))
        )
        for s in (1.0, COARSER)
    )
    change = fine / coarse - 1.0
    even = np.polynomial.Polynomial.fit(strain, change, 2)(strain)
    return strain, fine * (1.0 + even / (1.0 / COARSER - 1.0)), float(np.abs(change).max())


def answer(one: Cylinder, strain: FloatArray, force: FloatArray, folder: Path) -> dict[str, Any]:
    """Result of the command for a specimen's readings."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = "".join(f"{1e3 * one.length * e:.9g},{f:.9g}\n" for e, f in zip(strain, force, strict=True))
    (folder / "push.csv").write_text("Travel (mm),Load (N)\n0,0\n" + rows, encoding="utf-8")
    words = ["material", "fit", str(folder / "push.csv"), "--displacement", "Travel", "--force", "Load"]
    words += ["--convention", "compression-positive", "--ends", "bonded", "--laws", one.law, "--json"]
    words += ["--specimen", f"{1e3 * DIAMETER:.9g} mm x {1e3 * one.length:.9g} mm", "--out", str(folder)]
    run = CliRunner().invoke(app, words)
    if run.exit_code != 0:
        return {"refused": run.output.strip()}
    return dict(json.loads(run.stdout)["laws"][0])


def judged(one: Cylinder, found: dict[str, Any]) -> dict[str, Any]:
    """The determined constants, and whether their intervals contain the true values."""
    if "reason" in found or "refused" in found:
        return {"right": False, "outside": [], "determined": []}
    determined = [name for name in found["constants"] if name not in found["not_determined"]]
    outside = [
        name
        for name in determined
        if abs(found["constants"][name] - one.constants[name]) > 2.0 * found["sigma"][name]
    ]
    return {"right": not outside, "outside": outside, "determined": determined}


def experiment(seed: int, number: int, folder: Path, refit: bool = False) -> dict[str, Any]:
    """Simulate, fit and evaluate one specimen of a seed."""
    one, path = drawn(seed)[number], folder / f"{number:02d}.json"
    if path.exists():
        kept = json.loads(path.read_text("utf-8"))
        if "found" in kept and not refit:
            return dict(kept)
        strain, force, mesh = np.array(kept["strain"]), np.array(kept["force"]), kept["mesh"]
    else:
        strain, force, mesh = force_of(one)
        write(path, {"strain": strain.tolist(), "force": force.tolist(), "mesh": mesh})
    noise = np.random.default_rng([seed, number]).normal(0.0, NOISE, READINGS)
    found = answer(one, strain, force * (1.0 + noise), folder / f"{number:02d}")
    kept = {
        "cylinder": asdict(one),
        "strain": strain.tolist(),
        "force": force.tolist(),
        "mesh": mesh,
        "found": found,
        "judged": judged(one, found),
    }
    write(path, kept)
    return kept


def line(row: dict[str, Any]) -> str:
    """One line of text for a specimen."""
    one, found, verdict = row["cylinder"], row["found"], row["judged"]
    cells = [
        f"{name} {100.0 * (value / one['constants'][name] - 1.0):+.2f} ± "
        f"{200.0 * found['sigma'][name] / one['constants'][name]:.2g} %"
        if name in verdict["determined"]
        else f"{name} not determined"
        for name, value in found.get("constants", {}).items()
    ]
    words = "; ".join(cells) or found.get("reason", found.get("refused", ""))
    return (
        f"| {one['law']} | {one['slenderness']:.2f} | {100.0 * one['strain']:.0f} | {one['poisson']:.4f}"
        f" | {100.0 * row['mesh']:.2f} | {words} | {'yes' if verdict['right'] else 'no'} |"
    )


def recorded() -> list[dict[str, Any]]:
    """Rows of the published study, by law."""
    return list(json.loads(FILE.read_text("utf-8"))["rows"])


def main() -> None:
    """Run the study and print it."""
    parser = command(__doc__, seed=61803)
    parser.add_argument("--refit", action="store_true", help="answer again with the forces that are kept")
    given = parser.parse_args()
    jobs = [(given.seed, number, given.out, given.refit) for number in range(SPECIMENS)]
    rows = []
    for row in results(experiment, jobs, given.workers):
        print(line(row), flush=True)
        rows.append(row)
    rows.sort(key=lambda row: LAWS.index(row["cylinder"]["law"]))
    print(f"{sum(row['judged']['right'] for row in rows)} of {len(rows)} right")
    write(FILE, {"seed": given.seed, "rows": rows}, indent=1)


if __name__ == "__main__":
    main()
