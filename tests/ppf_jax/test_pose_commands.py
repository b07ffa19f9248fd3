"""The pose commands name what is wrong, and their parts fit together."""

from __future__ import annotations

import dataclasses
import json
from importlib import resources
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from manipose_mj.cli.main import main
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup
from manipose_mj.ppf_jax.articulated.model import ArticulatedConfig
from manipose_mj.ppf_jax.articulated_estimator import ArticulatedEstimator
from manipose_mj.ppf_jax.data.articulated import cache
from manipose_mj.ppf_jax.estimator import PoseEstimate, PoseEstimator
from manipose_mj.ppf_jax.evaluation import part_evaluation
from manipose_mj.ppf_jax.evaluation.part_metrics import PartErrors
from manipose_mj.ppf_jax.evaluation.pose_predictions import categories_of, predict
from manipose_mj.ppf_jax.points.clouds import LabelledCloud
from manipose_mj.ppf_jax.training.articulated_losses import ArticulatedLoss
from manipose_mj.ppf_jax.training.curve_picture import draw_curve
from manipose_mj.ppf_jax.training.loop import TrainingConfig
from manipose_mj.ppf_jax.training.methods import METHODS
from manipose_mj.ppf_jax.training.saved_state import STATE_FILE
from tests.ppf_jax.catalogue_assets import write_asset

CUP, BOWL, AXIAL, FURNITURE = (
    str(resources.files("manipose_mj.ppf_jax") / "weights" / f"{name}.npz")
    for name in ("cup", "bowl", "axial", "furniture")
)


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["pose", "train", "mgu"], "did you mean mug"),
        (["pose", "train", "cabinet"], "unknown category or type 'cabinet'"),
        (["pose", "train", "mug", "--views", "0"], "--views is 0"),
        (["pose", "train", "mug", "--minutes", "-1"], "--minutes is -1"),
        (["pose", "train", "mug", "--leave-out", "mug"], "leaves nothing of mug"),
        (["pose", "train", "axial", "--leave-out", "mug"], "unknown category of axial 'mug'"),
        (["pose", "train", "mug", "--setting", "anywere"], "did you mean anywhere"),
        (["pose", "train", "mug", "--setting"], "--setting names none"),
        (["pose", "train", "axial", "--part-swaps", "-1"], "--part-swaps is -1"),
        (["pose", "train", "mug", "--seed", "-1"], "--seed is -1; expected a whole number from 0"),
        (["pose", "train", "mug", "--seed", "4294967296"], "from 0 to 4294967295"),
        (["pose", "train-articulated", "--seed", "18446744073709551617"], "from 0 to 4294967295"),
        (["pose", "train", "mug", "--asset-views", "0"], "--asset-views is 0"),
        (["pose", "train", "mug", "--asset-part-swaps", "-2"], "--asset-part-swaps is -2"),
        (["pose", "train-articulated", "--only", "45963"], "say with --assets where it is"),
        (["pose", "train-articulated", "--asset-scenes", "0"], "--asset-scenes is 0"),
        (["pose", "train", "mug", "--part-swaps", "2"], "objects are made of two of mug"),
        (["pose", "train", "axial", "--part-swaps", "2", "--labels", "original"], "no source has"),
        (
            ["pose", "train", "cup", "--method", "cppf", "--start-from", CUP],
            "cup.npz: weights of method ours; expected cppf",
        ),
        (
            ["pose", "train", "cup", "--start-from", FURNITURE],
            "of method articulated; expected ours",
        ),
        (
            ["pose", "train", "cup", "--start-from", AXIAL],
            "axial.npz: weights of networks of other",
        ),
        (["pose", "train", "axial", "--start-from", CUP], "cup.npz: weights of networks of other"),
        (
            ["pose", "train-articulated", "--start-from", CUP],
            "of method ours; expected articulated",
        ),
        (["pose", "evaluate", "mug", "--weights", "none.npz"], "none.npz"),
        (["pose", "average", "a.npz", "--out", "b.npz"], "1 files of weights"),
        (["pose", "average", CUP, "none.npz", "--out", "b.npz"], "none.npz: no such file"),
        (["pose", "average", CUP, BOWL, "--out", "b.npz"], "weights of ours, bowl, unified"),
    ],
)
def test_wrong_input_is_one_line(command, message, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert main(command) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("command", "configs", "told"),
    [
        (
            ("train", "cup"),
            (ArticulatedConfig(), METHODS["ours"].training),
            "--views None (now 256)",
        ),
        (
            ("train-articulated", "--seed", "3"),
            (ArticulatedConfig(), TrainingConfig(loss=ArticulatedLoss())),  # type: ignore[arg-type]
            "seed 0 (now 3)",
        ),
    ],
)
def test_a_training_of_other_options_is_refused_before_it_renders(
    command, configs, told, tmp_path, monkeypatch, capsys
):
    for module in ("pose.clouds.catalogue_clouds", "pose.articulated.evaluate_articulated"):
        monkeypatch.setattr(f"manipose_mj.cli.{module}", lambda *_, **__: pytest.fail("rendered"))
    monkeypatch.setattr(cache, "furniture_scenes", lambda *_, **__: pytest.fail("rendered"))
    monkeypatch.setattr("manipose_mj.ppf_jax.training.saved_state._TOLD", 20)
    header = {"config": [dataclasses.asdict(each) for each in configs], "about": {}}
    (tmp_path / STATE_FILE).write_text(json.dumps(header) + "\n")
    assert main(["pose", *command, "--out", str(tmp_path), "--jobs", "1"]) == 2
    said = capsys.readouterr().err
    assert f"{tmp_path}/{STATE_FILE}: the state of a training with" in said and told in said


def test_a_type_is_all_its_rigid_categories():
    assert categories_of("mug") == ("mug",)
    assert len(categories_of("axial")) == 18
    assert sum(len(categories_of(kind)) for kind in ("axial", "mirror", "functional")) == 56
    with pytest.raises(InputError, match="unknown category or type 'articulated'"):
        categories_of("articulated")


class Parrot:
    """An estimator that answers with the mean of what it sees."""

    def estimate(self, cloud, *, key):
        pose = np.eye(4)
        pose[:3, 3] = (cloud if isinstance(cloud, np.ndarray) else cloud.points).mean(axis=0)
        return PoseEstimate(pose, np.ones(3), float(len(cloud)))

    def estimate_many(self, clouds, *, key):
        assert len(clouds) == 4  # always: another number would compile again
        return [self.estimate(cloud, key=key) for cloud in clouds]


def labelled(points: np.ndarray, name: str, category: str = "a") -> LabelledCloud:
    pose, extents = np.eye(4, dtype=np.float32), np.ones(3, np.float32)
    return LabelledCloud(points, points, pose, extents, SymmetryGroup.identity(), name, category)


def test_every_cloud_gets_its_own_answer():
    clouds = [labelled(np.full((40 + i, 3), i, np.float32), f"a/{i}") for i in range(10)]
    found = predict(Parrot(), clouds, batch=4)  # type: ignore[arg-type]
    np.testing.assert_array_equal(found.poses[:, 0, 3], np.arange(10))
    np.testing.assert_array_equal(found.confidence, 40 + np.arange(10))
    assert found.ms_per_object > 0


class Known(Parrot):
    """The same, trained on cups alone."""

    trained = SimpleNamespace(method="ours", cameras="one", categories=("cup",))

    def estimate_many(self, clouds, *, key):
        return [self.estimate(cloud, key=key) for cloud in clouds]


@pytest.fixture
def evaluated(monkeypatch, capsys):
    """The row of `pose evaluate` with these words, by an estimator that was trained on cups."""
    monkeypatch.setattr(PoseEstimator, "load", lambda *_, **__: Known())

    def row(*words: str) -> dict[str, Any]:
        command = ["pose", "evaluate", *words, "--views", "1", "--jobs", "1", "--json"]
        assert main(command) == 0
        (found,) = json.loads(capsys.readouterr().out)
        return found

    return row


def test_surfaces_of_objects_that_a_setting_tapers_are_not_compared(evaluated, monkeypatch):
    cloud = labelled(np.ones((40, 3), np.float32), "cup_000/0", "cup")
    monkeypatch.setattr("manipose_mj.cli.pose.clouds.catalogue_clouds", lambda *_, **__: [cloud])
    assert "mssd_cm_mean" in evaluated("cup")
    assert "mssd_cm_mean" not in evaluated("cup", "--setting", "training")


@pytest.mark.parametrize(
    ("assets", "name", "known"),
    [
        (("cup",), "axial", True),
        (("bowl",), "axial", False),
        (("cup", "bowl"), "axial", None),
        (("cup", "bowl"), "bowl", False),
    ],
)
def test_assets_are_unseen_by_their_own_category(evaluated, tmp_path, assets, name, known):
    for category in assets:
        write_asset(tmp_path, category, category)
    assert evaluated(name, "--assets", str(tmp_path))["trained_on"] is known


def test_furniture_is_evaluated_by_category_as_valid_json(monkeypatch, capsys, caplog):
    unknown = PartErrors(
        "cabinet_000/0 door", True, False, *2 * [float("inf")], False, *3 * [float("inf")], 0.0
    )
    found = part_evaluation.Evaluated([unknown], 3, 2)
    monkeypatch.setattr(ArticulatedEstimator, "load", lambda: None)
    scenes = [SimpleNamespace(category=category) for category in ("cabinet", "oven")]
    monkeypatch.setattr(cache, "furniture_scenes", lambda *_, **__: scenes)
    monkeypatch.setattr(part_evaluation, "scene_clouds", lambda *_, **__: [])
    monkeypatch.setattr(part_evaluation, "evaluated", lambda *_: found)
    assert main(["pose", "evaluate-articulated", "--scenes", "1", "--jobs", "1", "--json"]) == 0
    printed = capsys.readouterr().out
    assert "NaN" not in printed and "Infinity" not in printed
    rows = json.loads(printed)
    assert [(row["views"], row["category"]) for row in rows] == [
        (1, "all"),
        (1, "cabinet"),
        (3, "all"),
        (3, "cabinet"),
    ]
    assert rows[0]["false_positives_per_cloud"] == 1.5
    assert "false_positives_per_cloud" not in rows[1]
    assert rows[0]["centre_cm_median"] is None and rows[0]["all_right"] is None
    assert "oven: no handle shows (views: 1), left out" in caplog.text


def test_a_curve_is_drawn_with_and_without_held_out_errors(tmp_path):
    rows = [{"step": 0, "seconds": 1.0, "loss": 3.0}, {"step": 50, "seconds": 2.0, "loss": 2.0}]
    checked = [*rows, {"step": 100, "seconds": 3.0, "loss": 1.0, "deg_mean": 5.0, "cm_mean": 1.0}]
    for name, curve in (("plain", rows), ("checked", checked)):
        (tmp_path / f"{name}.json").write_text(json.dumps(curve))
        draw_curve(tmp_path / f"{name}.json", tmp_path / f"{name}.png")
    assert (tmp_path / "plain.png").read_bytes()[:4] == b"\x89PNG"
    assert (tmp_path / "plain.png").read_bytes() != (tmp_path / "checked.png").read_bytes()
