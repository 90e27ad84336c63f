"""Named one-line faults, each with the quick tests that must fail when it is planted.

``python -m tests.mutants`` plants every fault in a copy of the sources, one at a time, and runs its tests
there; a fault that all of them let pass is a hole in the tests. The faults stand in one file a subject
beside this one.
"""

from tests.mutants.actuator import FAULTS as ACTUATOR
from tests.mutants.bar_files import FAULTS as BAR_FILES
from tests.mutants.bars_flyer import FAULTS as BARS_FLYER
from tests.mutants.bars_quoted import FAULTS as BARS_QUOTED
from tests.mutants.bars_reduction import FAULTS as BARS_REDUCTION
from tests.mutants.bars_signals import FAULTS as BARS_SIGNALS
from tests.mutants.budget import FAULTS as BUDGET
from tests.mutants.cause_fit import FAULTS as CAUSE_FIT
from tests.mutants.causes import FAULTS as CAUSES
from tests.mutants.cli import FAULTS as CLI
from tests.mutants.common_errors import FAULTS as COMMON_ERRORS
from tests.mutants.coverage import FAULTS as COVERAGE
from tests.mutants.diagnosis import FAULTS as DIAGNOSIS
from tests.mutants.dic_bodies import FAULTS as DIC_BODIES
from tests.mutants.dic_calibration import FAULTS as DIC_CALIBRATION
from tests.mutants.dic_chain import FAULTS as DIC_CHAIN
from tests.mutants.dic_rigid_body import FAULTS as DIC_RIGID_BODY
from tests.mutants.dic_stereo import FAULTS as DIC_STEREO
from tests.mutants.dic_surfaces import FAULTS as DIC_SURFACES
from tests.mutants.dic_tracking import FAULTS as DIC_TRACKING
from tests.mutants.doe import FAULTS as DOE
from tests.mutants.end_friction import FAULTS as END_FRICTION
from tests.mutants.explicit import FAULTS as EXPLICIT
from tests.mutants.fault import Fault
from tests.mutants.folding import FAULTS as FOLDING
from tests.mutants.full_field import FAULTS as FULL_FIELD
from tests.mutants.hostile import FAULTS as HOSTILE
from tests.mutants.implicit import FAULTS as IMPLICIT
from tests.mutants.inputs import FAULTS as INPUTS
from tests.mutants.inverse import FAULTS as INVERSE
from tests.mutants.joint import FAULTS as JOINT
from tests.mutants.joint_meshes import FAULTS as JOINT_MESHES
from tests.mutants.length import FAULTS as LENGTH
from tests.mutants.material import FAULTS as MATERIAL
from tests.mutants.numerical import FAULTS as NUMERICAL
from tests.mutants.paper_method import FAULTS as PAPER_METHOD
from tests.mutants.prediction import FAULTS as PREDICTION
from tests.mutants.rates import FAULTS as RATES
from tests.mutants.readers import FAULTS as READERS
from tests.mutants.refine import FAULTS as REFINE
from tests.mutants.regions import FAULTS as REGIONS
from tests.mutants.relaxing import FAULTS as RELAXING
from tests.mutants.report import FAULTS as REPORT
from tests.mutants.results import FAULTS as RESULTS
from tests.mutants.several_minima import FAULTS as SEVERAL_MINIMA
from tests.mutants.several_parameters import FAULTS as SEVERAL
from tests.mutants.shared_errors import FAULTS as SHARED_ERRORS
from tests.mutants.shot import FAULTS as SHOT
from tests.mutants.shot_pictures import FAULTS as SHOT_PICTURES
from tests.mutants.shot_readers import FAULTS as SHOT_READERS
from tests.mutants.slow_compression import FAULTS as SLOW_COMPRESSION
from tests.mutants.slow_dynamics import FAULTS as SLOW_DYNAMICS
from tests.mutants.specimen import FAULTS as SPECIMEN
from tests.mutants.transducer import FAULTS as TRANSDUCER
from tests.mutants.uncertainty import FAULTS as UNCERTAINTY
from tests.mutants.virtual import FAULTS as VIRTUAL
from tests.mutants.virtual_pictures import FAULTS as VIRTUAL_PICTURES

__all__ = ["FAULTS", "Fault"]

FAULTS: tuple[Fault, ...] = (
    *ACTUATOR,
    *BAR_FILES,
    *BARS_FLYER,
    *BARS_QUOTED,
    *BARS_REDUCTION,
    *BARS_SIGNALS,
    *BUDGET,
    *CAUSE_FIT,
    *CAUSES,
    *CLI,
    *COMMON_ERRORS,
    *COVERAGE,
    *DIAGNOSIS,
    *DIC_BODIES,
    *DIC_CALIBRATION,
    *DIC_CHAIN,
    *DIC_RIGID_BODY,
    *DIC_STEREO,
    *DIC_SURFACES,
    *DIC_TRACKING,
    *DOE,
    *END_FRICTION,
    *EXPLICIT,
    *FOLDING,
    *FULL_FIELD,
    *HOSTILE,
    *IMPLICIT,
    *INPUTS,
    *INVERSE,
    *JOINT,
    *JOINT_MESHES,
    *LENGTH,
    *MATERIAL,
    *NUMERICAL,
    *PAPER_METHOD,
    *PREDICTION,
    *RATES,
    *READERS,
    *REFINE,
    *REGIONS,
    *RELAXING,
    *REPORT,
    *RESULTS,
    *SEVERAL_MINIMA,
    *SEVERAL,
    *SHARED_ERRORS,
    *SHOT,
    *SHOT_PICTURES,
    *SHOT_READERS,
    *SLOW_COMPRESSION,
    *SLOW_DYNAMICS,
    *SPECIMEN,
    *TRANSDUCER,
    *UNCERTAINTY,
    *VIRTUAL,
    *VIRTUAL_PICTURES,
)
