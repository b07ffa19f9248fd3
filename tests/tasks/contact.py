"""Who touches whom."""

from __future__ import annotations

import numpy as np
from dm_control import composer, mjcf


def touches_robot(task, physics: mjcf.Physics, entity: composer.Entity) -> bool:
    """Whether any geom of the task's robot touches any geom of the entity."""
    geoms = physics.data.contact.geom
    own, robots = (
        np.isin(geoms, physics.bind(e.mjcf_model.find_all("geom")).element_id)
        for e in (entity, task.robot)
    )
    return bool(np.any(own[:, 0] & robots[:, 1] | own[:, 1] & robots[:, 0]))
