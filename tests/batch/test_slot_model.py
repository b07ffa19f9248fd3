"""The model with slots, filled as a scene fills it, is that scene: checked by MuJoCo itself."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from manipose_mj.batch.drawing import draw_pool
from manipose_mj.batch.row_fields import RowFields, _fields_of
from manipose_mj.batch.slot_model import slot_model
from manipose_mj.batch.starts import RowModels
from manipose_mj.errors import InputError
from manipose_mj.tasks.core.config import EnvConfig

OBJECTS = ("mug_000", "box_000", "chips_can_000")
TASK = "single_object/target_pose"


@pytest.fixture(scope="module")
def pool():
    drawn = draw_pool(EnvConfig(TASK, objects=OBJECTS, obs_mode="state"), range(8))
    assert len(drawn.scenes) == len(OBJECTS)
    for scene in drawn.scenes:
        scene.opt.impratio = 70.0  # not what the XML says
    return drawn


def of_row(fields: RowFields, row: int) -> mujoco.MjModel:
    """The model with slots as a start fills it, without what C MuJoCo alone keeps from when it was compiled."""
    model = mujoco.MjModel.__copy__(fields.model)
    model.geom_sameframe[:] = model.body_sameframe[:] = 0
    model.body_simple[model.body_dofnum == 1] = 0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
    for name, table in fields.fields.items():
        values = table[row]
        if name == "geom_dataid":
            # It knows no absent meshes.
            empty = (values < 0) & (model.geom_type == int(mujoco.mjtGeom.mjGEOM_MESH))
            model.geom_contype[empty] = model.geom_conaffinity[empty] = 0
            values = np.where(empty, model.geom_dataid, values)
        getattr(model, name)[:] = values
    return model


def stepped(model: mujoco.MjModel, state: dict[str, np.ndarray], steps: int) -> mujoco.MjData:
    data = mujoco.MjData(model)
    for name, values in state.items():
        getattr(data, name)[:] = values
    data.qpos[-5] += 0.002  # the object falls by 2 mm
    mujoco.mj_step(model, data, steps)
    return data


def test_every_start_moves_as_in_its_own_scene(pool):
    fields, models = RowFields(pool), RowModels(pool)
    seen = set()
    for row, start in enumerate(pool.starts):
        if start.object_name in seen:
            continue
        seen.add(start.object_name)
        scene = mujoco.MjModel.__copy__(models.at(row))
        scene.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        state = {name: table[row] for name, table in fields.states.items()}
        own, slots = (stepped(m, state, 60) for m in (scene, of_row(fields, row)))
        assert own.ncon > 0 and slots.ncon > 0
        np.testing.assert_allclose(slots.qpos, own.qpos, rtol=0, atol=2e-4)
        named = set(start.addresses.owners) | {3}
        assert set(fields.owners[row]) == named
    assert seen == set(OBJECTS)


def test_slots_keep_the_options_of_the_scenes(pool):
    model = slot_model(pool).model
    assert model.opt.impratio == 70.0
    assert model.opt.cone == pool.scenes[0].opt.cone


def test_starts_of_one_object_have_its_shape_in_every_world(pool):
    name = pool.starts[-1].object_name
    one = replace(pool, starts=tuple(s for s in pool.starts if s.object_name == name))
    both = RowFields(pool)
    row = next(i for i, s in enumerate(pool.starts) if s.object_name == name)
    alone = of_row(RowFields(one), 0)
    expected = of_row(both, row)
    for field in ("geom_dataid", "geom_size", "geom_pos", "geom_margin", "body_mass"):
        np.testing.assert_array_equal(getattr(alone, field), getattr(expected, field))


def test_scenes_that_differ_in_more_than_objects_and_furniture_are_refused(pool):
    text = pool.xml.replace("</worldbody>", '<camera name="another"/></worldbody>')
    other = mujoco.MjSpec.from_string(text, assets=pool.xml_assets).compile()
    with pytest.raises(InputError, match="differ in ncam"):
        slot_model(replace(pool, scenes=(*pool.scenes, other)))


@pytest.fixture(scope="module")
def cabinets():
    """One with three drawers and a door, one with five drawers, one with three drawers and two doors."""
    names = ("cabinet_018", "cabinet_010", "cabinet_012")
    drawn = draw_pool(
        EnvConfig("articulated/open_middle_drawer", objects=names, obs_mode="state"), range(8)
    )
    assert len(drawn.scenes) == len(names)
    assert len({scene.nv for scene in drawn.scenes}) > 1
    return drawn


def test_drawers_and_doors_move_as_in_their_own_scene(cabinets):
    fields, models = RowFields(cabinets), RowModels(cabinets)
    for row, start in enumerate(cabinets.starts):
        places = slot_model(cabinets).places[start.scene]
        scene = mujoco.MjModel.__copy__(models.at(row))
        scene.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        common = of_row(fields, row)
        own, slots = mujoco.MjData(scene), mujoco.MjData(common)
        slots.qpos[:], slots.ctrl[:] = fields.states["qpos"][row], fields.states["ctrl"][row]
        own.qpos[places.angles[places.angles >= 0]] = slots.qpos[places.angles >= 0]
        own.ctrl[:] = slots.ctrl
        slots.qvel[9:] = np.where(places.dofs[9:] >= 0, 1.0, 0.0)  # all of them fly open
        own.qvel[9:] = 1.0
        mujoco.mj_step(scene, own, 100)
        mujoco.mj_step(common, slots, 100)
        present = places.angles >= 0
        np.testing.assert_allclose(
            slots.qpos[present], own.qpos[places.angles[present]], rtol=0, atol=1e-9
        )
        assert (slots.qpos[~present] == 0).all()
        assert own.qpos[9:].min() > 0.01


def test_an_object_that_a_scene_lacks_stays_where_it_is(pool):
    """A second free body, which the first scene alone has."""
    first = pool.scenes[0]
    text = pool.xml.replace(
        "</worldbody>",
        '<body name="more" pos="0 0 9"><freejoint/><geom size="0.1" mass="1"/></body></worldbody>',
    )
    more = mujoco.MjSpec.from_string(text, assets=pool.xml_assets).compile()
    found = slot_model(replace(pool, scenes=(more, *pool.scenes[1:]), xml=text))
    assert found.model.nq == first.nq + 7
    body = found.model.body("more").id
    assert found.places[0].bodies[body] > 0 > found.places[1].bodies[body]
    fields = _fields_of(
        pool.scenes[1],
        {
            "body": found.places[1].bodies,
            "jnt": found.places[1].joints,
            "dof": found.places[1].dofs,
            "geom": found.geoms[1],
        },
        found.model,
    )
    model = mujoco.MjModel.__copy__(found.model)
    model.body_gravcomp[:] = fields["body_gravcomp"]
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 20)
    assert data.xpos[body, 2] == 9


def test_geoms_that_never_move_are_where_their_scene_has_them(cabinets):
    """MuJoCo Warp is told where they are: it does not place them itself."""
    fields = RowFields(cabinets)
    for row in range(len(cabinets.starts)):
        model = of_row(fields, row)
        data = mujoco.MjData(model)
        data.qpos[:] = fields.states["qpos"][row]
        mujoco.mj_kinematics(model, data)
        static = model.body_weldid[model.geom_bodyid] == 0
        for name, table in fields.static.items():
            np.testing.assert_allclose(
                table[row][static], getattr(data, name)[static], rtol=0, atol=1e-9
            )


def test_measurements_are_taken_from_the_part_in_question(cabinets):
    fields = RowFields(cabinets)
    for row, start in enumerate(cabinets.starts):
        data = mujoco.MjData(of_row(fields, row))
        data.qpos[:] = fields.states["qpos"][row]
        mujoco.mj_kinematics(of_row(fields, row), data)
        found = data.xpos[fields.addresses["bodies"][row]]
        np.testing.assert_allclose(found, start.measurement.positions, rtol=0, atol=1e-9)
        assert data.qpos[fields.addresses["openings"][row]] == start.measurement.openings
