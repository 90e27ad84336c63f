"""Mesh error in the truths of the open shots: `python -m populations.open_courses open-01 open-02`.

The exact force and outline of a shot from another program are compared with those of this solver at the
shot's true values. This solver runs on the mesh of an answer, and as the mean of both elements on a graded 96
x 129 mesh, the truth of the coverage studies. Least squares of the exact histories, weighted by the
instruments' noise, convert the difference to m, nu and beta. The result estimates the effect of the other
program's mesh on its truth.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

import explicit
from explicit.materials import marlow_from_curve
from kolsky.base.arrays import FloatArray

SHOTS = Path(__file__).resolve().parents[2] / "shared" / "data" / "shots"
STRETCH = np.linspace(1.0, 0.36, 257)
HEIGHTS = np.linspace(0.15, 0.85, 14)
"""Heights at which the outline is compared, over the current length of the specimen [-]. They avoid the parts
that roll onto a platen."""
STEPS = np.array([3e-3, 5e-6, 5e-7])
"""Steps of m, nu and beta for the derivatives."""
FORCE_SIGMA, OUTLINE_SIGMA, BIN = 0.146, 4e-6, 16
END = 1.25e-3
"""Last time that is compared, after the beginning of the motion [s]."""
FINE = (96, 129)


class Course:
    """The exact histories of an open shot, and those of this solver."""

    def __init__(self, name: str) -> None:
        folder = SHOTS / name
        truth, facts = (json.loads((folder / f"{n}.json").read_text()) for n in ("truth", "facts"))
        with np.load(folder / "truth_surface.npz") as stored:
            self.seen = {key: stored[key].astype(np.float64) for key in stored}
        begin = self.seen["t"][0]
        self.frames, self.times = self.seen["t"] - begin, self.seen["t_force"] - begin
        self.within = (self.times >= 0.0) & (self.times <= self.frames[-1])
        self.true = np.array([truth["m"], truth["nu"], truth["beta_s"]])
        self.size = [1e-3 * facts["specimen"][key] for key in ("diameter_mm", "length_mm")]
        self.density = facts["specimen"]["density_kg_m3"]
        shift = STRETCH**2 + 2.0 / STRETCH - 3.0
        first, second, third = truth["yeoh_ratio"]
        modulus = truth["E_qs_Pa"] / 3.0 * (first + 2.0 * second * shift + 3.0 * third * shift**2)
        self.law = marlow_from_curve(STRETCH, (STRETCH - STRETCH**-2) * modulus)
        path = CubicSpline(self.frames, self.seen["d"], bc_type=((1, 0.0), "not-a-knot"))
        knots = np.linspace(0.0, self.frames[-1], 4097)
        self.motion = explicit.PlatenMotion(
            start=0.0, step=float(knots[1]), position=path(knots), velocity=path(knots, 1)
        )

    @property
    def exact(self) -> FloatArray:
        """The other program's data over their noise, shape [k]."""
        force = self.seen["transmitted"][self.within]
        return self._data(force, self.seen["y"][1:], self.seen["r"][1:])

    def simulated(
        self, points: FloatArray, mesh: tuple[int, int], *, element: str = "one_point", grading: float = 2.0
    ) -> FloatArray:
        """This solver's data over their noise at points of m, nu and beta, shape [n, k]."""
        found = self.runs(points, mesh, element=element, grading=grading)
        each = zip(found.force_transmission, found.surface_y[:, 1:], found.surface_r[:, 1:], strict=True)
        return np.array([self._data(*one) for one in each])

    def runs(
        self, points: FloatArray, mesh: tuple[int, int], *, element: str, grading: float
    ) -> explicit.Response:
        """Forces at the truth's times within its frames, surfaces at its frames."""
        diameter, length = self.size
        model = explicit.Model(
            mesh=explicit.cylinder(
                0.5 * diameter, length, n_radial=mesh[0], n_axial=mesh[1], grading=grading
            ),
            density=self.density,
            materials=(self.law,),
            motions=(self.motion,),
            faces="bonded",
            side="bonded",
            element=element,
        )
        nothing = np.zeros(len(points), dtype=np.int64)
        m, nu, beta = points.T
        found = explicit.run(
            model,
            explicit.Samples.of(
                stiffness_factor=m, poisson=nu, damping=beta, motion=nothing, material=nothing
            ),
            explicit.Sampling(
                force_times=self.times[self.within], surface_times=self.frames, ledger_every=16
            ),
            device="cpu",
        )
        if not found.completed.all():
            raise ValueError(f"a run ended {found.describe(int(np.argmin(found.completed)))}")
        return found

    def _data(self, force: FloatArray, y: FloatArray, r: FloatArray) -> FloatArray:
        whole = int(END / self.frames[-1] * len(force)) // BIN * BIN
        bins = force[:whole].reshape(-1, BIN).mean(axis=1) / (FORCE_SIGMA / BIN**0.5)
        points = []
        for k in np.flatnonzero(self.frames[1:] <= END):
            order = np.argsort(y[k])
            order = order[np.r_[True, np.diff(y[k][order]) > 2e-6]]  # points on a platen have equal heights
            at = HEIGHTS * (self.size[1] - self.seen["d"][k + 1])
            points.append(CubicSpline(y[k][order], r[k][order])(at) / OUTLINE_SIGMA)
        return np.concatenate([bins, *points])


def compared(name: str) -> dict[str, list[float]]:
    """Fitted values of m, nu and beta minus the truth. Two models of this solver are fitted to the exact
    histories."""
    course = Course(name)
    beside = [course.true + sign * step for step in np.diag(STEPS) for sign in (1.0, -1.0)]
    runs = course.simulated(np.array([course.true, *beside]), (64, 86))
    slope = ((runs[1::2] - runs[2::2]) / (2.0 * STEPS[:, None])).T
    at = course.true[None]
    fine = [course.simulated(at, FINE, element=e, grading=5.0)[0] for e in ("one_point", "fbar")]
    models = {"64 x 86, as answers are": runs[0], "96 x 129 graded, middle": 0.5 * (fine[0] + fine[1])}
    return {
        what: np.linalg.lstsq(slope, course.exact - data, rcond=None)[0].tolist()
        for what, data in models.items()
    }


def main() -> None:
    """Compare the shots and print the result."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("shots", nargs="+", help="open-01 to open-04")
    given = parser.parse_args()
    print("| shot | model | m | nu | beta (us) |\n| --- | --- | --- | --- | --- |")
    for name in given.shots:
        for what, (m, nu, beta) in compared(name).items():
            print(f"| {name} | {what} | {m:+.4f} | {nu:+.1e} | {1e6 * beta:+.2f} |", flush=True)


if __name__ == "__main__":
    main()
