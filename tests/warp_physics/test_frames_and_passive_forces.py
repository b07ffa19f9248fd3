"""Frames and passive forces of worlds with values of their own, against MuJoCo Warp's."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

pytest.importorskip("mujoco_warp", reason='needs pip install -e ".[gpu]"')
wp = pytest.importorskip("warp", reason='needs pip install -e ".[gpu]"')

from tests.warp_physics.paired_worlds import WORLDS, Pair  # noqa: E402

pytestmark = pytest.mark.full  # it compiles for some seconds


def test_frames_and_passive_forces_are_those_of_mujoco_warp():
    host = mujoco.MjModel.from_xml_string("""
    <mujoco>
      <worldbody>
        <geom type="plane" size="2 2 .1"/>
        <body mocap="true" pos="1 .2 .3" quat=".9 .1 .3 .2"><geom type="box" size=".1 .2 .3" pos=".1 0 0"/></body>
        <body pos="0 0 1" gravcomp=".7">
          <joint type="hinge" axis="1 1 0" stiffness="3" springref=".4" damping=".2"/>
          <geom type="box" size=".05 .1 .02" pos=".2 .05 .1" euler="20 30 40"/>
          <site name="tip" pos=".1 .2 .3" euler="10 50 0"/>
          <body pos=".4 .1 0" gravcomp="1">
            <joint type="slide" axis="0 1 1" actuatorgravcomp="true"/>
            <geom type="capsule" size=".03 .1" pos="0 .1 .1" euler="40 0 10"/>
            <body pos="0 0 .3"><joint type="ball"/><geom type="box" size=".02 .03 .08" pos=".05 .1 0"/></body>
          </body>
        </body>
        <body pos=".5 .5 1" gravcomp=".2"><freejoint/><geom type="box" size=".05 .04 .03"/></body>
      </worldbody>
    </mujoco>
    """)
    factors = np.linspace(0.5, 2.0, WORLDS, dtype=np.float32)

    def prepare(model):
        for name in ("body_mass", "body_gravcomp", "geom_pos", "body_ipos"):
            values = getattr(model, name).numpy()
            scaled = values * factors.reshape(-1, *[1] * (values.ndim - 1))
            setattr(model, name, wp.array(scaled, dtype=getattr(model, name).dtype))

    pair = Pair(host, prepare=prepare)
    assert pair.stepper.fused
    for _ in range(40):
        pair.step()
    names = ["xpos", "xmat", "xipos", "ximat", "geom_xpos", "geom_xmat", "site_xpos", "site_xmat"]
    names += ["qfrc_gravcomp", "qfrc_passive", "qfrc_spring", "qfrc_damper", "qfrc_actuator"]
    for name in names:
        assert pair.apart(name) < 1e-5, name
    assert np.ptp(pair.ours.qfrc_gravcomp.numpy()[:, 0]) > 0.1
    assert (pair.ours.qfrc_passive.numpy()[:, 1] == 0.0).all()  # borne by the actuator
    assert (pair.ours.qfrc_gravcomp.numpy()[:, 1] != 0.0).all()
