"""The table-top arena: physics options, table, floor, lights and the fixed cameras."""

from __future__ import annotations

import numpy as np
from dm_control import composer, mjcf
from jaxtyping import Float

from manipose_mj.assets.physics import (
    COLLISION_GROUP,
    CONE,
    IMPRATIO,
    INTEGRATOR,
    SCENE_CONTACT_TIME,
    SOLIMP,
    SUPPORT_CONDIM,
    SUPPORT_FRICTION,
    TIMESTEP,
)

TABLE_HALF_EXTENTS = (0.72, 0.8, 0.02)
TABLE_CENTER = (0.52, 0.0, -0.02)
TABLE_HEIGHT = 0.75
CARPET = 0.015
# Half lengths of what the robot stands on where there is no table; the floor hides what is too long of it.
_PEDESTAL = (0.17, 0.14, 1.0)
_PEDESTAL_X = -0.05  # of its middle: under the arm's foot, which reaches backwards
# The top of a small table beside the pedestal, which is put to one side or the other.
SIDE_TABLE_CENTER = (0.40, 0.38, 0.0)
SIDE_TABLE_HALF_EXTENTS = (0.24, 0.24, 0.02)
_AWAY = (0.0, 0.0, -30.0)  # under the floor

_LEG_COLOUR = [0.45, 0.36, 0.28, 1]
MARKER_GROUP = 4  # of goal markers, which only pictures show

# Position and the point looked at, in the world frame [m]; vertical field of view [deg].
FIXED_CAMERAS: dict[str, tuple[tuple[float, float, float], tuple[float, float, float], float]] = {
    "overview": ((-0.25, -1.15, 0.95), (0.45, 0.02, 0.15), 45.0),
    "front": ((1.30, 0.0, 0.65), (0.40, 0.0, 0.10), 45.0),
    "left": ((0.45, 0.95, 0.60), (0.45, 0.0, 0.10), 45.0),
    "right": ((0.45, -0.95, 0.60), (0.45, 0.0, 0.10), 45.0),
}


class TableArena(composer.Arena):
    """A table whose top is the plane z = 0, or a pedestal on the floor that is as high; the robot's base stands
    at the world's origin either way.

    What differs from episode to episode is where bodies without joints are: nothing is compiled anew.
    """

    def _build(self, name: str = "world") -> None:
        super()._build(name=name)
        root = self._mjcf_root
        _set_physics_options(root)
        root.visual.headlight.set_attributes(
            ambient=[0.35] * 3, diffuse=[0.3] * 3, specular=[0.1] * 3
        )
        # Objects parked high above would make the scene's extent theirs, and GL's near plane 0.6 m.
        root.statistic.set_attributes(extent=2.0, center=[0.5, 0, 0.2])
        root.visual.map.set_attributes(znear=0.005, zfar=10.0)  # times the extent
        getattr(root.visual, "global").set_attributes(offwidth=1280, offheight=960)
        root.asset.add(
            "texture", name="sky", type="skybox", builtin="gradient", width=64, height=384,
            rgb1=[0.93, 0.95, 0.97], rgb2=[0.55, 0.62, 0.70],
        )  # fmt: skip
        world = root.worldbody
        world.add(
            "light", name="key", pos=[0.8, -0.9, 2.2], dir=[-0.2, 0.45, -1], diffuse=[0.55] * 3,
            castshadow=True,
        )  # fmt: skip
        world.add("light", name="fill", pos=[-0.6, 1.2, 1.8], dir=[0.5, -0.6, -1], diffuse=[0.2] * 3, castshadow=False)  # fmt: skip
        ground = world.add("body", name="ground", pos=[0, 0, -TABLE_HEIGHT])
        ground.add(
            "geom", name="floor", type="plane", size=[4, 4, 0.1], rgba=[0.80, 0.80, 0.78, 1],
            contype=0, conaffinity=0,
        )  # fmt: skip
        # What falls off the table comes at 4 m/s, 8 mm a physics step: a carpet begins to brake it early.
        ground.add(
            "geom", name="carpet", type="plane", size=[4, 4, 0.1], group=COLLISION_GROUP, priority=1,
            pos=[0, 0, -CARPET], margin=CARPET, friction=[1, 0.005, 0.0001],
            solref=[0.005, 1], solimp=[0.95, 0.99, 0.001, 0.5, 2],
        )  # fmt: skip
        self._add_table()
        pedestal = world.add("body", name="pedestal", pos=_AWAY)
        pedestal.add(
            "geom", name="pedestal", type="box", size=_PEDESTAL, pos=[_PEDESTAL_X, 0, -_PEDESTAL[2]],
            rgba=[0.55, 0.57, 0.60, 1],
        )  # fmt: skip
        side_table = world.add("body", name="side_table", pos=_AWAY)
        self._add_top(
            side_table,
            "side_table",
            SIDE_TABLE_HALF_EXTENTS,
            (0.0, 0.0, -SIDE_TABLE_HALF_EXTENTS[2]),
        )
        side_table.add(
            "geom", name="side_table_foot", type="box", size=[0.05, 0.05, _PEDESTAL[2]],
            pos=[0, 0, -2 * SIDE_TABLE_HALF_EXTENTS[2] - _PEDESTAL[2]], rgba=_LEG_COLOUR,
        )  # fmt: skip
        for camera, (position, target, fovy) in FIXED_CAMERAS.items():
            world.add(
                "camera", name=camera, pos=position, xyaxes=look_at(position, target), fovy=fovy
            )

    def stand_robot(
        self, physics: mjcf.Physics, height: float, *, table: bool, side_table: float = 0.0
    ) -> None:
        """Have the robot's base so high above the floor [m], on the table or on the pedestal.

        A side table is to its left for 1, to its right for -1, away for 0. `physics` is not brought up to date.
        """
        world = self._mjcf_root.worldbody
        for name, here in (("table", table), ("pedestal", not table)):
            physics.bind(world.find("body", name)).pos = (0.0, 0.0, 0.0) if here else _AWAY
        x, y, z = SIDE_TABLE_CENTER
        beside = (x, side_table * y, z) if side_table else _AWAY
        physics.bind(world.find("body", "side_table")).pos = beside
        physics.bind(world.find("body", "ground")).pos = (0.0, 0.0, -height)

    def _add_table(self) -> None:
        table = self._mjcf_root.worldbody.add("body", name="table")
        self._add_top(table, "table", TABLE_HALF_EXTENTS, TABLE_CENTER)
        thickness = 2 * TABLE_HALF_EXTENTS[2]
        leg = (TABLE_HEIGHT - thickness) / 2
        for i, (sx, sy) in enumerate([(-1, -1), (-1, 1), (1, -1), (1, 1)]):
            x = TABLE_CENTER[0] + sx * (TABLE_HALF_EXTENTS[0] - 0.06)
            y = TABLE_CENTER[1] + sy * (TABLE_HALF_EXTENTS[1] - 0.06)
            table.add(
                "geom", name=f"leg_{i}", type="box", size=[0.03, 0.03, leg], pos=[x, y, -thickness - leg],
                rgba=_LEG_COLOUR,
            )  # fmt: skip

    def _add_top(
        self,
        body: mjcf.Element,
        name: str,
        half: tuple[float, float, float],
        center: tuple[float, float, float],
    ) -> None:
        """The board of a table: half lengths and middle in the body's frame [m]."""
        body.add(
            "geom", name=name, type="box", size=half, pos=center, rgba=[0.72, 0.58, 0.43, 1],
            friction=SUPPORT_FRICTION, condim=SUPPORT_CONDIM, solref=[SCENE_CONTACT_TIME, 1], solimp=SOLIMP,
        )  # fmt: skip


def look_at(
    position: tuple[float, float, float], target: tuple[float, float, float]
) -> Float[np.ndarray, "6"]:
    """MuJoCo's `xyaxes` of a camera at `position` that looks at `target` with the world's z up.

    One that looks straight down or up has the world's x up in its image.
    """
    backward = np.asarray(position, float) - np.asarray(target, float)
    backward /= np.linalg.norm(backward)
    right = np.cross([0.0, 0.0, 1.0], backward)
    if np.linalg.norm(right) < 1e-6:
        right = np.cross([1.0, 0.0, 0.0], backward)
    right /= np.linalg.norm(right)
    return np.concatenate([right, np.cross(backward, right)])


def _set_physics_options(root: mjcf.RootElement) -> None:
    root.option.set_attributes(
        timestep=TIMESTEP,
        integrator=INTEGRATOR,
        cone=CONE,
        impratio=IMPRATIO,
        noslip_iterations=0,  # Composer's own arena states 5
    )
    # What rests is not computed until something that moves touches it; parked objects never are.
    root.option.flag.sleep = "enable"
    root.size.set_attributes(memory="64M")
