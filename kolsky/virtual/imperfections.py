"""The table [imperfections]: what is wrong with a made shot, and by how much; all zero is a right shot.

Two kinds: what the shot file says of the apparatus differs from what it was (`declared less true`), and what
the test did differs from what the analysis takes for granted.
"""

from kolsky.shot.schema import fields as f
from kolsky.shot.schema.section import Section
from kolsky.virtual import fields as v


class Imperfections(Section):
    """[imperfections]."""

    length: v.Relative = 0.0
    """Declared length over the true one, less 1 [-]."""
    diameter: v.Relative = 0.0
    """Declared diameter over the true one, less 1 [-]."""
    density: v.Relative = 0.0
    """Declared density over the true one, less 1 [-]."""
    sensitivity: v.Relative = 0.0
    """Declared sensitivity of the transmitted force over the nominal one, less 1 [-]."""
    curve: v.Relative = 0.0
    """Stresses in the quasi-static table over the true ones, less 1 [-]."""
    poisson: f.Number = 0.0
    """Declared Poisson's ratio less the true one [-]."""
    damping: f.Time = 0.0
    """Declared beta less the true one [s]."""
    trigger: f.Time = 0.0
    """How late the cameras' times are on the shot's clock: frame times as given less the true ones [s]."""
    y_offset: f.Offset = 0.0
    """Heights of the outline as given less the true ones [m]."""
    Z_offset: f.Offset = 0.0
    """Radii of the outline as given less the true ones [m]."""
    gain: v.Relative = 0.0
    """Volts of the transmitted force over what its sensitivity gives, less 1 [-]."""
    baseline: f.SignedVoltage = 0.0
    """Volts by which the transmitted signal is raised from the flyer's start on [V]."""
    slip_friction: f.Friction = 0.0
    """Coulomb coefficient of faces that the shot file calls bonded; 0: they are [-]."""
    tilt: v.Angle = 0.0
    """Pitch of the flyer in the cameras' plane that grows with its path to this, camera side ahead [rad]."""
    off_centre: f.Offset = 0.0
    """How far the specimen stands from the flyer's axis, toward the cameras [m]."""
