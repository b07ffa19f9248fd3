"""Files of pools: what is none is refused in one line, whatever the pickle raises."""

from __future__ import annotations

import pickle
import subprocess
import sys
from typing import Any, cast

import mujoco
import pytest

from manipose_mj.batch.drawing import draw_pool
from manipose_mj.batch.starts import StartPool
from manipose_mj.errors import InputError
from manipose_mj.tasks.core.config import EnvConfig

DAMAGED = {
    "of a module that is not there": b"cno_such_module\nPool\n.",
    "of a name that is not there": b"cmanipose_mj.batch.starts\nNoPool\n.",
    "with an index beyond its memory": b"h\x07.",
    "empty": b"",
    "text": b"no pickle",
    "of three things": pickle.dumps((mujoco.__version__, None, None)),
    "of something else": pickle.dumps((mujoco.__version__, [1, 2])),
    "of another version": pickle.dumps(("2.0.0", None)),
}


@pytest.mark.parametrize("content", DAMAGED.values(), ids=DAMAGED)
def test_a_file_that_holds_no_pool_is_named(content, tmp_path):
    path = tmp_path / "pool.pickle"
    path.write_bytes(content)
    with pytest.raises(InputError) as refusal:
        StartPool.load(path)
    assert str(refusal.value).startswith(f"{path}: ") and "\n" not in str(refusal.value)


def test_a_missing_file_is_named(tmp_path):
    said = r"no pool of starts can be read from it \(No such file or directory\)$"
    with pytest.raises(InputError, match=said):
        StartPool.load(tmp_path / "none")


@pytest.mark.parametrize("content", [b"", pickle.dumps((mujoco.__version__, None))[:-4]])
def test_an_empty_file_is_told(content, tmp_path):
    path = tmp_path / "pool"
    path.write_bytes(content)
    with pytest.raises(InputError, match="read from it .(it is empty|UnpicklingError)"):
        StartPool.load(path)


def test_a_folder_is_no_place_for_a_pool(tmp_path):
    pool = StartPool(cast(Any, None), (), (), "", {})
    with pytest.raises(InputError) as refusal:
        pool.save(tmp_path)
    assert str(refusal.value) == f"{tmp_path}: is a folder; expected the name of a file to write"
    assert not list(tmp_path.iterdir())


def test_a_pool_has_the_same_digest_in_every_process(tmp_path):
    pool = draw_pool(EnvConfig("single_object/target_pose", objects=("box_000",)), range(1))
    pool.save(tmp_path / "pool")
    # Nothing else of batched worlds is loaded there.
    code = "from manipose_mj.batch.starts import StartPool; import sys; print(StartPool.load(sys.argv[1]).digest)"
    command = [sys.executable, "-c", code, str(tmp_path / "pool")]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert said.split() == [pool.digest]
