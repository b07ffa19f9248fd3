"""Composer entities of a scene: the Panda, built assets, the table, a shelf; cameras and markers.

    from manipose_mj.assets import catalogue
    from manipose_mj.mjcf import Panda, RigidObject, TableArena

    arena = TableArena()
    arena.attach(Panda())
    arena.add_free_entity(RigidObject(catalogue.load("mug")))

| module or folder | holds |
|---|---|
| `arena`, `shelf` | the table with its physics and cameras; a shelf to stand on it |
| `objects` | rigid and articulated assets as entities |
| `panda/` | the robot: kinematics, collision geometry, model, entity |
| `cameras/` | depth, clouds and pictures by ray casting or GL; sensor noise |
| `markers/` | what shows a goal in pictures |
| `views/` | films, thumbnails, contact sheets, the interactive viewer |
| `sleep` | MuJoCo's sleeping bodies and what it does not notice |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from manipose_mj.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from manipose_mj.mjcf.arena import TableArena
    from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
    from manipose_mj.mjcf.panda.robot import Panda
    from manipose_mj.mjcf.shelf import Shelf, ShelfConfig

__all__ = ["ArticulatedObject", "Panda", "RigidObject", "Shelf", "ShelfConfig", "TableArena"]

__getattr__ = lazy_exports(__name__, __file__)
