"""Steps with few kernels against MuJoCo Warp's own; on Warp's CPU device where there is no GPU, if the libraries are there."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

mjw = pytest.importorskip("mujoco_warp", reason='needs pip install -e ".[gpu]"')
wp = pytest.importorskip("warp", reason='needs pip install -e ".[gpu]"')

from manipose_mj.warp_physics.stepping import Stepper  # noqa: E402
from tests.warp_physics.paired_worlds import WORLDS, Pair  # noqa: E402

pytestmark = pytest.mark.full  # it compiles for half a minute
# An arm with friction, limits and a tendon, and free bodies whose contacts have 3, 4 and 6 rows.
SCENE = """
<mujoco>
  <option timestep="0.002" cone="{cone}" impratio="{impratio}" integrator="{integrator}"/>
  <worldbody>
    <geom type="plane" size="2 2 .1"/>
    <body pos="0 0 .1"><freejoint/><geom type="box" size=".05 .03 .02" condim="4" friction="1 .02 .001"/></body>
    <body pos=".02 .01 .2">
      <freejoint/><geom type="capsule" size=".03 .05" condim="6" friction=".6 .01 .001"/>
    </body>
    <body pos=".3 0 .3">
      <joint name="shoulder" type="hinge" axis="0 1 0" range="-.3 .3" limited="true" frictionloss=".2"/>
      <geom type="capsule" fromto="0 0 0 -.35 0 -.1" size=".02" condim="3"/>
      <body pos="-.35 0 -.1">
        <joint name="elbow" type="hinge" axis="0 1 0" damping=".1" frictionloss=".05"/>
        <geom type="capsule" fromto="0 0 0 0 0 -.25" size=".02"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <fixed name="both" armature="{armature}" frictionloss=".02" limited="true" range="-.4 .4">
      <joint joint="shoulder" coef="1"/><joint joint="elbow" coef="-.5"/>
    </fixed>
  </tendon>
  <equality><joint joint1="shoulder" joint2="elbow" polycoef="0 .1 0 0 0" active="{equality}"/></equality>
  <actuator><position tendon="both" kp="3" kv=".2"/></actuator>
</mujoco>
"""
BOX = '<body pos="{x} {y} {z}"><freejoint/><geom type="box" size=".05 .04 .03" condim="{rows}"/></body>'


def scene(**options):
    usual = {"cone": "elliptic", "impratio": 100.0, "integrator": "implicitfast"}
    usual |= {"equality": "false", "armature": 0.0}
    return mujoco.MjModel.from_xml_string(SCENE.format(**usual | options))


def spheres(margin=0.0):
    """Two 2 cm apart, one of which a pair with margins of its own joins to a third."""
    ball = (
        '<body pos="{x} 0 1"><freejoint/><geom name="{name}" size=".05" margin="{margin}"/></body>'
    )
    balls = "".join(ball.format(x=0.12 * i, name=f"ball_{i}", margin=margin) for i in range(3))
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><geom type="plane" size="2 2 .1"/>{balls}</worldbody>'
        '<contact><pair geom1="ball_1" geom2="ball_2" margin=".03"/></contact></mujoco>'
    )


def heap():
    """Five boxes on one another: more rows than a warp has lanes."""
    places = [(0, 0, 0.03), (0.02, 0, 0.09), (0, 0.01, 0.15), (0.2, 0, 0.03), (0.1, 0, 0.21)]
    boxes = "".join(
        BOX.format(x=x, y=y, z=z, rows=(3, 4, 6)[i % 3]) for i, (x, y, z) in enumerate(places)
    )
    return mujoco.MjModel.from_xml_string(
        '<mujoco><option timestep=".002" cone="elliptic" impratio="10"/>'
        f'<worldbody><geom type="plane" size="2 2 .1"/>{boxes}</worldbody></mujoco>'
    )


def objective(model, data, world, acceleration):
    """What accelerations minimise, by MuJoCo's documentation ("Computation"), in 64 bits; rows are `data`'s."""
    count, nv, a = data.nefc.numpy()[world], model.nv, acceleration.astype(float)
    inertia, packed = np.zeros((nv, nv)), data.M.numpy()[world]
    for i in range(nv):
        begin, length = model.M_rowadr.numpy()[i], model.M_rownnz.numpy()[i]
        columns = model.M_colind.numpy()[begin : begin + length]
        inertia[i, columns] = inertia[columns, i] = packed[begin : begin + length]
    efc = data.efc
    stiff, loss, kinds = (
        array.numpy()[world, :count].astype(float) for array in (efc.D, efc.frictionloss, efc.type)
    )
    x = efc.J.numpy()[world, :count, :nv].astype(float) @ a - efc.aref.numpy()[world, :count]
    total = 0.5 * a @ inertia @ a - a @ data.qfrc_smooth.numpy()[world]
    equalities = data.ne.numpy()[world]
    frictions = equalities + data.nf.numpy()[world]
    cones = kinds == int(mujoco.mjtConstraint.mjCNSTR_CONTACT_ELLIPTIC)
    springs = 0.5 * stiff * x**2
    total += springs[:equalities].sum()
    for r in range(equalities, frictions):
        reach = loss[r] / stiff[r]
        inside = abs(x[r]) <= reach
        total += springs[r] if inside else loss[r] * (abs(x[r]) - 0.5 * reach)
    others = np.arange(count) >= frictions
    total += springs[others & ~cones & (x < 0)].sum()
    impratio = float(model.opt.impratio_invsqrt.numpy()[0])
    for contact in np.unique(efc.id.numpy()[world, :count][cones]):
        rows = data.contact.dim.numpy()[contact]
        first = data.contact.efc_address.numpy()[contact, 0]
        friction = data.contact.friction.numpy()[contact].astype(float)[: rows - 1]
        mu = friction[0] * impratio
        normal = mu * x[first]
        tangent = np.linalg.norm(friction * x[first + 1 : first + rows])
        if normal >= mu * tangent:
            continue
        if mu * normal + tangent <= 0.0:
            total += springs[first : first + rows].sum()
        else:
            total += 0.5 * stiff[first] / (mu**2 * (1 + mu**2)) * (normal - mu * tangent) ** 2
    return total, np.trace(inertia)


@pytest.mark.parametrize(
    "host",
    [
        scene(),
        scene(impratio=1.0, integrator="Euler", equality="true"),
        scene(cone="pyramidal", impratio=1.0),
        scene(armature=0.05),
        heap(),
    ],
    ids=["elliptic", "equality", "pyramids", "armature", "heap"],
)
def test_worlds_are_stepped_as_by_mujoco_warp(host):
    pair = Pair(host)
    assert pair.stepper.fused
    rows, iterations = 0, 0
    tolerance = float(pair.model.opt.tolerance.numpy()[0])
    for step in range(150):
        pair.step()
        rows = max(rows, pair.ours.nefc.numpy().max())
        iterations = max(iterations, pair.ours.solver_niter.numpy().max())
        assert pair.apart("qvel") < 1e-3
        assert pair.apart("qfrc_constraint") < 1e-2
        assert pair.apart("qfrc_bias") < 1e-4
        assert (pair.ours.nacon.numpy() == pair.theirs.nacon.numpy()).all()
        for world in range(WORLDS if step % 5 == 0 else 0):
            expected, found = (
                objective(pair.model, pair.theirs, world, data.qacc.numpy()[world])
                for data in (pair.theirs, pair.ours)
            )
            # Both stop where less than the tolerance is to be gained; theirs may be the better one by that.
            assert found[0] <= expected[0] + 2.0 * tolerance * found[1]
    assert rows > 12 and iterations > 2
    assert not pair.ours.overflow.numpy().any()


def test_a_heap_has_more_rows_than_lanes():
    pair = Pair(heap())
    for _ in range(150):
        pair.step()
    assert pair.ours.nefc.numpy().max() > 64


def test_forces_and_states_of_rows_are_told():
    pair = Pair(scene())
    for _ in range(150):
        pair.step()
    counts = pair.theirs.nefc.numpy()
    for world, count in enumerate(counts):
        # Rows of contacts may stand in another order.
        expected, found = (
            np.sort(data.efc.force.numpy()[world, :count]) for data in (pair.theirs, pair.ours)
        )
        np.testing.assert_allclose(found, expected, atol=2e-3)
        states = [
            np.sort(data.efc.state.numpy()[world, :count]) for data in (pair.theirs, pair.ours)
        ]
        assert (states[0] == states[1]).all()
    assert pair.apart("qfrc_smooth") < 1e-5


def test_a_world_without_constraints_falls():
    box = BOX.format(x=0, y=0, z=1, rows=3)
    host = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><geom type="plane" size="2 2 .1"/>{box}</worldbody></mujoco>'
    )
    pair = Pair(host, worlds=2)
    pair.step()
    assert pair.stepper.fused and not pair.ours.nefc.numpy().any()
    assert pair.ours.qacc.numpy()[:, 2] == pytest.approx(-9.81, abs=1e-4)
    assert pair.apart("qacc") < 1e-5


def test_margins_are_those_of_now():
    pair = Pair(spheres(), worlds=2, speed=0.0)
    pair.step()
    assert (
        pair.ours.nacon.numpy() == pair.theirs.nacon.numpy() == [2]
    )  # the named pair of two worlds
    pair.model.geom_margin.assign(np.full(pair.model.geom_margin.shape, 0.03, np.float32))
    pair.step()
    assert pair.ours.nacon.numpy() == pair.theirs.nacon.numpy() == [4]
    pair = Pair(spheres(margin=0.015), worlds=2, speed=0.0)
    pair.step()
    assert pair.ours.nacon.numpy() == pair.theirs.nacon.numpy() == [4]


def test_worlds_have_masses_sizes_and_tolerances_of_their_own():
    factors = np.linspace(0.5, 2.0, WORLDS, dtype=np.float32)

    def prepare(model):
        for name in ("body_mass", "body_subtreemass", "body_inertia", "geom_size", "geom_rbound"):
            values = getattr(model, name).numpy()
            scaled = values * factors.reshape(-1, *[1] * (values.ndim - 1))
            setattr(model, name, wp.array(scaled, dtype=getattr(model, name).dtype))
        model.opt.tolerance = wp.array(np.geomspace(1e-6, 1e6, WORLDS), dtype=float)

    pair = Pair(scene(), prepare=prepare)
    for _ in range(60):
        pair.step()
        assert (pair.ours.nacon.numpy() == pair.theirs.nacon.numpy()).all()
        assert pair.apart("subtree_com") < 1e-5 and pair.apart("qfrc_bias") < 1e-4
    precise = pair.ours.qacc.numpy()[:2], pair.theirs.qacc.numpy()[:2]
    np.testing.assert_allclose(*precise, rtol=0, atol=0.5)
    # The last world's tolerance is met before a step.
    assert pair.ours.solver_niter.numpy()[-1] == 0 < pair.ours.solver_niter.numpy()[0]


def test_the_warm_start_can_be_left_out():
    warm, cold = Pair(scene()), Pair(scene())
    cold.model.opt.disableflags |= int(mjw.DisableBit.WARMSTART)
    taken = [0, 0]
    for _ in range(60):
        for i, pair in enumerate((warm, cold)):
            pair.step()
            taken[i] += pair.ours.solver_niter.numpy().sum()
    assert cold.apart("qvel") < 1e-3
    assert taken[1] > 1.2 * taken[0]


@pytest.mark.parametrize("njmax", [14, 20])
def test_rows_without_room_are_told_and_harm_nothing(njmax):
    pair = Pair(scene(), njmax=njmax)
    flagged, cut = np.zeros(WORLDS, int), 0
    for _ in range(60):
        pair.step()
        assert (pair.ours.nefc.numpy() == pair.theirs.nefc.numpy()).all()
        flagged |= pair.ours.overflow.numpy() & int(mjw.OverflowType.NEFC)
        lacking = pair.ours.nefc.numpy() > njmax
        assert ((pair.ours.overflow.numpy() & int(mjw.OverflowType.NEFC)) > 0)[lacking].all()
        assert np.isfinite(pair.ours.qacc.numpy()).all()
        cut += cut_rows_push_nothing(pair.ours, njmax)
        # MuJoCo Warp's may be no numbers.
        for name in ("qpos", "qvel", "qacc_warmstart"):
            getattr(pair.theirs, name).assign(getattr(pair.ours, name).numpy())
    assert flagged.any() and cut


def cut_rows_push_nothing(data, njmax):
    """Checks the rows of contacts that there was no room for all of; how many they are."""
    contacts, found = data.nacon.numpy()[0], 0
    first, rows = (
        data.contact.efc_address.numpy()[:contacts, 0],
        data.contact.dim.numpy()[:contacts],
    )
    for contact in np.flatnonzero((first >= 0) & (first + rows > njmax)):
        world = data.contact.worldid.numpy()[contact]
        assert not data.efc.force.numpy()[world, first[contact] : njmax].any()
        found += 1
    return found


def sensing(model):
    model.nsensordata = 1


def optioned(**values):
    def change(model):
        for name, value in values.items():
            setattr(model.opt, name, value)

    return change


@pytest.mark.parametrize(
    "prepare",
    [
        sensing,
        lambda model: setattr(model.callback, "control", lambda *_: None),
        optioned(solver=mjw.SolverType.CG),
        optioned(integrator=mjw.IntegratorType.RK4),
        optioned(noslip_iterations=3),
        optioned(enableflags=int(mjw.EnableBit.ENERGY)),
        optioned(disableflags=int(mjw.DisableBit.CONTACT)),
        optioned(broadphase=mjw.BroadphaseType.SAP_TILE),
    ],
    ids=["sensor", "callback", "cg", "rk4", "noslip", "energy", "no contacts", "sap"],
)
def test_what_steps_leave_out_is_left_to_mujoco_warp(prepare):
    model = mjw.put_model(scene())
    data = mjw.make_data(scene(), nworld=1, naconmax=40, njmax=100)
    assert Stepper(model, data).fused
    prepare(model)
    assert not Stepper(model, data).fused


def test_a_force_that_is_no_number_makes_the_state_none():
    for flags in (0, int(mjw.DisableBit.WARMSTART)):
        pair = Pair(scene())
        pair.model.opt.disableflags |= flags
        for _ in range(40):
            pair.step()
        force = np.zeros(pair.theirs.qfrc_applied.shape, np.float32)
        force[3, 0] = np.nan
        pair.theirs.qfrc_applied.assign(force)
        pair.step()
        broken = np.isnan(pair.ours.qvel.numpy()).any(axis=1)
        assert broken.tolist() == [world == 3 for world in range(WORLDS)]


def test_a_world_that_is_no_number_spares_the_others_and_ends():
    pair = Pair(scene())
    for _ in range(40):
        pair.step()
    broken = pair.theirs.qvel.numpy().copy()
    broken[3, 0] = np.nan
    pair.theirs.qvel.assign(broken)
    pair.step()
    found = pair.ours.qacc.numpy()
    assert np.isnan(found[3]).any()
    sound = np.arange(WORLDS) != 3
    assert np.isfinite(found[sound]).all()
    np.testing.assert_allclose(found[sound], pair.theirs.qacc.numpy()[sound], rtol=0, atol=1.0)


def test_limits_of_iterations_are_told():
    pair = Pair(scene())
    for _ in range(60):
        pair.step()
    pair.model.opt.iterations = 1
    pair.theirs.qvel.assign(pair.theirs.qvel.numpy() + np.float32(0.5))
    pair.step()
    flagged = pair.ours.overflow.numpy() & int(mjw.OverflowType.ITERATIONS)
    assert flagged.any()
    assert (pair.ours.solver_niter.numpy() <= 1).all()


def test_what_the_kernels_cannot_do_is_left_to_mujoco_warp():
    boxes = "".join(BOX.format(x=0.2 * i, y=0, z=0.03, rows=3) for i in range(6))
    large = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><geom type="plane" size="2 2 .1"/>{boxes}</worldbody></mujoco>'
    )
    pair = Pair(large, worlds=2)
    assert not pair.stepper.fused
    for _ in range(5):
        pair.step()
    assert pair.apart("qvel") < 1e-5
