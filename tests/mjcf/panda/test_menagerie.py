"""Where Menagerie's Panda is looked for, and what is said of a folder that is none."""

from __future__ import annotations

import pytest

from manipose_mj.cli.diagnosis import _visuals
from manipose_mj.cli.main import main
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda import menagerie
from manipose_mj.mjcf.panda.robot import picture_visuals
from tests.fake_menagerie import PANDA, write_menagerie

INCOMPLETE = [
    ({"panda": ""}, "panda.xml: no XML (no element found"),
    ({"panda": PANDA[:100]}, "panda.xml: no XML ("),
    ({"panda": "<mujoco/>"}, "panda.xml: draws no mesh"),
    ({"panda": PANDA.replace('mesh="hand"', "")}, "panda.xml: not Menagerie's ('mesh' is missing)"),
    (
        {"panda": PANDA.replace("white", "teal")},
        "panda.xml: not Menagerie's (body hand, material teal)",
    ),
    ({"panda": PANDA.replace("hand.obj", "hand.stl")}, "hand.stl, which panda.xml draws"),
    ({"mesh": ""}, "hand.obj is empty"),
]


@pytest.mark.parametrize(("written", "fault"), INCOMPLETE)
def test_an_incomplete_folder_is_told_in_one_line(written, fault, tmp_path, monkeypatch, capsys):
    root = write_menagerie(tmp_path, **written)
    monkeypatch.setenv("MENAGERIE_ROOT", str(root))
    with pytest.raises(InputError, match="MENAGERIE_ROOT") as refusal:
        picture_visuals()
    line = str(refusal.value)
    assert fault in line and line.startswith(f"MENAGERIE_ROOT={root}: ") and "\n" not in line
    assert line.endswith("point it at a complete copy of MuJoCo Menagerie, or unset it")
    assert (_visuals().status, _visuals().detail) == ("absent", line)


def test_commands_refuse_a_root_without_the_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("MENAGERIE_ROOT", str(tmp_path / "nowhere"))
    out = tmp_path / "start.png"
    command = ["render", "single_object/target_pose", "--objects", "mug_000", "--out", str(out)]
    assert main(command) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and f"no {tmp_path}/nowhere/franka_emika_panda/panda.xml" in told
    assert not out.exists()


def test_an_incomplete_folder_in_the_cache_is_warned_of_once(tmp_path, monkeypatch, caplog):
    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)
    root = write_menagerie(tmp_path, mesh="")
    monkeypatch.setattr(menagerie, "_cached", lambda: root / "franka_emika_panda")
    assert [picture_visuals(), picture_visuals()] == ["primitive", "primitive"]
    assert [record.getMessage() for record in caplog.records] == [
        f"{root}/franka_emika_panda/assets/hand.obj is empty; pictures show plain shapes until "
        "`python -m mujoco_menagerie prefetch franka_emika_panda` has fetched it again"
    ]
    assert _visuals().status == "absent"


def test_a_complete_folder_is_found(tmp_path, monkeypatch):
    monkeypatch.setenv("MENAGERIE_ROOT", str(write_menagerie(tmp_path)))
    assert picture_visuals() == "menagerie"
    assert (_visuals().status, _visuals().detail) == ("ok", str(tmp_path / "franka_emika_panda"))
