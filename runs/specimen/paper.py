"""Studies of Schumacher and others (2020) on synthetic data; each study is one table.

Usage: python runs/specimen/paper.py OUT [--full] [--device cpu] [--workers N] [STUDY ...]

Their measurements are not public. Every study therefore chooses constants, simulates the tests with noise of
10 mN and 10 um, and fits the constants. STUDY is any of fits, middle, strains, resolution, noise, starts,
pulls, bonds; default all. An existing table is not made again. seconds.csv contains the time of each new
table. Without --full the meshes are a quarter as fine, with linear hexahedra. With --full they are those of
the paper: 40 x 10 x 2 and a cross of 1400 quadratic hexahedra.
"""

import argparse
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from mid_region import marker_stretch, mid_region_fit

from kolsky.base.files import write_table
from kolsky.bodies.errors_in_variables import Samples
from kolsky.bodies.specimen_constants import Constants
from kolsky.bodies.specimen_fit import SlowTest, SpecimenFit, cross_table, fit
from kolsky.bodies.specimen_model import Shape, SpecimenModel
from kolsky.report.body_views import BINS, strain_share

TRUE = {"C10": 9e3, "C01": 4e3, "C11": 400.0, "poisson": 0.45}
START = {"C10": 6e3, "C01": 6e3, "C11": 1000.0, "poisson": 0.45}
FREE = ("C10", "C01", "C11")
NOISE = 10e-6, 10e-3
"""Noise of displacement [m] and force [N]."""


def constants(
    values: dict[str, float], law: str = "mooney_rivlin", free: tuple[str, ...] = FREE
) -> Constants:
    """A law with the start of its fit."""
    return Constants(law, values, free)


class Laboratory:
    """Specimens and their synthetic data."""

    def __init__(self, full: bool, device: str) -> None:
        element = "hex27" if full else "hex8"
        n = 40 if full else 20
        length = (0.1, 0.025, 0.005)
        bond = 0.01
        self.device, self.full = device, full
        self.strip = Shape("strip", length, bond, (n, n // 4 if full else 4, 2), element=element)
        arms = (n, n, 2) if full else (40, 40, 2)
        self.cross = Shape("cross", (0.1, 0.1, 0.005), bond, arms, arm=0.025, element=element)
        stiff = (32, 8, 2) if full else (16, 4, 2)
        self.short = Shape("strip", (0.08, 0.02, 0.002), bond, stiff, element=element)

    def test(
        self, name: str, shape: Shape, stroke: float, truth: Constants, seed: int, *, softer: float = 1.0
    ) -> SlowTest:
        """A test with data from the true constants."""
        model = SpecimenModel(name, shape, self.device)
        d = np.repeat((stroke * np.arange(1, 21) / 20)[:, None], shape.ends, axis=1)
        answer = model.linearised(truth, truth.start, d)
        rng = np.random.default_rng(seed)
        return SlowTest(
            model,
            Samples(
                d + NOISE[0] * rng.standard_normal(d.shape),
                softer * answer.force + NOISE[1] * rng.standard_normal(d.shape),
                *NOISE,
            ),
        )

    def pair(self) -> tuple[SlowTest, SlowTest]:
        """Strip and cross to 125 % and 75 % of the free length."""
        truth = constants(TRUE)
        return (
            self.test("uniaxial", self.strip, 0.1, truth, 1),
            self.test("biaxial", self.cross, 0.06, truth, 2),
        )


def study_fits(lab: Laboratory, path: Path) -> None:
    """Fits to one test and to both, with the error of each on each: their Fig. 4, upper row."""
    uniaxial, biaxial = lab.pair()
    groups = {"uniaxial": [uniaxial], "biaxial": [biaxial], "combined": [uniaxial, biaxial]}
    found = []
    clock, processor = [], []
    for name, tests in groups.items():
        others = [one for one in (uniaxial, biaxial) if one not in tests]
        started = time.perf_counter(), time.process_time()
        found.append(fit(name, tests, constants(START), predicted=others))
        clock.append(round(time.perf_counter() - started[0], 1))
        processor.append(round(time.process_time() - started[1], 1))
    table = cross_table(found, ["uniaxial", "biaxial"])
    columns = {"fit": list(groups)}
    columns |= {f"RMSE {name} (N)": table[:, k] for k, name in enumerate(("uniaxial", "biaxial"))}
    for j, name in enumerate(FREE):
        columns[f"{name} (Pa)"] = [one.intervals.estimates[j].value for one in found]
        columns[f"sigma {name} (Pa)"] = [one.intervals.estimates[j].sigma for one in found]
    columns["correlation C10 C01"] = [one.intervals.correlation[0, 1] for one in found]
    columns["correlation C01 C11"] = [one.intervals.correlation[1, 2] for one in found]
    columns["simulations"] = [one.found.simulations for one in found]
    columns |= {"seconds": clock, "processor seconds": processor}
    write_table(path, columns)


def study_middle(lab: Laboratory, path: Path) -> None:
    """Fits of the uniform middle, simulated as whole specimens: their Fig. 4, lower row."""
    tests = lab.pair()
    truth = constants(TRUE)
    solid = truth.solid(truth.start)
    seen = [(one, marker_stretch(one, one.model.simulate(solid, one.samples.displacement))) for one in tests]
    groups = {"uniaxial": seen[:1], "biaxial": seen[1:], "combined": seen}
    columns: dict[str, list[object]] = {"fit of the middle": list(groups)}
    for one in tests:
        columns[f"RMSE {one.name} (N)"] = []
    for name in FREE:
        columns[f"{name} (Pa)"] = []
    for group in groups.values():
        values = mid_region_fit(group, constants(START)).constants
        for name in FREE:
            columns[f"{name} (Pa)"].append(values.values[name])
        for one in tests:
            try:
                answer = one.model.linearised(values, values.start, one.samples.displacement)
                error = float(np.sqrt(np.mean((answer.force - one.samples.force) ** 2)))
            except ValueError:
                error = "failed"
            columns[f"RMSE {one.name} (N)"].append(error)
    write_table(path, columns)


def study_strains(lab: Laboratory, path: Path) -> None:
    """Shares of the volume over the strain along each edge at 100 % nominal strain: their Fig. 8."""
    truth = constants(TRUE)
    columns: dict[str, object] = {"strain from (1)": BINS[:-1], "strain to (1)": BINS[1:]}
    for name, shape in (("strip", lab.strip), ("cross", lab.cross)):
        free_length = shape.size[0] - 2.0 * shape.bond
        d = np.repeat((free_length * np.arange(1, 11) / 10)[:, None], shape.ends, axis=1)
        model = SpecimenModel(name, shape, lab.device)
        solution = model.simulate(truth.solid(truth.start), d)
        if not solution.outcome.ok:
            raise SystemExit(f"{name}: {solution.outcome.cause}")
        share = strain_share(name, solution, shape.mid_region())
        for part, values in (("whole", share.whole), ("middle", share.middle)):
            columns |= {f"{name}, {part}, along {a} (1)": v for a, v in zip("xyz", values, strict=True)}
    write_table(path, columns)  # type: ignore[arg-type]


def fit_columns(fits: dict[str, SpecimenFit]) -> dict[str, object]:
    """Constants, residual and effort of fits by their description."""
    names = list(dict.fromkeys(name for found in fits.values() for name in found.constants.values))
    parts = [[one for one in found.tests if one.fitted] for found in fits.values()]
    return {
        "case": list(fits),
        **{f"{n} (SI)": [found.constants.values.get(n, "") for found in fits.values()] for n in names},
        "RMSE (N)": [float(np.sqrt(np.mean([one.rmse**2 for one in own]))) for own in parts],
        "displacement components": [own[0].test.model.shape.mesh.points.size for own in parts],
        "simulations": [found.found.simulations for found in fits.values()],
    }


def study_resolution(lab: Laboratory, path: Path) -> None:
    """Constants over mesh and order, from 20 x 5 x 1 on. The data are those of the finest quadratic mesh:
    their Fig. 6."""
    fine = replace(lab.strip, elements=(40, 10, 2), element="hex27")
    test = lab.test("uniaxial", fine, 0.1, constants(TRUE), 1)
    fits = {}
    for element in ("hex8", "hex27"):
        start = constants(START)
        for factor in (1, 2, 3, 4) if lab.full else (1, 2):
            elements = (20 * factor, 5 * factor, factor)
            shape = replace(test.model.shape, elements=elements, element=element)
            own = replace(test, model=replace(test.model, shape=shape))
            label = f"{element} {elements[0]} x {elements[1]} x {elements[2]}"
            fits[label] = fit(label, [own], start, bonds=False)
            start = fits[label].constants  # of the coarser mesh: fewer steps
    write_table(path, fit_columns(fits))  # type: ignore[arg-type]


def study_noise(lab: Laboratory, path: Path) -> None:
    """Noise of up to 1.249 N added to the force: their Fig. 9."""
    test, rng, fits = lab.pair()[0], np.random.default_rng(1), {}
    for sigma in (0.0, 0.125, 0.312, 0.624, 1.249):
        for draw in range(3 if sigma > 0.0 else 1):
            added = sigma * rng.standard_normal(test.samples.force.shape)
            total = float(np.hypot(test.samples.sigma_force, sigma))
            samples = replace(test.samples, force=test.samples.force + added, sigma_force=total)
            own = [replace(test, samples=samples)]
            fits[f"sigma {sigma:g} N, draw {draw + 1}"] = fit("noise", own, constants(START), bonds=False)
    write_table(path, fit_columns(fits))  # type: ignore[arg-type]


def study_starts(lab: Laboratory, path: Path) -> None:
    """Fits of known constants from starts up to a decade away: their Section VI-F."""
    tests = list(lab.pair())
    found = fit("starts", tests, constants(START), starts=6, bonds=False)
    columns: dict[str, object] = {"start": list(range(1, len(found.starts) + 1))}
    for j, name in enumerate(FREE):
        columns[f"{name} (Pa)"] = [float(one[j]) for one in found.starts]
    write_table(path, columns)  # type: ignore[arg-type]


def study_pulls(lab: Laboratory, path: Path) -> None:
    """Pulls to 50, 50 and 66 % of a softening silicone, three laws: their Fig. 7.

    The later pulls are 15 and 25 % softer than the first, as a Mullins effect would make them.
    """
    stiff = {"C10": 90e3, "C01": 40e3, "C11": 20e3, "poisson": 0.45}
    truth = constants(stiff)
    pulls = {
        "first, 50 %": lab.test("first", lab.short, 0.03, truth, 1),
        "second, 50 %": lab.test("second", lab.short, 0.03, truth, 2, softer=0.85),
        "third, 66 %": lab.test("third", lab.short, 0.04, truth, 3, softer=0.75),
    }
    laws = [
        constants({"mu": 200e3, "poisson": 0.45}, "neo_hookean", ("mu",)),
        constants(stiff, "mooney_rivlin"),
        constants({"C10": 100e3, "C20": 5e3, "C30": 1e3, "poisson": 0.45}, "yeoh", ("C10", "C20", "C30")),
    ]
    fits = {
        f"{name}, {law.law}": fit(name, [test], law, bonds=False)
        for name, test in pulls.items()
        for law in laws
    }
    write_table(path, fit_columns(fits))  # type: ignore[arg-type]


def study_bonds(lab: Laboratory, path: Path) -> None:
    """How often a bond is reported as peeling: intact bonds, and bonds that open at half the stroke.

    A peeled length changes the force by interpolation between the simulations of two bonds. Each case has 200
    draws of noise.
    """
    from kolsky.bodies.specimen_fit import debonding

    truth = constants(TRUE)
    shape = replace(lab.strip, elements=(20, *lab.strip.elements[1:]))
    model = SpecimenModel("strip", shape, lab.device)
    d = (0.1 * np.arange(1, 21) / 20)[:, None]
    whole = model.linearised(truth, truth.start, d)
    shorter = replace(model, shape=shape.shortened()).linearised(truth, truth.start, d)
    J, short = whole.by_constants[:, 0] / NOISE[1], (shorter.force - whole.force)[:, 0] / NOISE[1]
    amount = shape.size[0] / shape.elements[0]
    rng = np.random.default_rng(11)
    columns: dict[str, list[float]] = {"peeled (mm)": [], "called peeling, of 200": []}
    for peeled in (0.0, 0.1e-3, 0.2e-3, 0.4e-3, 0.8e-3):
        opened = np.where(np.arange(20) >= 10, short, 0.0) * peeled / amount
        found = [
            debonding(opened + rng.standard_normal(20), J, short, amount=amount, scale=1.0)
            for _ in range(200)
        ]
        columns["peeled (mm)"].append(1e3 * peeled)
        columns["called peeling, of 200"].append(sum(one is not None and one.suspected for one in found))
    write_table(path, columns)


STUDIES = {
    "fits": study_fits,
    "middle": study_middle,
    "strains": study_strains,
    "resolution": study_resolution,
    "noise": study_noise,
    "starts": study_starts,
    "pulls": study_pulls,
    "bonds": study_bonds,
}


def make(name: str, out: Path, *, full: bool, device: str) -> tuple[str, float]:
    """Make one missing table. Returns its name and the time [s]."""
    started = time.perf_counter()
    path = out / f"{name}.csv"
    if not path.exists():
        STUDIES[name](Laboratory(full, device), path)
    return name, time.perf_counter() - started


def main() -> None:
    """Make the requested tables that are missing."""
    plain = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=plain)
    parser.add_argument("out", type=Path)
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("study", nargs="*")
    given = parser.parse_intermixed_args()
    given.out.mkdir(parents=True, exist_ok=True)
    wanted = [name for name in given.study or STUDIES if not (given.out / f"{name}.csv").exists()]
    one = partial(make, out=given.out, full=given.full, device=given.device)
    with ProcessPoolExecutor(given.workers, mp_context=get_context("spawn")) as pool:
        for name, seconds in pool.map(one, wanted):
            with (given.out / "seconds.csv").open("a", encoding="utf-8") as file:
                file.write(f"{name},{seconds:.1f}\n")
    for name in given.study or STUDIES:
        print(name, (given.out / f"{name}.csv").read_text(encoding="utf-8"), sep="\n")


if __name__ == "__main__":
    main()
