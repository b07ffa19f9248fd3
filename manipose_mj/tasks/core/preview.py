"""A private copy of a simulation, in which a start can be looked at before it is one."""

from __future__ import annotations

from dm_control import mjcf

from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from manipose_mj.mjcf.sleep import sleep_disabled
from manipose_mj.tasks.core.randomisation import write_changes
from manipose_mj.tasks.core.scene import Scene
from manipose_mj.tasks.core.start import EpisodeStart, ModelChanges


class Preview:
    """Tells where things would be. What was shown before leaves no trace in what is shown next."""

    def __init__(self, physics: mjcf.Physics, scene: Scene) -> None:
        """Copies the compiled model before anything of it is changed."""
        self._scene = scene
        self._physics = physics.copy(share_model=False)

    def change(self, changes: ModelChanges) -> None:
        """Start from another model: that of the episode which is drawn."""
        if changes.fields:
            write_changes(self._physics, changes)

    def show(self, start: EpisodeStart) -> mjcf.Physics:
        """The simulation as it is where an episode starts, with the robot at home; valid until the next."""
        physics, robot = self._physics, self._scene.robot
        joints = physics.bind([*robot.joints, *robot.finger_joints])
        joints.qpos = [*HOME, MAX_OPENING / 2, MAX_OPENING / 2]
        with sleep_disabled(physics):
            self._scene.write(physics, start)
            physics.forward()
        return physics
