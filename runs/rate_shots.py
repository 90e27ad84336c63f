"""Shots of one material at other flyer velocities: `python runs/rate_shots.py FOLDER [MESH] [SPEED[:M] ...]`.

Each shot is a simulation with a known stiffness factor and noise like that of open-01 (1 um, 4 um, 0.3 N, 12
bits). It is written as the files of open-01. The shots show the result of a comparison of rates. They do not
validate the model, because the same solver makes them. They are the mean of both elements on a mesh graded
toward the faces' edges. MESH (e.g. 48x64) sets the mesh; by default it is 1.5 times as fine as that of the
answers.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import explicit
import kolsky

ORIGIN = Path(__file__).resolve().parent / "open-01"
NUMERICS = kolsky.Numerics(mesh=(96, 129), grading=5.0)
ELEMENTS = ("fbar", "one_point")  # their outlines converge to one limit from above and from below
STATIC, FRAMES, SAMPLES, POINTS, STRAIN = 12, 150, 3000, 14, 0.55
SIGMA_FLYER, SIGMA_Z, SIGMA_FORCE = 1e-6, 4e-6, 0.3
REST, RISE, DRAG = 29.2e-6, 60e-6, 0.15


def flyer(time: np.ndarray, speed: float, length: float) -> np.ndarray:
    """Displacement [m]: a smooth ramp to the speed, then a decrease of the speed in proportion to the
    path."""
    u = np.clip((time - REST) / RISE, 0.0, None)
    ramp = np.where(u < 1.0, RISE * u**4 * (2.5 - 3.0 * u + u**2), RISE * (u - 0.5))
    way = length * STRAIN / DRAG
    return way * -np.expm1(-speed * ramp / way)


def make(
    folder: Path, speed: float, m: float, *, seed: int, numerics: kolsky.Numerics = NUMERICS, **held: float
) -> None:
    """Write one shot with the flyer's speed [m/s] and the stiffness factor m, as the mean of both elements.

    ``held``: parameters with other values than in open-01, such as ``poisson=0.49998``.
    """
    rng, origin = np.random.default_rng(seed), kolsky.load_shot(ORIGIN)
    length = origin.specimen.length
    interval = STRAIN * length * (1.0 + 0.5 * DRAG) / speed / FRAMES
    frames = REST + interval * np.arange(1 - STATIC, FRAMES)
    smooth = kolsky.FlyerMotion(frames, flyer(frames, speed, length), np.full(frames.size, SIGMA_FLYER))
    path = kolsky.fit_flyer(smooth, start=REST)
    seen = frames[STATIC - 1 :]
    step = max(5e-7, (frames[-1] - frames[0]) / SAMPLES)
    scope = np.arange(-200e-6, frames[-1] + step, step)
    inside = (scope >= REST) & (scope <= path.end)
    sampling = explicit.Sampling(force_times=scope[inside], surface_times=seen)
    forward = kolsky.Forward(origin, sampling, (path,), (kolsky.material_law(origin.curve),))
    runs = [
        forward.run({"stiffness_factor": np.array([m]), **held}, replace(numerics, element=element))
        for element in ELEMENTS
    ]
    for run in runs:
        if not run.outcomes[0].ok:
            raise SystemExit(run.endings[0].sentence)
    names = ("force_transmission", "surface_r", "surface_y")
    transmitted, surface_r, surface_y = (np.mean([getattr(run, n)[0] for run in runs], axis=0) for n in names)

    force = np.interp(scope, scope[inside], transmitted, left=0.0)
    volts = 0.0112 * (force + SIGMA_FORCE * rng.standard_normal(force.size)) + 0.0034
    position = np.concatenate([np.zeros(STATIC - 1), path.position(seen)])
    height = length - position
    row = np.repeat(np.arange(frames.size), POINTS)
    y = (np.linspace(0.1, 0.9, POINTS) * height[:, None]).ravel()
    surface = np.maximum(np.arange(frames.size) - STATIC + 1, 0)
    Z, reached = kolsky.radius_at(surface_r, surface_y, surface[row], y)
    row, y, Z = row[reached], y[reached], Z[reached] + SIGMA_Z * rng.standard_normal(int(reached.sum()))

    number, time = np.arange(frames.size), [f"{t:.9e}" for t in frames]
    kolsky.write_table(folder / "frames.csv", {"frame": number, "time (s)": time})
    moved = position + SIGMA_FLYER * rng.standard_normal(frames.size)
    column = {"flyer displacement toward the specimen (mm)": [f"{1e3 * d:.5f}" for d in moved]}
    kolsky.write_table(folder / "flyer.csv", {"frame": number, "time (s)": time, **column})
    outline = {"y (mm)": [f"{1e3 * v:.5f}" for v in y], "Z (mm)": [f"{1e3 * v:.5f}" for v in Z]}
    times = [time[k] for k in row]
    sigma = {"sigma_Z (mm)": [f"{1e3 * SIGMA_Z:.4f}"] * row.size}
    kolsky.write_table(folder / "centreline.csv", {"frame": row, "time (s)": times, **outline, **sigma})
    digits = [f"{np.round(v * 2048.0) / 2048.0:.6f}" for v in volts]
    kolsky.write_table(
        folder / "scope.csv", {"Time (s)": [f"{t:.9e}" for t in scope], "CH2 transmitted (V)": digits}
    )
    (folder / "quasi_static.csv").write_bytes((ORIGIN / "quasi_static.csv").read_bytes())
    (folder / "shot.toml").write_text(shot_file(folder.name), encoding="utf-8")
    (folder / "truth.json").write_text(json.dumps({"m": m, "flyer_speed_m_s": speed}) + "\n")


def shot_file(name: str) -> str:
    """The shot file of open-01 with a name, without its second transducer."""
    text = (ORIGIN / "shot.toml").read_text(encoding="utf-8")
    head, _, rest = text.partition("[incident_force]")
    text = head + rest[rest.index("[frames]") :]
    lines = text.splitlines()
    lines[lines.index("format = 1")] = f'format = 1\nname = "{name}"\nmaterial = "made-up gel"'
    curve = next(k for k, line in enumerate(lines) if line.startswith("[curve]"))
    lines.insert(curve + 1, 'strain_rate = "0.01 1/s"  # the law knows no rate: any one will do')
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("give a folder for the shots")
    words, numerics = sys.argv[2:], NUMERICS
    if words and "x" in words[0]:
        across, along = map(int, words.pop(0).split("x"))
        numerics = replace(NUMERICS, mesh=(across, along))
    for number, word in enumerate(words or ["0.7", "0.8", "1.4", "2.6", "4.5"], start=1):
        speed, _, m = word.partition(":")
        folder = Path(sys.argv[1]) / f"rate-{number:02d}"
        make(folder, float(speed), float(m or 1.12), seed=number, numerics=numerics)
        print(f"{folder}: flyer {float(speed):g} m/s, m = {float(m or 1.12):g}")
