"""The emitted Panda against its published tables, MuJoCo Menagerie's model and a squeezed object."""

from __future__ import annotations

import tarfile

import mujoco
import numpy as np
import pytest
from dm_control import composer, mjcf

from manipose_mj.assets import franka_hand
from manipose_mj.assets.physics import CONE, IMPRATIO, INTEGRATOR
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda import geometry as panda_geometry
from manipose_mj.mjcf.panda import kinematics as panda_kinematics
from manipose_mj.mjcf.panda.robot import (
    ACCELERATION_LIMITS,
    GRIP_FORCE,
    HOME,
    MAX_OPENING,
    POSITION_LIMITS,
    TCP_SPEED_LIMIT,
    TORQUE_LIMITS,
    VELOCITY_LIMITS,
    Panda,
    picture_visuals,
)
from tests.places import REAL_DATA

LINKS = [f"link{i}" for i in range(8)]
# Planar solutions with the TCP at x = 0.45 m, pointing down, at heights 0.30 m and 0.50 m.
LOW = np.array([0.0, -0.2594, 0.0, -2.4315, 0.0, 2.1721, np.pi / 4])
HIGH = np.array([0.0, -0.3391, 0.0, -1.9889, 0.0, 1.6498, np.pi / 4])


def make_scene(visuals="primitive", shape=None, size=(), at=(0.45, 0.0, 0.35), mass=0.4):
    arena = composer.Arena()
    arena.mjcf_model.option.set_attributes(
        timestep=0.002,
        cone=CONE,
        impratio=IMPRATIO,
        integrator=INTEGRATOR,
    )
    if shape:
        body = arena.mjcf_model.worldbody.add("body", name="object", pos=at)
        body.add("freejoint")
        body.add("geom", name="object", type=shape, size=size, mass=mass)
    panda = Panda(visuals=visuals)
    arena.attach(panda)
    return panda, mjcf.Physics.from_mjcf_model(arena.mjcf_model)


def steps(physics, seconds):
    for _ in range(round(seconds / physics.timestep())):
        physics.step()


@pytest.fixture(scope="session")
def menagerie(tmp_path_factory):
    archive = REAL_DATA / "menagerie_franka_emika_panda.tar.xz"
    if not archive.is_file():
        pytest.skip(f"no {archive}; set MANIPOSE_REAL_DATA to the folder that holds it")
    unpacked = tmp_path_factory.mktemp("menagerie")
    with tarfile.open(archive) as tar:
        tar.extractall(unpacked, filter="data")
    return next(unpacked.rglob("franka_emika_panda/panda.xml")).parents[1]


@pytest.fixture(scope="module")
def scene():
    return make_scene()


def random_configurations(count):
    return np.random.default_rng(0).uniform(*POSITION_LIMITS.T, size=(count, 7))


def test_limits_are_the_published_ones(scene):
    panda, physics = scene
    np.testing.assert_array_equal(physics.bind(panda.joints).range, POSITION_LIMITS)
    np.testing.assert_array_equal(physics.bind(panda.actuators).ctrlrange, POSITION_LIMITS)
    np.testing.assert_array_equal(physics.bind(panda.actuators).forcerange[:, 1], TORQUE_LIMITS)
    np.testing.assert_array_equal(TORQUE_LIMITS, [87, 87, 87, 87, 12, 12, 12])
    np.testing.assert_array_equal(VELOCITY_LIMITS, [2.175] * 4 + [2.61] * 3)
    np.testing.assert_array_equal(ACCELERATION_LIMITS, [15, 7.5, 10, 12.5, 15, 20, 20])
    assert tuple(POSITION_LIMITS[3]) == (-3.0718, -0.0698)
    assert tuple(POSITION_LIMITS[5]) == (-0.0175, 3.7525)
    np.testing.assert_array_equal(
        physics.bind(panda.gripper_actuator).ctrlrange, [0.0, MAX_OPENING]
    )


def test_forward_kinematics_agree_with_menagerie(scene, menagerie):
    panda, physics = scene
    theirs = mujoco.MjModel.from_xml_path(str(menagerie / "franka_emika_panda" / "panda.xml"))
    data = mujoco.MjData(theirs)
    ours = physics.model.ptr
    names = [*LINKS, "hand", "left_finger", "right_finger"]
    our_ids = [ours.body(f"panda/{name}").id for name in names]
    their_ids = [theirs.body(name).id for name in names]
    for joints in random_configurations(1000):
        data.qpos[:] = physics.data.qpos[:] = [*joints, 0.03, 0.03]
        mujoco.mj_kinematics(theirs, data)
        mujoco.mj_kinematics(ours, physics.data.ptr)
        shift = physics.data.xpos[our_ids] - data.xpos[their_ids]
        assert np.linalg.norm(shift, axis=1).max() < 1e-4
        # Chord of the angle between two rotations: |R - S|_F = 2 sqrt(2) sin(angle / 2).
        chord = np.linalg.norm(physics.data.xmat[our_ids] - data.xmat[their_ids], axis=1)
        assert np.degrees(chord / np.sqrt(2)).max() < 0.01


def test_masses_and_inertias_agree_with_menagerie(scene, menagerie):
    _, physics = scene
    theirs = mujoco.MjModel.from_xml_path(str(menagerie / "franka_emika_panda" / "panda.xml"))
    for name in [*LINKS, "hand", "left_finger"]:
        mine, other = physics.model.ptr.body(f"panda/{name}"), theirs.body(name)
        np.testing.assert_allclose(mine.mass, other.mass)
        np.testing.assert_allclose(inertia(mine), inertia(other), atol=1e-8)
        np.testing.assert_allclose(mine.ipos, other.ipos)


def inertia(body):
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, body.iquat)
    rotation = rotation.reshape(3, 3)
    return rotation @ np.diag(body.inertia) @ rotation.T


def test_numpy_forward_kinematics_agree_with_the_model(scene):
    panda, physics = scene
    for joints in random_configurations(200):
        panda.set_configuration(physics, joints, 0.02)
        expected = panda_kinematics.tcp_pose(joints)
        np.testing.assert_allclose(panda.tcp_pose(physics), expected, atol=1e-9)


def test_home_is_over_the_table_and_points_down():
    pose = panda_kinematics.tcp_pose(HOME)
    np.testing.assert_allclose(pose[:3, 3], [0.45, 0.0, 0.35], atol=1e-3)
    np.testing.assert_allclose(pose[:3, :3], np.diag([1.0, -1.0, -1.0]), atol=1e-3)


def test_holds_home_against_gravity():
    panda, physics = make_scene()
    panda.set_configuration(physics, HOME, 0.04)
    steps(physics, 2.0)
    joints, opening = panda.configuration(physics)
    np.testing.assert_allclose(joints, HOME, atol=5e-4)
    assert opening == pytest.approx(0.04, abs=1e-5)


def test_configuration_round_trip_and_limits(scene):
    panda, physics = scene
    joints = random_configurations(1)[0]
    panda.set_configuration(physics, joints, 0.05)
    got, opening = panda.configuration(physics)
    np.testing.assert_allclose(got, joints)
    assert opening == pytest.approx(0.05)
    with pytest.raises(ValueError, match="joint4 = 0.0000 rad"):
        panda.set_configuration(physics, np.zeros(7), 0.05)
    with pytest.raises(ValueError, match="opening"):
        panda.set_configuration(physics, HOME, 0.09)
    panda.apply_targets(physics, np.full(7, 10.0), 1.0)
    np.testing.assert_array_equal(physics.bind(panda.actuators).ctrl, POSITION_LIMITS[:, 1])
    assert physics.bind(panda.gripper_actuator).ctrl == MAX_OPENING


def test_closed_pads_meet_at_the_tcp(scene):
    panda, physics = scene
    panda.set_configuration(physics, HOME, 0.0)
    pads = physics.bind(panda.pad_geoms)
    np.testing.assert_allclose(np.mean(pads.xpos, 0), panda.tcp_pose(physics)[:3, 3], atol=1e-6)
    gap = np.linalg.norm(pads.xpos[0] - pads.xpos[1]) - 2 * pads.size[0, 1]
    assert gap == pytest.approx(0.0, abs=1e-9)


def test_gripper_opens_and_closes_at_the_speed_of_the_hand():
    panda, physics = make_scene()
    panda.set_configuration(physics, HOME, MAX_OPENING)
    panda.apply_targets(physics, HOME, 0.0)
    steps(physics, 0.4)
    assert panda.configuration(physics)[1] == pytest.approx(MAX_OPENING - 0.04, abs=0.002)
    steps(physics, 0.8)
    assert panda.configuration(physics)[1] < 1e-4


def test_the_arm_keeps_to_its_speed_limits_even_once_it_breaks_free():
    panda, physics = make_scene()
    panda.set_configuration(physics, HOME, MAX_OPENING)
    rng, model = np.random.default_rng(0), physics.model.ptr
    joints = physics.bind(panda.joints)
    loose = model.dof_damping.copy()
    for goal in rng.uniform(POSITION_LIMITS[:, 0], POSITION_LIMITS[:, 1], (6, 7)):
        model.dof_damping[:7] = 1e4  # as good as stuck
        for t in np.arange(0.0, 1.0, physics.timestep()):
            if t >= 0.3:
                model.dof_damping[:] = loose
            panda.follow_targets(physics, np.append(goal, MAX_OPENING))
            physics.step()
            tcp = np.zeros((3, model.nv))
            site = physics.bind(panda.tcp_site).element_id
            mujoco.mj_jacSite(model, physics.data.ptr, tcp, None, site)
            assert np.linalg.norm(tcp @ physics.data.qvel) < 1.1 * TCP_SPEED_LIMIT
            assert (np.abs(joints.qvel) < 1.15 * VELOCITY_LIMITS).all()


def test_motions_within_the_limits_are_passed_on_bit_for_bit():
    rng = np.random.default_rng(0)
    panda, physics = make_scene()
    panda.set_configuration(physics, HOME, MAX_OPENING)
    panda.apply_targets(physics, HOME, MAX_OPENING)
    target = np.append(HOME, MAX_OPENING)
    for _ in range(100):
        target[:7] += rng.uniform(-0.2, 0.2, 7) * VELOCITY_LIMITS * physics.timestep()
        panda.follow_targets(physics, target)
        np.testing.assert_array_equal(physics.bind(panda.actuators).ctrl, target[:7])
        physics.step()


def pad_contacts(panda, physics):
    """The normal force on each pad [N] and the deepest penetration [m] of the object."""
    pads = list(physics.bind(panda.pad_geoms).element_id)
    target = physics.model.name2id("object", "geom")
    forces, depth, wrench = np.zeros(2), 0.0, np.zeros(6)
    for i, contact in enumerate(physics.data.contact):
        pair = {contact.geom1, contact.geom2}
        for side, pad in enumerate(pads):
            if pair == {pad, target}:
                mujoco.mj_contactForce(physics.model.ptr, physics.data.ptr, i, wrench)
                forces[side] += wrench[0]
                depth = max(depth, -contact.dist)
    return forces, depth


def pose_in_tcp(panda, physics):
    world = np.eye(4)
    body = physics.named.data
    world[:3, :3], world[:3, 3] = body.xmat["object"].reshape(3, 3), body.xpos["object"]
    return np.linalg.inv(panda.tcp_pose(physics)) @ world


@pytest.mark.parametrize(
    ("shape", "size"), [("cylinder", (0.035, 0.03)), ("box", (0.025, 0.025, 0.025))]
)
def test_a_held_object_is_squeezed_with_70_newtons_and_does_not_slip(shape, size):
    panda, physics = make_scene(shape=shape, size=size, at=(0.45, 0.0, 0.30))
    panda.set_configuration(physics, LOW, MAX_OPENING)
    panda.apply_targets(physics, LOW, 0.0)
    gravity = physics.model.opt.gravity.copy()
    physics.model.opt.gravity[:] = 0.0  # nothing holds the object until the pads do
    steps(physics, 1.2)
    physics.model.opt.gravity[:] = gravity
    steps(physics, 0.2)
    forces, depth = pad_contacts(panda, physics)
    assert np.all((forces > 66.0) & (forces < 71.0))
    assert depth < 5e-4
    start = pose_in_tcp(panda, physics)
    height = panda.tcp_pose(physics)[2, 3]
    for t in np.arange(0.0, 5.0, physics.timestep()):
        panda.apply_targets(physics, LOW + min(1.0, t / 2.0) * (HIGH - LOW), 0.0)
        physics.step()
        if round(t / physics.timestep()) % 50 == 0:
            forces, depth = pad_contacts(panda, physics)
            assert np.all((forces > 66.0) & (forces < 71.0))
            assert depth < 5e-4
            drift = np.linalg.inv(start) @ pose_in_tcp(panda, physics)
            assert np.linalg.norm(drift[:3, 3]) < 1e-3
            assert np.degrees(np.arccos(np.clip((np.trace(drift) - 2) / 2, -1, 1))) < 1.0
    assert panda.tcp_pose(physics)[2, 3] - height > 0.19


def trajectory(visuals):
    panda, physics = make_scene(visuals, "box", (0.03, 0.03, 0.03), at=(0.45, 0.0, 0.33))
    panda.set_configuration(physics, HOME, 0.0)
    goal = HOME + np.array([0.5, 0.3, 0.2, 0.2, -0.3, 0.2, 0.4])
    panda.apply_targets(physics, goal, 0.0)
    positions, contacts = [], 0
    for _ in range(500):
        physics.step()
        positions.append(physics.data.qpos.copy())
        contacts += physics.data.ncon
    return np.array(positions), contacts, physics.model.nmesh


def test_meshes_leave_the_trajectory_bit_identical(menagerie, monkeypatch):
    monkeypatch.setenv("MENAGERIE_ROOT", str(menagerie))
    plain, contacts, meshes = trajectory("primitive")
    drawn, _, drawn_meshes = trajectory("menagerie")
    assert (meshes, drawn_meshes > 50, contacts > 0) == (0, True, True)
    assert np.array_equal(plain, drawn)


def test_visuals_ask_for_what_is_there(monkeypatch):
    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)
    monkeypatch.setattr("manipose_mj.mjcf.panda.menagerie._cached", lambda: None)
    assert picture_visuals() == "primitive"
    with pytest.raises(InputError, match="point MENAGERIE_ROOT at a folder"):
        Panda(visuals="menagerie")
    with pytest.raises(InputError, match="did you mean menagerie"):
        Panda(visuals="menagery")


def self_contacts(panda, physics, joints):
    panda.set_configuration(physics, joints, MAX_OPENING)
    physics.forward()
    return physics.data.ncon


def test_self_contacts_are_for_folded_arms_only(scene):
    panda, physics = scene
    assert self_contacts(panda, physics, HOME) == 0
    assert self_contacts(panda, physics, LOW) == 0
    assert self_contacts(panda, physics, np.array([0, 0, 0, -1.57, 0, 1.57, 0.785])) == 0
    assert self_contacts(panda, physics, np.array([0, 1.7, 0, -3.05, 0, 3.5, 0.0])) > 0
    folded = sum(self_contacts(panda, physics, q) > 0 for q in random_configurations(200))
    assert 2 <= folded <= 30  # Menagerie's meshes touch in 7 % of all configurations


def test_collision_covers_the_visual_meshes(menagerie):
    theirs = mujoco.MjModel.from_xml_path(str(menagerie / "franka_emika_panda" / "panda.xml"))
    rng = np.random.default_rng(0)
    for geom in np.flatnonzero(theirs.geom_group == 2):
        body, mesh = theirs.body(theirs.geom_bodyid[geom]).name, theirs.geom_dataid[geom]
        start, count = theirs.mesh_vertadr[mesh], theirs.mesh_vertnum[mesh]
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, theirs.geom_quat[geom])
        chosen = theirs.mesh_vert[start + rng.integers(count, size=min(count, 300))]
        points = chosen @ rotation.reshape(3, 3).T + theirs.geom_pos[geom]
        assert distance_to_cover(body, points).max() < 0.015, body


def distance_to_cover(body, points):
    boxes = panda_geometry.BOXES.get(body, [])
    if body.endswith("finger"):
        boxes = [*franka_hand.FINGER_BOXES, franka_hand.PAD_BOX]
    distances = []
    for ends, radius in panda_geometry.CAPSULES.get(body, []):
        a, b = np.array(ends[:3]), np.array(ends[3:])
        along = np.clip((points - a) @ (b - a) / np.sum((b - a) ** 2), 0.0, 1.0)
        distances.append(np.linalg.norm(points - a - along[:, None] * (b - a), axis=1) - radius)
    for low, high in boxes:
        distances.append(np.linalg.norm(points - np.clip(points, low, high), axis=1))
    return np.min(distances, axis=0)


def test_wrist_camera_sees_both_fingertips(scene):
    panda, physics = scene
    panda.set_configuration(physics, HOME, MAX_OPENING)
    camera = physics.bind(panda.wrist_camera)
    rotation = np.reshape(camera.xmat, (3, 3))
    visible = np.ones(6, np.uint8)
    for pad in panda.pad_geoms:
        point = np.array(physics.bind(pad).xpos)
        x, y, z = rotation.T @ (point - camera.xpos)
        assert max(abs(x), abs(y)) < -z * np.tan(np.radians(camera.fovy / 2))
        hit = np.array([-1], np.int32)
        mujoco.mj_ray(
            physics.model.ptr,
            physics.data.ptr,
            np.array(camera.xpos),
            point - camera.xpos,
            visible,
            1,
            -1,
            hit,
        )
        finger = physics.model.geom_bodyid[physics.bind(pad).element_id]
        assert physics.model.geom_bodyid[hit[0]] == finger


def test_observables_have_their_shapes(scene):
    panda, physics = scene
    panda.set_configuration(physics, HOME, 0.03)
    shapes = {
        "joint_positions": (7,),
        "joint_velocities": (7,),
        "joint_torques": (7,),
        "gripper_opening": (1,),
        "tcp_pose": (7,),
    }
    for name, shape in shapes.items():
        value = np.asarray(getattr(panda.observables, name).observation_callable(physics)())
        assert value.shape == shape, name
    pose = panda.observables.tcp_pose.observation_callable(physics)()
    np.testing.assert_allclose(pose, [0.45, 0, 0.35, 0, 1, 0, 0], atol=1e-3)


def test_contact_queries_name_only_colliding_geoms(scene):
    panda, physics = scene
    gripper, robot = panda.gripper_geom_ids(physics), panda.robot_geom_ids(physics)
    assert set(gripper) < set(robot)
    assert np.all(physics.model.geom_group[robot] == 3)
    assert set(robot) == set(np.flatnonzero(physics.model.geom_contype))
    assert GRIP_FORCE == 70.0
