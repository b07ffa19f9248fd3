"""The first look at pairs of shapes against MuJoCo Warp's, on every device that Warp finds."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

mjw = pytest.importorskip("mujoco_warp", reason='needs pip install -e ".[gpu]"')
wp = pytest.importorskip("warp", reason='needs pip install -e ".[gpu]"')

from manipose_mj.warp_physics import collisions  # noqa: E402

pytestmark = pytest.mark.full  # it compiles for half a minute


def crowd(bodies):
    """Boxes and balls close to one another and to the ground, which are drawn."""
    rng = np.random.default_rng(3)
    shapes = ('type="box" size=".06 .05 .04"', 'type="sphere" size=".05"')
    places = rng.uniform((-0.3, -0.3, 0.02), (0.3, 0.3, 0.4), (bodies, 3))
    return mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="plane" size="2 2 .1"/>'
        + "".join(
            f'<body pos="{x} {y} {z}"><freejoint/><geom {shapes[i % 2]}/></body>'
            for i, (x, y, z) in enumerate(places)
        )
        + "</worldbody></mujoco>"
    )


@pytest.mark.parametrize(
    "bodies", [20, 52]
)  # few pairs, and so many that four warps look at a world
@pytest.mark.parametrize("device", [str(device) for device in wp.get_devices()])
def test_contacts_of_a_crowd_are_those_of_mujoco_warp(bodies, device):
    host, worlds = crowd(bodies), 7
    assert (bodies * (bodies + 1) // 2 > collisions._MANY_PAIRS) == (bodies == 52)
    with wp.ScopedDevice(device):
        model = mjw.put_model(host)
        data = mjw.make_data(host, nworld=worlds, naconmax=2_000 * worlds, njmax=10)
        moved = np.random.default_rng(4).normal(0, 0.02, (worlds, host.nq))
        data.qpos.assign((host.qpos0 + moved).astype(np.float32))
        mjw.kinematics(model, data)
        found = []
        for look in (lambda: mjw.collision(model, data), collisions.Collisions(model, data).find):
            look()
            count = int(data.nacon.numpy()[0])
            contact = data.contact
            rows = zip(
                contact.worldid.numpy()[:count].tolist(),
                map(tuple, contact.geom.numpy()[:count].tolist()),
                contact.dist.numpy()[:count].tolist(),
                strict=True,
            )
            found.append(sorted(rows))
    assert len(found[0]) > 10 * worlds
    assert found[0] == found[1]
