"""Which files a PartNet-Mobility object is built from: those that its URDF names too, wherever they lie in its folder."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import pytest
import trimesh

from asset_pipeline.build.data_set import build
from asset_pipeline.sources.partnet_mobility import objects as partnet_mobility
from manipose_mj.assets.asset_json import read_asset
from manipose_mj.cli.main import main
from manipose_mj.errors import InputError

VISUAL = '<visual name="{0}"><geometry><mesh filename="{1}"/></geometry></visual>'
FILES = {
    "frame": ("./meshes/of [base]/frame.obj", (1.0, 1.6, 1.2)),
    "door": ("textured_objs/new/door.obj", (0.1, 1.6, 1.2)),
}


@pytest.fixture
def drawn(tmp_path) -> Path:
    """A cabinet with a door, its meshes in folders of their own, beside their materials."""
    folder = tmp_path / "4713"
    links = ['<link name="base"/>']
    for name, (file, extents) in FILES.items():
        (folder / file).parent.mkdir(parents=True)
        text = trimesh.creation.box(extents).export(file_type="obj")
        (folder / file).write_text(f"mtllib {name}.mtl\nusemtl red\n{text}")
        (folder / file).with_suffix(".mtl").write_text("newmtl red\nKd 0.8 0.1 0.1\n")
        links.append(f'<link name="{name}">{VISUAL.format(name, file)}</link>')
    joints = (
        '<joint name="a" type="fixed"><parent link="base"/><child link="frame"/></joint>'
        '<joint name="b" type="revolute"><parent link="frame"/><child link="door"/>'
        '<origin xyz="-0.55 0 0"/><axis xyz="0 0 1"/><limit lower="0" upper="1.5"/></joint>'
    )
    (folder / "mobility.urdf").write_text(f'<robot name="r">{"".join(links)}{joints}</robot>')
    (folder / "semantics.txt").write_text("frame heavy furniture_body\ndoor hinge rotation_door\n")
    (folder / "meta.json").write_text(json.dumps({"model_cat": "StorageFurniture"}))
    return folder


def _inputs(path: Path) -> dict[str, str]:
    (item,) = partnet_mobility.items(path)
    return partnet_mobility.inputs(item)


@pytest.mark.parametrize("name", ["frame.obj", "frame.mtl", "door.obj", "door.mtl"])
def test_a_changed_mesh_or_material_is_another_input(drawn, name):
    before = _inputs(drawn)
    (file,) = drawn.rglob(name)
    file.write_text(file.read_text() + "# changed\n")
    assert {key for key, digest in _inputs(drawn).items() if digest != before[key]} == {name}


def test_an_archive_gives_all_that_its_urdf_names(drawn, tmp_path):
    archive = tmp_path / "4713.zip"
    with zipfile.ZipFile(archive, "w") as file:
        for path in sorted(drawn.rglob("*")):
            file.write(path, Path("4713") / path.relative_to(drawn))
    assert _inputs(archive) == _inputs(drawn)
    (item,) = partnet_mobility.items(archive)
    with partnet_mobility.opened(item) as scan:
        parts = [part for link in (scan.base, *scan.moving) for part in link.parts]
    assert [part.surfaces[0].rgba for part in parts] == [(0.8, 0.1, 0.1, 1.0)] * 2


def test_a_urdf_that_cannot_be_read_is_still_an_input(drawn):
    (drawn / "mobility.urdf").write_text("<robot>")
    assert "mobility.urdf" in _inputs(drawn)


def test_a_record_that_is_not_there_is_not_compared(drawn, caplog):
    assert not (drawn / "mobility_v2.json").exists()
    (item,) = partnet_mobility.items(drawn)
    with partnet_mobility.opened(item):
        pass
    assert "mobility_v2.json" not in caplog.text


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("mobility.urdf", "is one file of an object; expected the folder that it is in$"),
        ("chest.urdf", "expected the folder that it is in; name it mobility.urdf there$"),
    ],
)
def test_a_urdf_in_place_of_its_folder_is_told(drawn, name, message):
    path = (drawn / "mobility.urdf").rename(drawn / name)
    with pytest.raises(InputError, match=message):
        partnet_mobility.items(path)


def test_own_furniture_has_the_licence_that_is_said(drawn, tmp_path, capsys):
    out = tmp_path / "out"
    command = ["assets", "build", "partnet_mobility", str(drawn), "--out", str(out), "--jobs", "1"]
    said = [*command, "--licence", "CC0 1.0"]
    for options, status, licence in (
        (command, "1 built", partnet_mobility.LICENCE),
        (said, "1 built", "CC0 1.0"),
        (said, "0 built, 1 up to date", "CC0 1.0"),
    ):
        assert main(options) == 0
        assert status in capsys.readouterr().out
        assert read_asset(out / "4713").provenance.licence == licence
    assert main([*command, "--category", "mug"]) != 0
    assert "--licence for partnet_mobility too" in capsys.readouterr().err
    with pytest.raises(InputError, match="ycb has its licence"):
        build("ycb", drawn, out, licence="CC0 1.0")
