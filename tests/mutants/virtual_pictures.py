"""Faults of made pictures: rays, lens, exposure, sensor, paint, cameras, files."""

from tests.mutants.fault import Fault

RENDER = ("tests/unit/dic/test_dic_render.py",)
PARTS = ("tests/unit/dic/test_dic_synthetic.py",)
PICTURES = ("tests/unit/virtual/test_pictures.py",)

FAULTS = (
    Fault(
        name="made pictures: a cone that widens the wrong way",
        file="dic/synthetic/kernels/rays.py",
        right="rho0 = r0 + g * (p[1] - y0)",
        wrong="rho0 = r0 - g * (p[1] - y0)",
        tests=RENDER,
    ),
    Fault(
        name="made pictures: the farther body hides the nearer",
        file="dic/synthetic/kernels/rays.py",
        right="if k >= 0 and s + s0 < nearest:",
        wrong="if k >= 0:",
        tests=RENDER,
    ),
    Fault(
        name="made pictures: circle of confusion with the variance of a ring",
        file="dic/synthetic/kernels/rays.py",
        right="disc * disc / wp.float32(16.0)",
        wrong="disc * disc / wp.float32(8.0)",
        tests=RENDER,
    ),
    Fault(
        name="made pictures: loose paint read where it goes to",
        file="dic/synthetic/kernels/rays.py",
        right="along = along - inside * inside * slip[1]",
        wrong="along = along + inside * inside * slip[1]",
        tests=RENDER,
    ),
    Fault(
        name="made pictures: rays at the corners of their cells",
        file="dic/synthetic/kernels/rays.py",
        right="x = (wp.float64(column) + half) / fine - half",
        wrong="x = wp.float64(column) / fine - half",
        tests=RENDER,
    ),
    Fault(
        name="made pictures: the lens wider by the root of two",
        file="dic/synthetic/scene.py",
        right="scale = np.sqrt(0.5) / spread",
        wrong="scale = 0.5 / spread",
        tests=RENDER,
    ),
    Fault(
        name="made pictures: haze that forgets at once",
        file="dic/synthetic/scene.py",
        right="np.sqrt(1.0 - keep**2) * fresh",
        wrong="(1.0 - keep**2) * fresh",
        tests=RENDER,
    ),
    Fault(
        name="made pictures: a shutter open twice as long",
        file="dic/synthetic/scene.py",
        right="at.append(time + 0.5 * exposure * node)",
        wrong="at.append(time + exposure * node)",
        tests=RENDER,
    ),
    Fault(
        name="made pictures: photons without their noise",
        file="dic/synthetic/render.py",
        right="rng.poisson(mean)",
        wrong="mean",
        tests=PARTS,
    ),
    Fault(
        name="made pictures: read noise in grey values",
        file="dic/synthetic/render.py",
        right="self.black * self.largest + caught * self.per_electron",
        wrong="self.black * self.largest + caught",
        tests=PARTS,
    ),
    Fault(
        name="made pictures: grey values rounded down",
        file="dic/synthetic/render.py",
        right="np.rint(grey)",
        wrong="np.floor(grey)",
        tests=PARTS,
    ),
    Fault(
        name="made pictures: the lamp's gradient turned round",
        file="dic/synthetic/render.py",
        right="across = 1.0 + self.gradient *",
        wrong="across = 1.0 - self.gradient *",
        tests=PARTS,
    ),
    Fault(
        name="made pictures: drops that never overlap",
        file="dic/synthetic/paint.py",
        right="-np.log1p(-coverage)",
        wrong="coverage",
        tests=PARTS,
    ),
    Fault(
        name="made pictures: the area of drops of one size",
        file="dic/synthetic/paint.py",
        right="0.25 * np.pi * size**2 * (1.0 + spread**2)",
        wrong="0.25 * np.pi * size**2",
        tests=PARTS,
    ),
    Fault(
        name="made pictures: a square lattice's step for printed dots",
        file="dic/synthetic/paint.py",
        right="np.sqrt(np.pi / (2.0 * np.sqrt(3.0) * coverage))",
        wrong="np.sqrt(np.pi / (4.0 * coverage))",
        tests=PARTS,
    ),
    Fault(
        name="made pictures: a cine upside down",
        file="dic/synthetic/render.py",
        right='picture[::-1].astype("<u2")',
        wrong='picture.astype("<u2")',
        tests=PARTS,
    ),
    Fault(
        name="made pictures: more of the flyer in view than asked",
        file="kolsky/virtual/calibration_pictures.py",
        right="(c.flyer_share - 0.5) * c.field",
        wrong="(2.0 * c.flyer_share - 0.5) * c.field",
        tests=PICTURES,
    ),
    Fault(
        name="made pictures: twice the angle between the cameras",
        file="kolsky/virtual/calibration_pictures.py",
        right="half = (-0.5 if k == 0 else 0.5) * c.angle",
        wrong="half = (-1.0 if k == 0 else 1.0) * c.angle",
        tests=PICTURES,
    ),
    Fault(
        name="made pictures: a flyer that tilts the other way",
        file="kolsky/virtual/pictures.py",
        right="[one, zero, zero, zero, c, s, zero, -s, c]",
        wrong="[one, zero, zero, zero, c, -s, zero, s, c]",
        tests=PICTURES,
    ),
    Fault(
        name="made pictures: one instant however long the exposure",
        file="kolsky/virtual/pictures.py",
        right="np.maximum(1, np.ceil(blur))",
        wrong="0",
        tests=PICTURES,
    ),
)
