"""Faults of the flyer in pictures: displacement, poses, edge strip, rest place from a rim."""

from tests.mutants.fault import Fault

GATES = ("tests/unit/dic/test_dic_gates.py",)
RIM = ("tests/unit/dic/test_dic_rest_from_rim.py",)
PAST_RIM = ("tests/unit/dic/test_dic_past_rim.py",)
BY_EDGE = ("tests/unit/dic/test_dic_seen_by_edge.py",)
STRIP = "tests/unit/dic/test_dic_edge_registration.py"

ALONE = ("tests/unit/dic/test_dic_one_camera_at_rest.py",)

FAULTS = (
    Fault(
        name="one camera at rest: what the body may have moved across is forgotten",
        file="dic/bodies/axial_displacement.py",
        right="off = np.hypot(place_sigma, lateral[k])",
        wrong="off = place_sigma",
        tests=ALONE,
    ),
    Fault(
        name="one camera at rest: depth by perspective",
        file="dic/bodies/axial_displacement.py",
        right="across[k, 1]]), LEAST_LATERAL * pixel",
        wrong="across[k, 1]]), float(lateral[k])",
        tests=ALONE,
    ),
    Fault(
        name="region past the rim: kept to a pixel beyond it",
        file="dic/chain/follow_bodies.py",
        right="* scale >= CLEAR",
        wrong="* scale >= -CLEAR",
        tests=PAST_RIM,
    ),
    Fault(
        name="region past the rim: the flyer looked for on the axis",
        file="dic/chain/follow_bodies.py",
        right="np.array([move[0], 0.0, move[2]])",
        wrong="np.zeros(3)",
        tests=PAST_RIM,
    ),
    Fault(
        name="flyer: a lateral motion of a scene of any size",
        file="dic/bodies/axial_displacement.py",
        right="low, high = LEAST_LATERAL * pixel, LATERAL_SIGMA * pixel",
        wrong="low, high = LEAST_LATERAL * 56e-6, LATERAL_SIGMA * 56e-6",
        tests=("tests/unit/dic/test_dic_lateral.py",),
    ),
    Fault(
        name="edge strip: a correction of a scene of any size",
        file="dic/bodies/edge_registration.py",
        right="abs(y - tried[best]) > LARGEST_CORRECTION * self.pixel:",
        wrong="abs(y - tried[best]) > LARGEST_CORRECTION * 1e-5:",
        tests=(
            "tests/unit/dic/test_dic_edge_registration.py"
            "::test_the_same_pictures_of_a_scene_of_another_size_give_the_same_places_in_it",
        ),
    ),
    Fault(
        name="rigid motion: robust limit divided by the MAD constant",
        file="dic/bodies/body_motion.py",
        right="MAD * float(np.median(size))",
        wrong="float(np.median(size)) / MAD",
        tests=GATES,
    ),
    Fault(
        name="poses: robust limit divided by the MAD constant",
        file="dic/bodies/body_motion.py",
        right="MAD * float(np.median(far[now.valid]))",
        wrong="float(np.median(far[now.valid])) / MAD",
        tests=GATES,
    ),
    Fault(
        name="flyer's points: spread from the median length times its constant",
        file="dic/bodies/axial_displacement.py",
        right="float(median(size / self.noise)) / MEDIAN_LENGTH",
        wrong="float(median(size / self.noise)) * MEDIAN_LENGTH",
        tests=GATES,
    ),
    Fault(
        name="place at rest: the reference's noise averages out",
        file="dic/bodies/axial_displacement.py",
        right="(1.0 - OWN_SHARE + OWN_SHARE / sigma.size)",
        wrong="(OWN_SHARE / sigma.size)",
        tests=GATES,
    ),
    Fault(
        name="rim: the first row that varies by its noise alone",
        file="dic/bodies/rest_from_rim.py",
        right="max(VARIES[0] * low, VARIES[1] * high)",
        wrong="VARIES[0] * low",
        tests=(f"{RIM[0]}::test_the_first_row_that_varies",),
    ),
    Fault(
        name="zero: two places at rest are averaged without weights",
        file="dic/bodies/axial_displacement.py",
        right="w = np.array([seen[1], by_end[1]]) ** -2.0",
        wrong="w = np.array([seen[1], by_end[1]]) ** 0.0",
        tests=(f"{RIM[0]}::test_what_was_seen_and_the_end_are_joined",),
    ),
    Fault(
        name="flyer by its edge: what the rows share left out of the frames that move",
        file="dic/bodies/axial_displacement.py",
        right="edge.sigma if static[k] else of_moving(edge)",
        wrong="edge.sigma",
        tests=BY_EDGE,
    ),
    Fault(
        name="flyer by its edge: what the rows share counted at rest and in its place",
        file="dic/bodies/axial_displacement.py",
        right="edge.sigma if static[k] else of_moving(edge)",
        wrong="of_moving(edge)",
        tests=BY_EDGE,
    ),
    Fault(
        name="flyer by its edge: half of what the rows share taken for the reference's",
        file="dic/bodies/axial_displacement.py",
        right="edge.common / OWN_SHARE**0.5",
        wrong="edge.common",
        tests=BY_EDGE,
    ),
    Fault(
        name="zero: the face beside the rim adds nothing",
        file="dic/bodies/axial_displacement.py",
        right="FACE_SHARE, NARROW_FACE = 0.001, 1.0",
        wrong="FACE_SHARE, NARROW_FACE = 0.0, 1.0",
        tests=(f"{RIM[0]}::test_what_static_frames_share",),
    ),
    Fault(
        name="rim: the face is seen from above too",
        file="dic/bodies/rest_from_rim.py",
        right="max(y - float(camera[1]), 0.0) / distance",
        wrong="abs(y - float(camera[1])) / distance",
        tests=(f"{RIM[0]}::test_the_face_is_seen_at_a_glance_from_below_only",),
    ),
    Fault(
        name="rim: a specimen that keeps its radius",
        file="dic/bodies/rest_from_rim.py",
        right="mean = geometry.radius * float(np.sqrt(geometry.length / max(y, 0.2 * geometry.length)))",
        wrong="mean = geometry.radius",
        tests=(f"{RIM[0]}::test_the_face_is_seen_at_a_glance_from_below_only",),
    ),
    Fault(
        name="edge strip: the row at the region's end is used whatever it errs by",
        file="dic/bodies/edge_registration.py",
        right="return error if error <= LARGEST_EDGE * self.pixel else None",
        wrong="return error",
        tests=(
            "tests/unit/dic/test_dic_edge_registration.py"
            "::test_the_offset_of_the_last_row_is_found_from_frames_that_show_more",
        ),
    ),
    Fault(
        name="edge strip: known frames say nothing of what it looks like",
        file="dic/bodies/edge_registration.py",
        right="if zncc < self._least or",
        wrong="if zncc < LEAST_ZNCC or",
        tests=(f"{STRIP}::test_a_strip_that_looks_unlike_the_body_is_not_taken_for_it",),
    ),
    Fault(
        name="edge strip: noise has no share in how unlike it may look",
        file="dic/bodies/edge_registration.py",
        right="max(UNLIKE, TIMES * (1.0 - float(np.median(known))))",
        wrong="UNLIKE",
        tests=(f"{STRIP}::test_a_strip_looks_like_the_body_where_it_is_known",),
    ),
    Fault(
        name="edge strip: the smaller of two limits",
        file="dic/bodies/edge_registration.py",
        right="max(LEAST_ZNCC, 1.0 - max(UNLIKE",
        wrong="min(LEAST_ZNCC, 1.0 - max(UNLIKE",
        tests=(f"{STRIP}::test_a_strip_looks_like_the_body_where_it_is_known",),
    ),
    Fault(
        name="frames before: a static frame may be anywhere",
        file="dic/bodies/edge_registration.py",
        right="fine[i] = at_rest_before(",
        wrong="fine[i] = True or at_rest_before(",
        tests=(
            "tests/unit/dic/test_dic_edge_registration.py"
            "::test_a_static_frame_far_from_where_the_body_came_from_is_left_out",
        ),
    ),
    Fault(
        name="frames before: a body may have rested beyond where it is later",
        file="dic/bodies/edge_registration.py",
        right="return low - distance <= change <= high + distance",
        wrong="return abs(change) <= high - low + distance",
        tests=(
            "tests/unit/dic/test_dic_edge_registration.py::test_a_body_rested_no_farther_than_its_speed_says",
        ),
    ),
    Fault(
        name="rim: half of what the model leaves out",
        file="dic/bodies/rest_from_rim.py",
        right="MODEL = 0.12",
        wrong="MODEL = 0.06",
        tests=(f"{RIM[0]}::test_the_rim_of_a_body_that_passes_a_specimen_is_found",),
    ),
    Fault(
        name="rim: what the model leaves out averages over the cameras",
        file="dic/bodies/rest_from_rim.py",
        right="np.sqrt(np.mean(np.square(sigmas)))",
        wrong="np.sqrt(np.mean(np.square(sigmas)) / len(sigmas))",
        tests=(f"{RIM[0]}::test_cameras_that_disagree_widen_the_rim",),
    ),
    Fault(
        name="rim: cameras that disagree are averaged",
        file="dic/bodies/rest_from_rim.py",
        right="np.square(sigmas))), 0.5 * apart))",
        wrong="np.square(sigmas))), 0.05 * apart))",
        tests=(f"{RIM[0]}::test_cameras_that_disagree_widen_the_rim",),
    ),
    Fault(
        name="medians: of an even number the upper middle value",
        file="dic/basics.py",
        right="0.5 * (ordered[half - 1] + ordered[half])",
        wrong="0.5 * (ordered[half] + ordered[half])",
        tests=("tests/unit/dic/test_dic_speed_parts.py::test_a_median_is_numpy_s",),
    ),
)
