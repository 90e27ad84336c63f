"""Faults of bodies in pictures: regions, ends, edges, what is followed past the ends, the material frame."""

from tests.mutants.fault import Fault

GATES = ("tests/unit/dic/test_dic_gates.py",)
PAST = ("tests/unit/dic/test_dic_past_ends.py",)
ARC = "tests/unit/dic/test_dic_rim_arc.py"
REGIONS = "tests/unit/dic/test_dic_found_regions.py"
EDGE = "tests/unit/dic/test_dic_edge.py"
TRAVEL = ("tests/unit/dic/test_dic_travel_checks.py",)
TOGETHER = ("tests/unit/dic/test_dic_side_by_side.py",)

FAULTS = (
    Fault(
        name="regions: an arc by plain least squares",
        file="dic/bodies/edges.py",
        right='loss="soft_l1", f_scale=SPREAD',
        wrong='loss="linear"',
        tests=(f"{ARC}::test_one_block_that_ends_early_does_not_move_the_arc",),
    ),
    Fault(
        name="regions: the edge of a block at another share",
        file="dic/bodies/edges.py",
        right="SHARE = 0.5",
        wrong="SHARE = 0.8",
        tests=(f"{ARC}::test_an_edge_lies_where_the_departure_falls_to_half",),
    ),
    Fault(
        name="regions: the lowest row of an arc, not the highest",
        file="dic/bodies/region.py",
        right="np.floor(arc.min() - ARC_CLEAR)",
        wrong="np.floor(arc.max() - ARC_CLEAR)",
        tests=(f"{REGIONS}::test_a_specimen_ends_clear_of_the_arc_of_a_rim",),
    ),
    Fault(
        name="regions: rows without speckles count in the typical contrast",
        file="dic/bodies/region.py",
        right="np.median(contrast[contrast >= BAND * np.percentile(contrast, 90.0)])",
        wrong="np.median(contrast)",
        tests=(f"{REGIONS}::test_contrast_of_speckles_is_told_from_that_of_bare_rows",),
    ),
    Fault(
        name="material frame: the farthest",
        file="dic/bodies/follow.py",
        right="np.argmin(np.abs(usable - wanted))",
        wrong="np.argmax(np.abs(usable - wanted))",
        tests=GATES,
    ),
    Fault(
        name="material frame: one camera is enough",
        file="dic/bodies/follow.py",
        right="(health[0] == FrameOutcome.VALID) & (health[1] == FrameOutcome.VALID)",
        wrong="(health[0] == FrameOutcome.VALID) | (health[1] == FrameOutcome.VALID)",
        tests=GATES,
    ),
    Fault(
        name="past the ends: frames of a later part taken for those of the first",
        file="dic/chain/outliers.py",
        right="k += part.start",
        wrong="k += 0",
        tests=(f"{PAST[0]}::test_frames_are_judged_alike_one_by_one_and_together",),
    ),
    Fault(
        name="edge: the band lies before the edge",
        file="dic/bodies/edge_fit.py",
        right="_side(u, v, edge + band, blur, below=False)",
        wrong="_side(u, v, edge - band, blur, below=False)",
        tests=(f"{EDGE}::test_covariance_of_paint_that_ends",),
    ),
    Fault(
        name="edges: the slope over the paint's end turned round",
        file="dic/bodies/edge_fit.py",
        right="at_end if below else -at_end",
        wrong="at_end",
        tests=(f"{EDGE}::test_slopes_of_the_covariance",),
    ),
    Fault(
        name="edge: paint adds by its standard deviation",
        file="dic/bodies/edge_fit.py",
        right="size**2 * paint(lag",
        wrong="size * paint(lag",
        tests=(f"{EDGE}::test_covariance_of_paint_that_ends",),
    ),
    Fault(
        name="edge: blocks of columns without their degree of freedom",
        file="dic/bodies/edge_fit.py",
        right="* n / (n - 1.0)",
        wrong="* n / n",
        tests=(f"{EDGE}::test_sigma_from_the_scatter_of_blocks",),
    ),
    Fault(
        name="edge: shading along it counts as paint",
        file="dic/bodies/edge_fit.py",
        right="np.stack([np.ones_like(x), x, x**2], axis=1)",
        wrong="np.stack([np.ones_like(x), x], axis=1)",
        tests=(f"{EDGE}::test_shading_along_the_edge_is_taken_out",),
    ),
    Fault(
        name="end: cameras that disagree do not widen its sigma",
        file="dic/chain/test_frame.py",
        right="np.sqrt(max(1.0, chi2) / np.sum(w))",
        wrong="np.sqrt(1.0 / np.sum(w))",
        tests=(f"{EDGE}::test_places_are_weighted_and_disagreement_counts",),
    ),
    Fault(
        name="past the ends: no rim stands before an end",
        file="dic/chain/outliers.py",
        right="before = (b**2 > a * c) & (share < 1.0)",
        wrong="before = (b**2 > a * c) & (share > 1.0)",
        tests=PAST,
    ),
    Fault(
        name="past the ends: the rim where the ray leaves it",
        file="dic/chain/outliers.py",
        right="share = (-b - np.sqrt(",
        wrong="share = (-b + np.sqrt(",
        tests=PAST,
    ),
    Fault(
        name="past the ends: camera 0 alone judges",
        file="dic/chain/outliers.py",
        right="zip(rig.cameras, body.tracks, r.pixels, strict=True)",
        wrong="zip(rig.cameras[:1], body.tracks[:1], r.pixels[:1], strict=True)",
        tests=PAST,
    ),
    Fault(
        name="past the ends: subsets do not deform",
        file="dic/chain/outliers.py",
        right="step + carried(warp, step)[:, :2] - warp[:, :2]",
        wrong="step",
        tests=PAST,
    ),
    Fault(
        name="past the ends: points behind the rim are not near an end",
        file="dic/chain/outliers.py",
        right="platen * _steepest(camera, frame, side, end)",
        wrong="0.0",
        tests=PAST,
    ),
    Fault(
        name="strip: as much of a subset as of a body that fills it",
        file="dic/bodies/follow.py",
        right="min(settings.least_pixels, STRIP * float(held[y, x].max()))",
        wrong="settings.least_pixels",
        tests=GATES,
    ),
    Fault(
        name="end: a camera below its plane sees the specimen's own edge",
        file="dic/chain/test_frame.py",
        right="radius = specimen if slope >= 0.0 else rim",
        wrong="radius = specimen",
        tests=(f"{EDGE}::test_a_rim_that_hides_the_end",),
    ),
    Fault(
        name="region: carried by what does not look like it",
        file="dic/bodies/region.py",
        right="LEAST_ZNCC = 0.9",
        wrong="LEAST_ZNCC = -0.9",
        tests=TRAVEL,
    ),
    Fault(
        name="followed edge: what is not rigid is a flyer",
        file="dic/bodies/edges.py",
        right="if level > most:",
        wrong="if level > 1e9 * most:",
        tests=(f"{REGIONS}::test_rows_that_vary_by_more_than_the_noise_are_not_rigid",),
    ),
    Fault(
        name="followed edge: rows are held still without an error",
        file="dic/bodies/edges.py",
        right="(RIGID * noise) ** 2 + PLACED**2 * true",
        wrong="(RIGID * noise) ** 2 + 0.0 * true",
        tests=(f"{REGIONS}::test_rows_are_held_still_to_so_many_pixels",),
    ),
    Fault(
        name="followed edge: the noise of a slope is not taken off",
        file="dic/bodies/edges.py",
        right="float(np.mean(slope**2)) - 0.5 * noise**2",
        wrong="float(np.mean(slope**2)) - 0.0 * noise**2",
        tests=(f"{REGIONS}::test_rows_are_held_still_to_so_many_pixels",),
    ),
    Fault(
        name="followed edge: the strip may hold specimen",
        file="dic/bodies/edges.py",
        right="if edge >= travel[used].max() + STRIP + 1.0:",
        wrong="if edge >= 0.0:",
        tests=(f"{REGIONS}::test_a_flyer_that_hardly_comes_in_is_told_by_looks",),
    ),
    Fault(
        name="lower end: contrast of all rows, the platen's too, taken for the specimen's",
        file="dic/bodies/region.py",
        right="np.median(contrast[contrast >= BAND * np.percentile(contrast, 90.0)])",
        wrong="np.median(contrast)",
        tests=(REGIONS,),
    ),
    Fault(
        name="lower end: fits to two strips add nothing to sigma by what they differ",
        file="dic/chain/test_frame.py",
        right="+ apart**2",
        wrong="",
        tests=(EDGE,),
    ),
    Fault(
        name="lower end: a gap in the paint taken for a standard deviation",
        file="dic/chain/test_frame.py",
        right="LEAST_GAP, 0.0) / 12.0**0.5",
        wrong="LEAST_GAP, 0.0)",
        tests=(EDGE,),
    ),
    Fault(
        name="lower end: gap measured from a quarter of the contrast",
        file="dic/bodies/edge_fit.py",
        right="half = 0.5 * float",
        wrong="half = 0.25 * float",
        tests=(EDGE,),
    ),
    Fault(
        name="tracks of any size are sent by a fork",
        file="dic/bodies/follow.py",
        right="for body in bodies) <= MOST_SENT",
        wrong="for body in bodies) >= 0",
        tests=TOGETHER,
    ),
)
