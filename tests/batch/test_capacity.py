"""How much room a probe says contacts take: nothing is left out, and it is not guessed from the starts alone."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from manipose_mj.batch import Capacity, capacity
from manipose_mj.batch.capacity import Peaks, kept_probe, near_pairs, probe, touching_pairs
from manipose_mj.batch.drawing import draw_pool
from manipose_mj.batch.starts import RowModels, awake
from manipose_mj.errors import InputError
from manipose_mj.tasks.core.config import EnvConfig
from manipose_mj.tasks.core.simulation_state import unflatten, write_simulation


@pytest.fixture(scope="module")
def boxes():
    return draw_pool(EnvConfig("single_object/target_pose", objects=("box_000",)), range(3))


@pytest.fixture(scope="module")
def peaks(boxes):
    return probe(boxes)


def at_start(pool, row: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = RowModels(pool).at(row)
    data = mujoco.MjData(model)
    write_simulation(model, data, unflatten(model, data, pool.starts[row].simulation))
    return model, data


def test_the_same_pool_has_the_same_peaks(boxes, peaks):
    again = probe(boxes)
    np.testing.assert_array_equal(again.contacts, peaks.contacts)
    np.testing.assert_array_equal(again.constraints, peaks.constraints)


def test_a_pool_is_probed_once(boxes, peaks, monkeypatch, tmp_path, caplog):
    monkeypatch.setenv("MANIPOSE_CACHE", str(tmp_path))
    probed = []

    def counted(pool):
        probed.append(pool)
        return peaks

    monkeypatch.setattr(capacity, "probe", counted)
    first, again = kept_probe(boxes), kept_probe(boxes)
    assert len(probed) == 1
    for found in (first, again):
        assert found.capacity(100) == peaks.capacity(100)
    harder = replace(boxes, scenes=tuple(awake(scene) for scene in boxes.scenes))
    harder.scenes[0].opt.impratio *= 2
    kept_probe(harder)
    assert len(probed) == 2
    files = sorted((tmp_path / "probes").iterdir())
    assert len(files) == 2
    for file in files:
        file.write_text('{"contacts": [1')  # as a full disk leaves it
    assert kept_probe(boxes).capacity(100) == peaks.capacity(100)
    assert len(probed) == 3
    (tmp_path / "a_file").touch()
    monkeypatch.setenv("MANIPOSE_CACHE", str(tmp_path / "a_file"))
    assert kept_probe(boxes).capacity(100) == peaks.capacity(100)
    assert "peaks of contacts are not kept" in caplog.text


def test_hands_touch_what_they_do_not_at_the_start(boxes, peaks):
    first = [at_start(boxes, row)[1] for row in range(len(boxes.starts))]
    assert peaks.contacts.min() > max(data.ncon for data in first)
    # Four contacts of a box with the table have 16 rows; those with pads have some too.
    assert peaks.constraints.min() >= max(data.nefc for data in first) + 4


def test_a_moment_between_control_steps_counts():
    """A mug that is tipped touches the table with many of its convex parts for an instant."""
    mugs = draw_pool(EnvConfig("single_object/target_pose", objects=("mug_000",)), range(1, 2))
    peaks, (_, data) = probe(mugs), at_start(mugs, 0)
    assert peaks.contacts[0] > 2 * data.ncon + 24
    assert peaks.constraints[0] > 2 * data.nefc + 192


def test_one_world_can_be_the_worst_and_many_are_as_the_average():
    peaks = Peaks(np.array([10, 10, 10, 90]), np.array([40, 40, 40, 400]))
    assert peaks.capacity(1) == Capacity(1.5 * 90 + 16, 696)
    many = peaks.capacity(10_000)
    assert 1.5 * 30 + 16 < many.contacts < 1.5 * 31 + 16
    assert many.constraints == 696  # rows are not shared


def test_two_drawers_that_jam_have_room():
    """A part that is pushed askew meets its frame in many places; the probe's hands need not have done so."""
    objects = ("cabinet_000", "chips_can_000")
    config = EnvConfig("articulated/store_chips_can_middle_drawer", objects=objects)
    pool = draw_pool(config, range(1))
    peaks = probe(pool)
    assert peaks.parts == 4
    rng, most = np.random.default_rng(0), 0
    for _ in range(20):
        model, data = at_start(pool, 0)
        drawers = [i for i in range(model.nbody) if model.body(i).name.endswith("_drawer")]
        pushed = rng.choice(drawers, 2, replace=False)
        data.xfrc_applied[pushed] = rng.normal(size=(2, 6)) * [300, 300, 300, 60, 60, 60]
        for _ in range(40):
            mujoco.mj_step(model, data)
            most = max(most, data.nefc)
    assert peaks.constraints.max() < most < peaks.capacity(8192).constraints


def test_room_for_nothing_is_refused():
    with pytest.raises(InputError, match="contacts is 0"):
        Capacity(0, 100)
    with pytest.raises(InputError, match="constraints is -1"):
        Capacity(10, -1)


def test_all_that_touches_is_a_pair_that_can_and_near(boxes):
    model, data = at_start(boxes, 0)
    allowed, rng, seen = touching_pairs(model), np.random.default_rng(0), 0
    for _ in range(40):
        data.qpos[:] = model.qpos0
        data.qpos[:9] += rng.normal(0, 0.6, 9)
        data.qpos[-7:-4] = rng.uniform([0.2, -0.3, 0.0], [0.7, 0.3, 0.3])
        data.qpos[-4:] = rng.normal(size=4)
        mujoco.mj_forward(model, data)
        touching = {tuple(sorted(pair)) for pair in data.contact.geom.tolist()}
        assert touching <= {tuple(sorted(pair)) for pair in allowed.tolist()}
        assert near_pairs(model, data, allowed) >= len(touching)
        seen += len(touching)
    assert seen > 40
