"""Compiles the kernels of the engine `warp` in many processes: NVIDIA's compiler takes one at a time in each.

What would be launched is found by a dry run, which launches nothing and needs no GPU. Every process makes the same dry
run on Warp's CPU device, and compiles those kernels into Warp's own cache that no other has begun with.
"""

import json
import logging
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple
from unittest import mock

import warp as wp  # pyright: ignore[reportMissingImports]

from manipose_mj.console.process import CORES
from manipose_mj.storage.cache_file import new_cache_file
from manipose_mj.storage.source_hash import source_hash

_log = logging.getLogger(__name__)
_FEWEST = 4  # kernels that are worth other processes, which take some seconds to start
_ENGINE = "manipose_mj.batch.engine_warp"
_SLOW = "ccd_kernel"  # of convex shapes: each takes as long as all others together


class Launch(NamedTuple):
    """What Warp compiles at once. Attributes: module, of kernels; block_dim, threads in a block."""

    module: Any
    block_dim: int

    @property
    def name(self) -> str:
        """That of its folder in the cache."""
        return self.module.get_module_identifier(block_dim=self.block_dim)


class Compiling:
    """Processes that compile, until `wait`."""

    def __init__(self, task: bytes, processes: int) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="manipose_kernels_")
        self._began = perf_counter()
        (Path(self._folder.name) / "task").write_bytes(task)
        # They see no GPU: they would hold its memory.
        environment = os.environ | {"CUDA_VISIBLE_DEVICES": "", "JAX_PLATFORMS": "cpu"}
        command = [sys.executable, "-m", __name__, self._folder.name]
        self._processes = [
            subprocess.Popen(
                command,
                env=environment,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            for _ in range(processes)
        ]

    def wait(self) -> None:
        """Until all have ended. What they did not compile is compiled where it is used."""
        failed = sum(process.wait() != 0 for process in self._processes)
        self._folder.cleanup()
        count, taken = len(self._processes), perf_counter() - self._began
        _log.info("kernels compiled in %.1f s by %d processes", taken, count)
        if failed:
            _log.warning("%d of %d processes that compile kernels failed", failed, count)


def begin_compiling(
    make: Callable[..., object], arguments: Any, arch: int, likeness: str
) -> Compiling | None:
    """Start to compile what is not in Warp's cache yet.

    Args:
      make: A function of a module, called with `arguments`, that launches the kernels; under `launches`, so that
        nothing is computed.
      arguments: A tuple that can be pickled.
      arch: Of the GPU, as 90.
      likeness: The same for arguments of which the same is expected to be launched: if all that was is compiled, no dry
        run is made. What it misses is compiled where it is used.

    Returns:
      What to wait for; None where there is too little to do, or one core.
    """
    note = _note(likeness, arch)
    if _all_compiled(note, arch):
        return None
    found = launches(make, arguments)
    missing = [one for one in found if not _compiled(one.name, arch)]
    note.parent.mkdir(parents=True, exist_ok=True)
    with new_cache_file(note) as scratch:
        scratch.write_text(json.dumps([one.name for one in found]), encoding="utf-8")
    if CORES < 2 or len(missing) < _FEWEST:
        return None
    _log.info("%d of the kernels' modules are compiled", len(missing))
    wp.init()
    task = pickle.dumps((make, arguments, arch, wp.config.kernel_cache_dir))
    return Compiling(task, min(CORES, len(missing)))


def launches(make: Callable[..., object], arguments: Any) -> list[Launch]:
    """What a function launches, without launching it; those that take longest to compile first."""
    with _recorded() as found:
        make(*arguments)
    unique = {one.name: one for one in found}
    return sorted(unique.values(), key=lambda one: (_SLOW not in one.name, one.name))


@contextmanager
def _recorded() -> Iterator[list[Launch]]:
    """Inside, launches are noted instead of made, and loops and branches of graphs run once."""
    found: list[Launch] = []

    def note(kernel: Any, *_: Any, block_dim: int = 256, **__: Any) -> None:
        found.append(Launch(kernel.module, block_dim))

    def once(_: Any, *bodies: Callable[..., None], **named: Any) -> None:
        named.pop("stream", None)
        branches = [named.pop(name, None) for name in ("while_body", "on_true", "on_false")]
        for body in (*bodies, *branches):
            if callable(body):
                body(**named)

    def size(*_: Any) -> tuple[int, int]:
        return 64, 1

    replaced = {
        "launch": note, "launch_tiled": note, "capture_while": once, "capture_if": once,
        "get_suggested_block_size": size,
    }  # fmt: skip
    with mock.patch.multiple(wp, **replaced):
        yield found


def _note(likeness: str, arch: int) -> Path:
    """Where the names of what is launched are kept, beside the kernels."""
    words = (likeness, str(arch), *map(version, ("warp-lang", "mujoco-warp")))
    return (
        Path(wp.config.kernel_cache_dir)
        / f"launches_{source_hash((__name__, _ENGINE), *words)}.json"
    )


def _all_compiled(note: Path, arch: int) -> bool:
    """Whether everything in a note is."""
    try:
        names = json.loads(note.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return all(_compiled(name, arch) for name in names)


def _compiled(name: str, arch: int) -> bool:
    folder = Path(wp.config.kernel_cache_dir) / name
    return any(folder.glob(f"*.sm{arch}*"))


def compile_share(folder: Path) -> None:
    """What one of the processes does.

    Args:
      folder: With the task; each module is claimed by a file in it.
    """
    wp.init()  # which appends the version to the cache's folder: the one sent is complete
    task = pickle.loads((folder / "task").read_bytes())
    make, arguments, arch, wp.config.kernel_cache_dir = task
    for launch in launches(make, arguments):
        if _compiled(launch.name, arch):
            continue
        try:
            (folder / launch.name).touch(exist_ok=False)
        except FileExistsError:
            continue
        launch.module.options["block_dim"] = launch.block_dim
        wp.compile_aot_module(launch.module, arch=arch, use_ptx=False)


if __name__ == "__main__":
    # Under its own name, so that what is pickled is found again.
    from manipose_mj.batch.kernels import kernels_ahead

    kernels_ahead.compile_share(Path(sys.argv[1]))
