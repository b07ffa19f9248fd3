"""The kernel around MuJoCo Warp's step: what becomes of a trial, where its hand goes, and which trial is next."""

import warp as wp  # pyright: ignore[reportMissingImports]

# Of qpos: where the hand's place begins, as in `trial_model`.
_HAND = wp.constant(7)
# Of qvel: where the object's turning begins.
_TURNING = wp.constant(3)
_IDLE = wp.constant(-1)
# Where objects of worlds without a trial are [m]: out of the hand's reach.
_AWAY = wp.constant(10.0)


@wp.struct
class Trials:
    """Every trial, in the order in which they begin.

    Attributes: count: how many there are. begun, ended: how many of them. start: `qpos` at the beginning. up: against
    gravity. friction: of the pads. held: whether it was held in the end. counts: whether there was room.
    """

    count: wp.array[int]
    begun: wp.array[int]
    ended: wp.array[int]
    start: wp.array2d[float]
    up: wp.array[wp.vec3]
    friction: wp.array[float]
    held: wp.array[int]
    counts: wp.array[int]


@wp.struct
class Course:
    """What is the same for all trials.

    Attributes: waiting: steps in which the hand closes, at most. calm_speed, calm_turning, calm_steps: it has closed where
    nothing was faster [m/s, rad/s] for so long. up, aside: where it goes, by step from the first in which it closes.
    gravity: how strong. slip: how far the object may have moved. alike: of its quaternions, the least product where it
    may have turned so far. hand_geoms: whose friction counts. ignored: bits of overflow that do not count.
    """

    waiting: int
    calm_speed: float
    calm_turning: float
    calm_steps: int
    up: wp.array[float]
    aside: wp.array[wp.vec3]
    gravity: float
    slip: float
    alike: float
    hand_geoms: wp.array[int]
    ignored: int


@wp.struct
class Worlds:
    """What is remembered of the trial in each world.

    Attributes: trial: which; -1 where there is none. step: of it; what is left of the time to close is skipped. calm: for
    how many steps nothing was fast. touching: whether the open hand touched the object. closed: the object's pose when
    the hand had closed.
    """

    trial: wp.array[int]
    step: wp.array[int]
    calm: wp.array[int]
    touching: wp.array[int]
    closed: wp.array2d[float]


@wp.func
def _quaternion(poses: wp.array2d[float], world: int) -> wp.vec4:
    """The object's rotation, (w, x, y, z)."""
    return wp.vec4(poses[world, 3], poses[world, 4], poses[world, 5], poses[world, 6])


@wp.func
def _calm(qvel: wp.array2d[float], world: int, course: Course) -> bool:
    """Whether object, hand and fingers are slow."""
    for i in range(qvel.shape[1]):
        most = course.calm_speed
        if i >= _TURNING and i < _TURNING + 3:
            most = course.calm_turning
        if not wp.abs(qvel[world, i]) < most:
            return False
    return True


@wp.kernel
def find_touching(
    count: wp.array[int],
    world_of: wp.array[int],
    distance: wp.array[float],
    worlds: Worlds,
):
    """Which trials begin with a contact that is deeper than nothing."""
    i = wp.tid()
    if i < count[0] and distance[i] < 0.0:
        world = world_of[i]
        if worlds.step[world] == 0:
            worlds.touching[world] = 1


@wp.kernel
def go_on(
    trials: Trials,
    course: Course,
    worlds: Worlds,
    # In and out, of MuJoCo Warp's model and data:
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    warm_start: wp.array2d[float],
    ctrl: wp.array2d[float],
    gravity: wp.array[wp.vec3],
    geom_friction: wp.array2d[wp.vec3],
    overflow: wp.array[int],
):
    """After a step: end the trials that are decided, begin others in their place, and move every hand on."""
    world = wp.tid()
    trial = worlds.trial[world]
    if trial == _IDLE and trials.begun[0] >= trials.count[0]:
        return
    taken = worlds.step[world] + 1
    if taken < course.waiting:
        calm = 0
        if _calm(qvel, world, course):
            calm = worlds.calm[world] + 1
        worlds.calm[world] = calm
        if calm == course.calm_steps:
            taken = course.waiting
    worlds.step[world] = taken
    if taken == course.waiting:
        for i in range(7):
            worlds.closed[world, i] = qpos[world, i]
    moved = wp.vec3(
        qpos[world, 0] - qpos[world, _HAND] - worlds.closed[world, 0],
        qpos[world, 1] - qpos[world, _HAND + 1] - worlds.closed[world, 1],
        qpos[world, 2] - qpos[world, _HAND + 2] - worlds.closed[world, 2],
    )
    # What is not a number is not near.
    most = 2.0 * course.slip
    near = wp.abs(moved[0]) <= most and wp.abs(moved[1]) <= most and wp.abs(moved[2]) <= most
    refused = worlds.touching[world] == 1 or (taken > course.waiting and not near)
    ended = trial == _IDLE or refused or taken == course.up.shape[0]
    if ended and trial != _IDLE:
        product = wp.abs(wp.dot(_quaternion(qpos, world), _quaternion(worlds.closed, world)))
        held = not refused and wp.length(moved) < course.slip and product > course.alike
        trials.held[trial] = int(held)
        trials.counts[trial] = int((overflow[world] & ~course.ignored) == 0)
        wp.atomic_add(trials.ended, 0, 1)
    if ended:
        trial = _IDLE
        if trials.begun[0] < trials.count[0]:
            trial = wp.atomic_add(trials.begun, 0, 1)
            if trial >= trials.count[0]:
                trial = _IDLE
        worlds.trial[world] = trial
        worlds.step[world] = 0
        worlds.touching[world] = 0
        worlds.calm[world] = 0
        overflow[world] = 0
        for i in range(qvel.shape[1]):
            qvel[world, i] = 0.0
            warm_start[world, i] = 0.0
        for i in range(qpos.shape[1]):
            qpos[world, i] = 0.0
        if trial == _IDLE:
            qpos[world, 2] = _AWAY
            qpos[world, 3] = 1.0
        else:
            for i in range(qpos.shape[1]):
                qpos[world, i] = trials.start[trial, i]
            for i in range(course.hand_geoms.shape[0]):
                geom = course.hand_geoms[i]
                friction = geom_friction[world, geom]
                friction[0] = trials.friction[trial]
                geom_friction[world, geom] = friction
    target = wp.vec3(0.0)
    down = wp.vec3(0.0)
    if trial != _IDLE:
        step = worlds.step[world]
        up = trials.up[trial]
        target = course.up[step] * up + course.aside[step]
        # A table would carry the weight while the hand closes.
        if step >= course.waiting:
            down = -course.gravity * up
    for i in range(3):
        ctrl[world, i] = target[i]
    gravity[world] = down
