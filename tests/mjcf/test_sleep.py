"""What stands still is found where it was put, though MuJoCo sleeps."""

from __future__ import annotations

import numpy as np
from dm_control import mjcf

from manipose_mj.mjcf.sleep import sleep_disabled

SCENE = """<mujoco><option><flag sleep="enable"/></option><worldbody>
  <body name="shelf" pos="0 8 60"><geom size=".1"/><camera name="eye"/></body>
  <body pos="0 0 1"><freejoint/><geom size=".1"/></body>
</worldbody></mujoco>"""


def test_a_shelf_that_is_moved_is_seen_there():
    physics = mjcf.Physics.from_xml_string(SCENE)
    flags = int(physics.model.opt.enableflags)
    physics.named.model.body_pos["shelf"] = [1.0, 2.0, 3.0]
    with sleep_disabled(physics):
        physics.forward()
    assert int(physics.model.opt.enableflags) == flags
    for _ in range(3):
        np.testing.assert_allclose(physics.named.data.xpos["shelf"], [1, 2, 3])
        np.testing.assert_allclose(physics.named.data.cam_xpos["eye"], [1, 2, 3])
        physics.step()
