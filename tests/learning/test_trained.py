"""Files of trained policies, and the policies that they hold."""

from __future__ import annotations

import hashlib
import json
import pickle

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.learning import TrainedPolicy, grip, handle_frame
from manipose_mj.learning.network import ActorCritic, NetworkConfig, Normaliser
from manipose_mj.learning.trained import Trained
from manipose_mj.policies import ActionSpace, Policy
from tests.learning.test_handle_frame import scene


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    features = handle_frame.features(scene()).shape[-1]
    config = NetworkConfig(features, grip.ACTIONS)
    network = ActorCritic(config, key=jax.random.key(1))
    wide = jax.tree.map(lambda leaf: 3 * leaf if isinstance(leaf, jax.Array) else leaf, network)
    normaliser = Normaliser.fresh(features).updated(jnp.ones((5, features)))
    trained = Trained(wide, normaliser, config, 5.0, "articulated/open_middle_drawer", 4)
    path = tmp_path_factory.mktemp("trained") / "policy.npz"
    trained.save(path)
    return path, trained


def space(mode: str = "pd_ee_pose", hz: float = 5.0) -> ActionSpace:
    return ActionSpace(np.full(7, -3.0), np.full(7, 3.0), mode, hz)


def test_a_policy_read_from_its_file_acts_as_before(file):
    path, trained = file
    policy = TrainedPolicy(str(path))
    assert isinstance(policy, Policy)
    assert policy.metadata == {
        "trained on": "articulated/open_middle_drawer",
        "seed": 4,
        "weights sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
    }
    policy.reset(task="", instruction="", seed=0, action_space=space())
    seen = {name: jnp.asarray(v, jnp.float32) for name, v in scene().items()}
    normal = trained.normaliser(handle_frame.features(seen))
    expected = handle_frame.command(seen, trained.network.mean(normal))
    one = {name: values[0] for name, values in scene().items()}
    found = policy.infer(one)["actions"]
    assert found.shape == (1, 7)
    np.testing.assert_allclose(found, expected, atol=5e-3)  # half precision
    np.testing.assert_allclose(found, policy.act(seen), atol=1e-6)
    assert path.stat().st_size < 2e6


def test_other_actions_or_observations_are_refused_in_one_line(file):
    policy = TrainedPolicy(str(file[0]))
    for wrong in (space("pd_joint_pos"), space(hz=10.0)):
        with pytest.raises(InputError, match="add --control-mode pd_ee_pose --hz 5"):
            policy.reset(task="", instruction="", seed=0, action_space=wrong)
    blind = {name: values[0] for name, values in scene().items() if "handle" not in name}
    with pytest.raises(InputError, match="pose/robot/handle; add --obs-mode state"):
        policy.infer(blind)


def test_what_is_no_trained_policy_is_refused_in_one_line(tmp_path):
    with pytest.raises(InputError, match="no trained policy"):
        TrainedPolicy(str(tmp_path / "nowhere.npz"))
    (tmp_path / "text.npz").write_text("text")
    with pytest.raises(InputError, match="no trained policy"):
        TrainedPolicy(str(tmp_path / "text.npz"))
    np.savez(tmp_path / "other.npz", header=np.zeros(3))
    with pytest.raises(InputError, match="no trained policy"):
        TrainedPolicy(str(tmp_path / "other.npz"))


@pytest.mark.parametrize("content", [b"", b"text", b"\x93NUMPY", pickle.dumps([1])])
def test_a_file_that_is_no_npz_is_told_without_advice_on_pickles(content, tmp_path):
    path = tmp_path / "policy.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"can be read from it \(it is no .npz file\)$"):
        Trained.load(path)


def test_a_file_of_other_things_than_numbers_is_told_without_advice_on_pickles(tmp_path):
    path = tmp_path / "policy.npz"
    np.savez(path, header=np.array([None]))
    with pytest.raises(InputError, match=r"holds others than arrays of numbers\)$"):
        Trained.load(path)


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("open_cabinet_dor", "unknown trained policy 'open_cabinet_dor'; did you mean open_cab"),
        ("xyz", "known: lift, open_cabinet_door, open_middle_drawer"),
        ("./xyz", r"xyz: no trained policy can be read from it \(No such file or directory\)"),
        (
            "xyz.npz",
            r"xyz.npz: no trained policy can be read from it \(No such file or directory\)",
        ),
    ],
)
def test_a_misspelt_policy_that_ships_is_told_with_those_that_do(path, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=said):
        TrainedPolicy(path)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda arrays, header: arrays.pop("leaf_1"), "lacks 'leaf_1'"),
        (lambda arrays, header: arrays.update(leaf_0=np.zeros(3)), "leaf_0 has shape"),
        (lambda arrays, header: header.pop("hz"), "lacks 'hz'"),
        (lambda arrays, header: header.update(frame="knob"), "unknown frame 'knob'"),
        (lambda arrays, header: header.update(format=9), "format 9; expected 1"),
    ],
)
def test_damaged_policies_are_refused_in_one_line(change, said, file, tmp_path):
    with np.load(file[0]) as stored:
        arrays = dict(stored)
    header = json.loads(bytes(arrays["header"]))
    change(arrays, header)
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
    np.savez(tmp_path / "damaged.npz", **arrays)
    with pytest.raises(InputError, match=said):
        TrainedPolicy(str(tmp_path / "damaged.npz"))
