"""Piles: at rest, in contact, the same whoever drops them; who lies on whom; what a hand can reach."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.assets import catalogue
from manipose_mj.errors import InputError
from manipose_mj.tasks.clutter.pile import Pile, settle
from manipose_mj.tasks.clutter.pile_cache import PileCache
from manipose_mj.tasks.clutter.pile_layout import Layout, PileConfig
from manipose_mj.tasks.clutter.pile_scene import PileScene

NAMES = (("box", 10), ("box", 16), ("chips_can", 0), ("drinkbox", 1), ("remote", 0), ("sausage", 0))
FEW: dict[Layout, tuple[int, int]] = {"heap": (3, 6), "stack": (3, 6), "cover": (4, 6)}


@pytest.fixture(scope="module")
def assets():
    return tuple(catalogue.load(*name) for name in NAMES)


@pytest.fixture(scope="module")
def piles(assets) -> dict[str, Pile]:
    return {layout: settle(assets, PileConfig(layout, FEW[layout]), 0) for layout in FEW}


@pytest.fixture(params=FEW)
def pile(request, piles) -> Pile:
    return piles[request.param]


def _scene(assets, pile: Pile) -> PileScene:
    """The pile put back where it lay, all of it fallen."""
    scene = PileScene([assets[i] for i in pile.objects], 1.0)
    for order, pose in enumerate(pile.poses):
        scene.drop(order, pose[:3, :3], np.zeros(2), 0.0, 0.0)
    scene.set_poses(pile.poses)
    scene.remove_walls()
    return scene


@pytest.mark.sample(1)
def test_a_pile_stays_as_it_is_and_nothing_sinks_in(assets, pile):
    scene = _scene(assets, pile)
    scene.run(1.0)
    moved = np.linalg.norm(scene.poses()[:, :3, 3] - pile.poses[:, :3, 3], axis=1)
    assert moved.max() < 1e-3
    assert scene.penetration() < 0.002


def test_a_pile_lies_on_the_table_about_its_middle(pile):
    assert (pile.poses[:, 2, 3] > 0).all()
    np.testing.assert_allclose(pile.poses[:, :2, 3].mean(axis=0), 0.0, atol=1e-9)
    assert pile.radius < 0.3
    assert len(set(pile.objects)) == len(pile.objects) >= 3


def test_in_a_stack_something_lies_on_the_first(piles):
    stack = piles["stack"]
    above = np.flatnonzero(stack.supports[:, 0])
    assert len(above) and not stack.uncovered[0]
    assert (stack.poses[above, 2, 3] > stack.poses[0, 2, 3]).all()


def test_the_first_of_a_cover_is_hidden_from_everywhere(assets, piles):
    cover = piles["cover"]
    scene = _scene(assets, cover)
    scene.supports()  # brings positions up to date
    assert scene.most_seen(0, 1.0) <= 0.4
    top = int(np.argmax(cover.poses[:, 2, 3]))
    assert scene.most_seen(top, 1.0) > 0.9


def test_nothing_supports_itself_or_what_supports_it(pile):
    assert not pile.supports.diagonal().any()
    assert pile.uncovered.any()


def test_an_object_alone_is_free_to_take_and_a_neighbour_takes_grasps_away(assets):
    can, box = assets[2], assets[0]
    alone = PileScene([can], 1.0)
    rest = can.stable_poses[0]
    alone.drop(0, rest.rotation, np.zeros(2), 0.0, 0.0)
    pose = rest.pose
    alone.set_poses(pose[None])
    free = ~alone.grasp_obstacles()[0].any(axis=1)
    # The annotation's own judgement of the plane, with another margin.
    clear = can.grasps.clear[:, 0].astype(bool)
    assert free.sum() >= 20 and (free & ~clear).sum() <= 0.05 * free.sum()
    crowded = PileScene([can, box], 1.0)
    for order in (0, 1):
        crowded.drop(order, rest.rotation, np.zeros(2), 0.0, 0.0)
    above = box.stable_poses[0].pose
    above[2, 3] += 0.08
    crowded.set_poses(np.stack([pose, above]))
    obstacles = crowded.grasp_obstacles()[0]
    assert not obstacles[free][:, 0].any()
    np.testing.assert_array_equal(~obstacles[:, -1], free)
    assert 0 < (~obstacles.any(axis=1)).sum() < free.sum()


def test_the_same_seed_gives_the_same_bits_warm_or_cold(assets, piles, tmp_path, monkeypatch):
    monkeypatch.setenv("MANIPOSE_CACHE", str(tmp_path))
    config = PileConfig("heap", FEW["heap"])
    cold, warm = PileCache(assets, config), PileCache(assets, config)
    first, second = cold.pile(0), warm.pile(0)
    assert len(list(tmp_path.rglob("*.npz"))) == 1
    for name, value in vars(piles["heap"]).items():
        np.testing.assert_array_equal(getattr(first, name), value)
        np.testing.assert_array_equal(getattr(second, name), value)


def test_a_damaged_file_is_dropped_anew(assets, piles, tmp_path, monkeypatch, caplog):
    monkeypatch.setenv("MANIPOSE_CACHE", str(tmp_path))
    config = PileConfig("heap", FEW["heap"])
    PileCache(assets, config).pile(0)
    (path,) = tmp_path.rglob("*.npz")
    path.write_bytes(b"PK\x03\x04 not a pile")
    again = PileCache(assets, config).pile(0)
    np.testing.assert_array_equal(again.poses, piles["heap"].poses)
    assert "damaged" in caplog.text


def test_other_seeds_objects_and_configurations_have_other_piles(assets, tmp_path, monkeypatch):
    monkeypatch.setenv("MANIPOSE_CACHE", str(tmp_path))
    config = PileConfig("heap", (2, 3))
    PileCache(assets, config).pile(0)
    PileCache(assets[:4], config).pile(0)
    PileCache(assets, PileConfig("heap", (2, 4))).pile(0)
    assert len({path.parent for path in tmp_path.rglob("*.npz")}) == 3


def test_impossible_piles_are_refused(assets):
    with pytest.raises(InputError, match="pile count"):
        PileConfig(count=(5, 3))
    with pytest.raises(InputError, match="comes to rest within"):
        settle(assets[:2], PileConfig(count=(3, 3)), 0)
