"""An exported data set is what it says, readable as BOP's, and truth written as CSV scores 1.0 on it."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from PIL import Image
from scipy.ndimage import binary_dilation
from scipy.spatial import cKDTree

from manipose_mj.bop import export as exporting
from manipose_mj.bop.dataset import read_data
from manipose_mj.bop.results_csv import Estimate, read_results
from manipose_mj.bop.score import score
from manipose_mj.cli.main import main
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, rotation_about
from manipose_mj.ppf_jax.data.view_settings import view_setting
from manipose_mj.ppf_jax.data.view_stream import catalogue_views
from tests.bop.truth import HEAD, write_truth

VIEWS = 2
CHOSEN = {"bowl": [4], "mug": [4], "box": [4]}


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Two views of each of three test objects: axial, without symmetry, and with three half turns."""
    folder = tmp_path_factory.mktemp("bop") / "set"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(exporting, "split_indices", lambda category, split: CHOSEN[category])
        setting = view_setting("anywhere")
        assert exporting.export(tuple(CHOSEN), folder, setting, views=VIEWS) == 6
    return folder


def scored(data, lines, tmp_path, encoding="utf-8") -> dict[str, dict]:
    path = tmp_path / "estimates.csv"
    path.write_text("\n".join(lines) + "\n", encoding=encoding)
    rows = score(read_results(path), read_data(data), source=path)
    return {str(row["name"]): row for row in rows}


RECALLS = ("mssd", "mspd", "add_s", "recall_5deg_2cm", "recall_10deg_5cm")


def test_a_table_from_a_spreadsheet_is_read(data, tmp_path):
    lines = write_truth(data, tmp_path / "truth.csv")
    assert scored(data, lines, tmp_path) == scored(data, lines, tmp_path, encoding="utf-8-sig")


def test_truth_scores_one(data, tmp_path):
    rows = scored(data, write_truth(data, tmp_path / "truth.csv"), tmp_path)
    assert set(rows) == {"all", "axial", "mirror", "discrete", "none", "bowl", "mug", "box"}
    for row in rows.values():
        assert [row[name] for name in RECALLS] == [1.0] * 5 and row["estimated"] == row["n"]
    assert rows["all"]["n"] == 3 * VIEWS and rows["all"]["seconds"] == pytest.approx(0.1)


def test_layout_is_the_one_that_readers_expect(data):
    """What FoundationPose's `BopBaseReader` and bop_toolkit open, by name."""
    scene = data / "test" / "000001"
    cameras, poses, infos = (
        json.loads((scene / f"scene_{name}.json").read_text())
        for name in ("camera", "gt", "gt_info")
    )
    assert list(cameras) == list(poses) == list(infos) == ["0", "1"]
    for image in ("0", "1"):
        assert len(cameras[image]["cam_K"]) == 9 and cameras[image]["depth_scale"] == 0.1
        assert set(poses[image][0]) == {"cam_R_m2c", "cam_t_m2c", "obj_id"}
        assert 0.9 < infos[image][0]["visib_fract"] <= 1
        name = f"{int(image):06d}"
        with Image.open(scene / "depth" / f"{name}.png") as depth:
            assert depth.mode == "I;16" and depth.size == (640, 480)
        for place in ("mask", "mask_visib", "mask_detected"):
            with Image.open(scene / place / f"{name}_000000.png") as mask:
                assert set(np.unique(np.asarray(mask))) == {0, 255}
    models = json.loads((data / "models" / "models_info.json").read_text())
    assert models["1"]["symmetries_continuous"] == [{"axis": [1, 0, 0], "offset": [0, 0, 0]}]
    assert len(models["3"]["symmetries_discrete"]) >= 3 and "symmetries_discrete" not in models["2"]
    targets = json.loads((data / "test_targets_bop19.json").read_text())
    assert len(targets) == 6 and targets[0] == {
        "scene_id": 1, "im_id": 0, "obj_id": 1, "inst_count": 1,
    }  # fmt: skip


def test_depth_beyond_sixteen_bits_is_not_measured(tmp_path, monkeypatch):
    def far(*chosen):
        for seen in catalogue_views(*chosen):
            depth = seen.picture.depth.copy()
            depth[0, :3] = 6.5535, 6.6, 20.0
            yield replace(seen, picture=replace(seen.picture, depth=depth))

    monkeypatch.setattr(exporting, "split_indices", lambda *_: [4])
    monkeypatch.setattr(exporting, "catalogue_views", far)
    exporting.export(("bowl",), tmp_path / "set", view_setting("clean"), views=1)
    with Image.open(tmp_path / "set" / "test" / "000001" / "depth" / "000000.png") as image:
        assert np.asarray(image)[0, :3].tolist() == [65535, 0, 0]


def test_images_show_the_model_where_the_truth_says(data):
    """Depth and masks, held against the model alone: frames, units and K agree."""
    for target in read_data(data).targets:
        scene, name = data / "test" / f"{target.scene:06d}", f"{target.image:06d}"
        mesh = trimesh.load(data / "models" / f"obj_{target.model:06d}.ply", process=False)
        placed = (target.truth[:3, :3] @ np.asarray(mesh.sample(4000)).T / 1000).T + target.truth[
            :3, 3
        ]
        image = placed @ target.matrix.T
        u, v = np.round(image[:, :2] / image[:, 2:]).astype(int).T
        mask = np.asarray(Image.open(scene / "mask" / f"{name}_000000.png")) > 0
        assert binary_dilation(mask, iterations=2)[v, u].all()
        visible = np.asarray(Image.open(scene / "mask_visib" / f"{name}_000000.png")) > 0
        depth = np.asarray(Image.open(scene / "depth" / f"{name}.png")) * 0.1 / 1000
        rows, columns = np.nonzero(visible & (depth > 0))
        rays = np.linalg.solve(target.matrix, np.stack([columns, rows, np.ones(len(rows))]))
        apart, _ = cKDTree(placed).query((rays * depth[rows, columns]).T)
        assert np.median(apart) < 0.004
        rgb = np.asarray(Image.open(scene / "rgb" / f"{name}.png"))[visible]
        assert rgb.max() > 60  # lit, and in colours


def test_estimates_that_symmetry_allows_score_one_and_others_do_not(data, tmp_path):
    def turned(degrees, axis):
        turn = rotation_about(np.eye(3)[axis], np.radians(degrees))
        return lambda pose: pose @ compose(turn, np.zeros(3))

    rows = scored(data, write_truth(data, tmp_path / "a.csv", turned(180, 0)), tmp_path)
    for name, right in (("bowl", True), ("box", True), ("mug", False)):
        assert (rows[name]["recall_5deg_2cm"], rows[name]["recall_10deg_5cm"]) == (right, right)
        assert (rows[name]["mssd"] > 0.99) == (rows[name]["mspd"] > 0.99) == right
    rows = scored(data, write_truth(data, tmp_path / "b.csv", turned(7, 2)), tmp_path)
    assert (rows["all"]["recall_5deg_2cm"], rows["all"]["recall_10deg_5cm"]) == (0, 1)


def test_recalls_of_a_shift_are_those_of_its_length(data, tmp_path):
    def shifted(pose):
        return compose(pose[:3, :3], pose[:3, 3] + [0, 0, 30])  # mm

    rows = scored(data, write_truth(data, tmp_path / "a.csv", shifted), tmp_path)
    assert (rows["mug"]["recall_5deg_2cm"], rows["mug"]["recall_10deg_5cm"]) == (0, 1)
    share = 0.03 / read_data(data).models[2].diameter
    wanted = np.mean([share < 0.05 * step for step in range(1, 11)])
    assert rows["mug"]["mssd"] == pytest.approx(wanted)
    assert rows["mug"]["add_s"] == float(share < 0.1)


def test_what_is_missing_counts_as_missed_and_the_surest_counts(data, tmp_path):
    lines = write_truth(data, tmp_path / "truth.csv")
    rows = scored(data, [lines[0], *lines[2:]], tmp_path)
    assert rows["bowl"]["estimated"] == 1 and rows["bowl"]["mssd"] == 0.5
    assert rows["all"]["recall_5deg_2cm"] == pytest.approx(5 / 6)
    words = lines[1].split(",")
    words[5] = "0 0 900"
    worse = ",".join(words)
    assert (
        scored(data, [*lines, worse], tmp_path)["all"]["mssd"] == 1.0
    )  # of equal scores the first
    words[3] = "0.95"
    assert scored(data, [*lines, ",".join(words)], tmp_path)["bowl"]["mssd"] == 0.5


def _with_nan(name):
    """An edit that makes the first number of a field NaN."""

    def edit(lines):
        fields = lines[1].split(",")
        column = HEAD.split(",").index(name)
        fields[column] = " ".join(["nan", *fields[column].split()[1:]])
        return [lines[0], ",".join(fields)]

    return edit


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda lines: [HEAD.replace(",t,", ",T,"), *lines[1:]], "no column 't'"),
        *(
            (_with_nan(name), f"line 2: {name} is not finite")
            for name in ("score", "R", "t", "time")
        ),
        (lambda lines: [lines[0], lines[1].replace(",0.1", "")], "line 2 has 6 fields; expected 7"),
        (lambda lines: [lines[0], lines[1].replace(",0.1", ",soon")], "line 2: could not convert"),
        (lambda lines: [lines[0], f"1,0,1,1,{'1 ' * 9},0 0 1,0"], "line 2: R is not a rotation"),
        (
            lambda lines: [lines[0], "1,0,1,1,1 0 0 0 1 0 0 0 1,0 0,0"],
            "t has 2 numbers; expected 3",
        ),
        (
            lambda lines: [lines[0], lines[1].replace("1,0,1,", "1,7,1,")],
            "image 7, object 1 is no target",
        ),
        (lambda lines: [*lines[:2], lines[1].replace(",0.1", ",0.2")], "has several times"),
        (lambda lines: [], "no column 'scene_id'"),
    ],
)
def test_a_bad_csv_is_one_line_and_exit_2(data, tmp_path, capsys, edit, message):
    path = tmp_path / "estimates.csv"
    path.write_text("\n".join(edit(write_truth(data, path))) + "\n")
    assert main(["pose", "score", str(path), "--data", str(data)]) == 2
    said = capsys.readouterr()
    assert message in said.err and said.err.count("\n") == 1 and not said.out


def test_the_command_prints_a_table_and_json(data, tmp_path, capsys):
    path = tmp_path / "truth.csv"
    write_truth(data, path)
    assert main(["pose", "score", str(path), "--data", str(data), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert rows[0]["by"] == "all" and rows[0]["mspd"] == 1.0
    assert main(["pose", "score", str(path), "--data", str(data)]) == 0
    assert "category" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["export", "mug", "--out", "{data}"], "exists; choose another --out"),
        (["export", "mgu", "--out", "{new}"], "did you mean mug"),
        (["export", "mug", "--setting", "training", "--out", "{new}"], "wider and narrower"),
        (["export", "mug", "--views", "0", "--out", "{new}"], "--views is 0"),
        (["score", "{new}", "--data", "{data}"], "No such file"),
        (["score", "{data}/manipose.json", "--data", "{new}"], "no column"),
    ],
)
def test_bad_input_is_one_line(data, tmp_path, capsys, words, message):
    new = tmp_path / "new"
    assert main(["pose", *(word.format(data=data, new=new) for word in words)]) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1
    assert not new.exists()


def test_a_data_set_that_lacks_a_file_names_it(data, tmp_path):
    with pytest.raises(InputError, match=r"test_targets_bop19\.json: No such file"):
        read_data(tmp_path)
    (tmp_path / "test_targets_bop19.json").write_text("[")
    with pytest.raises(InputError, match=r"test_targets_bop19\.json: not JSON"):
        read_data(tmp_path)


def test_a_time_is_that_of_an_image_however_many_objects_it_shows(data, tmp_path):
    known = read_data(data)
    one = known.targets[0]
    other = next(target for target in known.targets if target.model != one.model)
    beside = replace(other, scene=one.scene, image=one.image)
    targets = (one, beside, known.targets[-1])
    found = [
        Estimate(t.scene, t.image, t.model, 1.0, t.truth, seconds)
        for t, seconds in zip(targets, (4.0, 4.0, 1.0), strict=True)
    ]
    rows = score(found, replace(known, targets=targets), source=tmp_path)
    assert rows[0]["n"] == 3 and rows[0]["seconds"] == 2.5


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("test_targets_bop19.json", "{}", "expected a list"),
        ("camera.json", '{"width": "wide"}', "width is 'wide'"),
        ("models_eval/models_info.json", '{"1": {"diameter": null}}', "model 1 cannot be read"),
        ("models_eval/models_info.json", '{"1": []}', "model 1 cannot be read"),
        ("test/000001/scene_camera.json", "[]", "image 0 cannot be read"),
        ("test/000001/scene_gt.json", '{"0": ["a"]}', "image 0 has object 1 0 times"),
        ("models_eval/obj_000001.ply", "ply\nformat ascii 1.0\n", "model 1 cannot be read"),
    ],
)
def test_a_broken_data_set_is_one_line(data, tmp_path, name, content, message):
    shutil.copytree(data, tmp_path / "set")
    assert (tmp_path / "set" / name).is_file()
    (tmp_path / "set" / name).write_text(content)
    with pytest.raises(InputError, match=message):
        read_data(tmp_path / "set")
