"""The solver's speed, and how far two devices or precisions are apart.

    python -m benchmarks.solver                              # CPU, fp64 and fp32
    python -m benchmarks.solver --device cuda                # a GPU
    python -m benchmarks.solver --save cpu.npz               # also keep the histories ...
    python -m benchmarks.solver --device cuda --compare cpu.npz   # ... and compare with them

The problem is a flyer test like `runs/open-01` (deviatoric damping, nu = 0.499, 55 % compression in
1.4 ms, steps that follow the deformation), varied over stiffness factor and friction, with Coulomb
contact on the faces and on the side surface.
"""

import argparse
import json
import os
import platform
import time
from pathlib import Path
from typing import Any

import numpy as np

import explicit
from explicit.device import select_device
from explicit.materials import marlow_from_curve

END = 1.4e-3
HEAD = "contact  precision   runs   seconds  M element-updates/s same bits"


def flyer() -> explicit.PlatenMotion:
    """A ramp to 2.6 m/s within 50 us, then 2.6 m/s."""

    def position(t: np.ndarray) -> np.ndarray:
        s = np.clip(t / 50e-6, 0.0, 1.0)
        return 2.6 * (50e-6 * (2.5 * s**4 - 3.0 * s**5 + s**6) + np.maximum(t - 50e-6, 0.0))

    def velocity(t: np.ndarray) -> np.ndarray:
        s = np.clip(t / 50e-6, 0.0, 1.0)
        return 2.6 * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)

    return explicit.PlatenMotion.sampled(position, velocity, start=0.0, end=END, n_knots=2049)


def model(mesh: tuple[int, int], contact: str) -> explicit.Model:
    """A Yeoh-like elastomer of 74 kPa between two platens."""
    stretch = np.linspace(0.36, 0.999, 65)
    shift = stretch**2 + 2.0 / stretch - 3.0
    stress = (stretch - stretch**-2) * 74e3 / 3.0 * (1.0 + 0.2 * shift + 0.06 * shift**2)
    return explicit.Model(
        mesh=explicit.cylinder(4.75e-3, 6.5e-3, n_radial=mesh[0], n_axial=mesh[1], grading=2.0),
        density=870.0,
        materials=(marlow_from_curve(stretch, stress),),
        motions=(flyer(),),
        faces=contact,
        side=contact,
    )


def samples(n: int) -> explicit.Samples:
    """A square factorial over m in [0.75, 1.25] and f in [0, 2], filled row by row."""
    side = int(np.ceil(np.sqrt(n)))
    m, f = np.meshgrid(np.linspace(0.75, 1.25, side), np.linspace(0.0, 2.0, side))
    if n == 1:
        m, f = np.array([[1.0]]), np.array([[0.5]])
    return explicit.Samples.of(stiffness_factor=m.ravel()[:n], friction=f.ravel()[:n], damping=2.5e-5)


SAMPLING = explicit.Sampling(
    force_times=np.linspace(0.0, END, 169), surface_times=np.linspace(END / 168, END, 168)
)


def measure(mesh: tuple[int, int], contact: str, n: int, precision: str, device: str, repeats: int) -> Any:
    """Best wall time of a batch, its response, and whether repeats gave the same bits."""
    problem, batch = model(mesh, contact), samples(n)
    stepping = explicit.Stepping(precision=precision)  # type: ignore[arg-type]
    best, response, same = np.inf, None, True
    for _ in range(repeats):
        started = time.perf_counter()
        again = explicit.run(problem, batch, SAMPLING, stepping=stepping, device=device)
        best = min(best, time.perf_counter() - started)
        if response is not None:
            same &= np.array_equal(response.force_transmission, again.force_transmission, equal_nan=True)
        response = again
    return best, response, same


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--runs", type=int, nargs="+", default=[1, 100])
    parser.add_argument("--mesh", default="16x22")
    parser.add_argument("--repeats", type=int, default=3, help="timed repeats after a first that compiles")
    parser.add_argument("--json", type=Path, help="write the table here")
    parser.add_argument("--save", type=Path, help="keep the histories of the smaller batches (npz)")
    parser.add_argument("--compare", type=Path, help="compare with histories kept by --save")
    options = parser.parse_args()
    across, along = (int(part) for part in options.mesh.split("x"))
    device = select_device(options.device)
    kept = dict(np.load(options.compare)) if options.compare else {}
    table, histories = [], {}
    print(f"{device.name}, {options.mesh} elements\n{HEAD}")
    for contact in ("bonded", "coulomb"):
        for precision in ("fp64", "fp32"):
            first = time.perf_counter()
            measure((across, along), contact, 1, precision, options.device, 1)
            compiled = time.perf_counter() - first
            for n in options.runs:
                seconds, response, same = measure(
                    (across, along), contact, n, precision, options.device, options.repeats
                )
                rate = float(response.steps.sum()) * across * along / seconds / 1e6
                row = {
                    "contact": contact,
                    "precision": precision,
                    "runs": n,
                    "seconds": round(seconds, 5),
                    "million_element_updates_per_s": round(rate, 2),
                    "same_bits": bool(same),
                    "completed": int(response.completed.sum()),
                    "first_call_seconds": round(compiled, 2),
                }
                if n <= 100:
                    key = f"{contact}-{precision}-{n}"
                    histories[f"{key}-force"] = response.force_transmission
                    histories[f"{key}-r"] = response.surface_r
                    for other in ("fp64", precision):
                        name = f"{contact}-{other}-{n}"
                        if f"{name}-force" in kept:
                            force = np.abs(response.force_transmission - kept[f"{name}-force"]).max()
                            radius = np.abs(response.surface_r - kept[f"{name}-r"]).max()
                            row[f"force_difference_to_{other}_N"] = float(force)
                            row[f"radius_difference_to_{other}_um"] = float(radius * 1e6)
                table.append(row)
                print(f"{contact:8} {precision:9} {n:6d} {seconds:9.4f} {rate:20.1f} {same!s:>9}", flush=True)
    if options.save:
        np.savez_compressed(options.save, **histories)  # type: ignore[arg-type]
    if options.json:
        machine = {"device": device.name, "processor": platform.machine(), "cores": os.cpu_count()}
        text = {"machine": machine, "mesh": options.mesh, "rows": table}
        options.json.write_text(json.dumps(text, indent=1) + "\n")


if __name__ == "__main__":
    main()
