"""Does a ball go into a cavity through the open drawer or door, and does it stay there?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.assets.physics import SOLIMP, SOLREF, TIMESTEP


@dataclass(frozen=True)
class BallTest:
    """How the ball is put in.

    Attributes:
      radius: [m]. mass: [kg].
      speed: At which it is led in [m/s]. stiffness: Of what leads it [N/m]. force: At most [N].
      margin: And how far from the ends of a door's panel at least [m].
      outside: Where it starts: this far outside the cavity [m].
      inset: How far from the front of a drawer it is dropped [m].
      rest_time: After which it must be at rest inside [s]. rest_speed: [m/s].
      slack: Its centre may be this far outside the cavity [m].
    """

    radius: float = 0.03
    mass: float = 0.1
    speed: float = 0.25
    stiffness: float = 60.0
    force: float = 4.0
    margin: float = 0.05
    outside: float = 0.06
    inset: float = 0.05
    rest_time: float = 2.0
    rest_speed: float = 0.05
    slack: float = 0.005


TEST = BallTest()


def takes_ball(asset: Asset, part: MovingPart) -> str:
    """Open a part, lead a ball of 6 cm straight into its cavity and let go.

    Args:
      asset: Articulated.
      part: One of its parts that has a cavity; all others stay shut.

    Returns:
      What went wrong, in one line; empty if the ball stays.
    """
    assert part.cavity is not None
    model = _scene(asset.model_path)
    data = mujoco.MjData(model)
    outwards, door = _way_out(model, data, part)
    joint = data.joint(f"asset/{part.name}")
    joint.qpos = part.joint.range[1]
    mujoco.mj_forward(model, data)
    body = data.body(f"asset/{part.name if part.cavity.moves_with_part else 'base'}")
    turn, origin = body.xmat.reshape(3, 3).copy(), body.xpos.copy()
    half = part.cavity.extents / 2
    inside = part.cavity.center.copy()
    if door is not None:  # the floor may be below the door
        least, most = door[0] + TEST.margin, door[1] - TEST.margin
        inside = np.where(outwards == 0, np.clip(inside, least, most), inside)
    else:  # where the open drawer is sure to be clear of the carcass
        axis = int(np.abs(part.joint.axis).argmax())
        sign = np.sign(part.joint.axis[axis])
        inside[axis] += sign * max(half[axis] - TEST.inset, 0.0)
    outside = inside + outwards * (half @ np.abs(outwards) + TEST.radius + TEST.outside)
    ends = [origin + turn @ p for p in (outside, inside)]
    ball = data.joint("ball")
    ball.qpos[:3] = ends[0]
    if not _lead(model, data, ends):
        return f"part {part.name!r}: the ball is stopped on its way in"
    start = data.time
    while data.time < start + TEST.rest_time:
        mujoco.mj_step(model, data)
    # Wherever the part has moved to meanwhile.
    turn, origin = body.xmat.reshape(3, 3), body.xpos
    offset = np.abs(turn.T @ (ball.qpos[:3] - origin) - part.cavity.center)
    if (offset > half + TEST.slack).any():
        return f"part {part.name!r}: the ball leaves the cavity by {1e3 * (offset - half).max():.0f} mm"
    speed = float(np.linalg.norm(ball.qvel[:3]))
    if not speed < TEST.rest_speed:
        return f"part {part.name!r}: the ball still rolls at {speed:.2f} m/s"
    return ""


def _scene(path: Path) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.option.timestep = TIMESTEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    body = spec.worldbody.add_body(name="ball")
    body.add_freejoint(name="ball")
    geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[TEST.radius, 0, 0])
    geom.mass, geom.condim, geom.friction = TEST.mass, 6, [0.8, 0.005, 0.001]
    geom.solref, geom.solimp[:3] = SOLREF, SOLIMP
    spec.attach(
        mujoco.MjSpec.from_file(str(path)), frame=spec.worldbody.add_frame(), prefix="asset/"
    )
    return spec.compile()


def _way_out(
    model: mujoco.MjModel, data: mujoco.MjData, part: MovingPart
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "2 3"] | None]:
    """Up for a drawer; else the axis along which the shut part lies beside its cavity, and its bounds."""
    assert part.cavity is not None
    if part.cavity.moves_with_part:
        return np.array([0.0, 0.0, 1.0]), None
    mujoco.mj_forward(model, data)
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, f"asset/{part.name}")
    ends = []
    for geom in np.flatnonzero((model.geom_bodyid == body) & (model.geom_contype > 0)):
        turn = data.geom_xmat[geom].reshape(3, 3)
        middle = data.geom_xpos[geom] + turn @ model.geom_aabb[geom, :3]
        reach = np.abs(turn) @ model.geom_aabb[geom, 3:]
        ends.append((middle - reach, middle + reach))
    bounds = np.stack([np.min([e[0] for e in ends], axis=0), np.max([e[1] for e in ends], axis=0)])
    low, high = bounds - part.cavity.center
    beside = np.maximum(low, -high) - part.cavity.extents / 2
    axis = int(beside.argmax())
    return np.eye(3)[axis] * (1.0 if low[axis] > -high[axis] else -1.0), bounds


def _lead(model: mujoco.MjModel, data: mujoco.MjData, ends: list[Float[np.ndarray, "3"]]) -> bool:
    """Whether the ball follows a point that goes from the first to the second end."""
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "ball")
    ball = data.joint("ball")
    length = float(np.linalg.norm(ends[1] - ends[0]))
    damping = 2 * np.sqrt(TEST.stiffness * TEST.mass)
    start = data.time
    while data.time < start + length / TEST.speed + 1.0:
        share = min((data.time - start) * TEST.speed / length, 1.0)
        target = ends[0] + share * (ends[1] - ends[0])
        pull = TEST.stiffness * (target - ball.qpos[:3]) - damping * ball.qvel[:3]
        pull *= min(1.0, TEST.force / max(float(np.linalg.norm(pull)), 1e-9))
        data.xfrc_applied[body, :3] = pull - TEST.mass * model.opt.gravity
        mujoco.mj_step(model, data)
    data.xfrc_applied[body] = 0.0
    return bool(np.linalg.norm(ball.qpos[:3] - ends[1]) < TEST.radius / 2)
