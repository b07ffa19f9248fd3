"""Tries out what this package can use on a machine."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

from manipose_mj.errors import InputError, how_to_install

DISTRIBUTION = "manipose-mj"
_SCENE = """<mujoco><worldbody><geom type="plane" size="1 1 .1"/>
<body pos="0 0 .5"><freejoint/><geom size=".1"/></body></worldbody></mujoco>"""


@dataclass(frozen=True)
class Finding:
    """One thing that was tried.

    Attributes:
      group: Under which heading it belongs.
      what: Its name.
      status: `"ok"`; `"missing"` if every command needs it; `"absent"` if it is an extra.
      detail: Its version or size if it works, else how to get it. One line.
    """

    group: str
    what: str
    status: Literal["ok", "missing", "absent"]
    detail: str


def examine() -> list[Finding]:
    """Every finding, in the order of their groups; takes a few seconds."""
    return [*_system(), *_packages(), *_renderers(), *_engines(), _visuals(), _cache()]


def _system() -> Iterator[Finding]:
    from packaging.specifiers import SpecifierSet

    from manipose_mj.evaluation.statistics import machine

    version = platform.python_version()
    try:
        requested = importlib.metadata.metadata(DISTRIBUTION)["Requires-Python"] or ""
    except importlib.metadata.PackageNotFoundError:
        yield Finding("system", DISTRIBUTION, "missing", "run `pip install -e .` in its clone")
        return
    good = SpecifierSet(requested).contains(version)
    yield Finding(
        "system",
        "python",
        "ok" if good else "missing",
        f"{version}" if good else f"{version}, but {requested} is needed",
    )
    yield Finding("system", "machine", "ok", f"{machine()}, {platform.system()}")


def _packages() -> Iterator[Finding]:
    """Every run-time dependency, against the range that this release was tested with."""
    from packaging.requirements import Requirement

    try:
        lines = importlib.metadata.requires(DISTRIBUTION) or []
    except importlib.metadata.PackageNotFoundError:
        return
    for requirement in map(Requirement, lines):
        if requirement.marker is not None and not requirement.marker.evaluate({"extra": ""}):
            continue
        name, requested = requirement.name, requirement.specifier
        try:
            version = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            yield Finding("packages", name, "missing", f'pip install "{name}{requested}"')
            continue
        if requested.contains(version, prereleases=True):
            yield Finding("packages", name, "ok", version)
        else:
            advice = f'{version} is not in the tested range; pip install "{name}{requested}"'
            yield Finding("packages", name, "missing", advice)


def _renderers() -> Iterator[Finding]:
    from manipose_mj.mjcf.cameras import gl

    yield Finding("renderers", "ray caster", "ok", "depth, segmentation, clouds and plain pictures")
    for status in gl.probe_all():
        detail = "colour pictures and animations"
        if not status.works:
            detail = f"{status.reason}; {status.remedy}"
        yield Finding("renderers", status.backend, "ok" if status.works else "absent", detail)
    if os.environ.get("MUJOCO_GL"):
        chosen = gl.working_backend() or "none"
        detail = f"MUJOCO_GL={os.environ['MUJOCO_GL']} makes it {chosen}"
        yield Finding("renderers", "in use", "ok" if chosen != "none" else "absent", detail)


def _engines() -> Iterator[Finding]:
    yield _tried("MuJoCo C", _mujoco_c, needed=True)
    yield _tried("mujoco.rollout", _mujoco_rollout, needed=True)
    yield _tried("MJX-JAX", _mjx_jax)
    yield _tried("MJX-Warp", _mjx_warp)


def _tried(what: str, attempt: Callable[[], str], *, needed: bool = False) -> Finding:
    """What `attempt` says it found, or why it failed."""
    try:
        return Finding("engines", what, "ok", attempt())
    except Exception as error:  # a broken native library can raise anything; all of it is a finding
        line = " ".join(str(error).split()) or type(error).__name__
        return Finding("engines", what, "missing" if needed else "absent", line[:200])


def _mujoco_c() -> str:
    import mujoco

    model = mujoco.MjModel.from_xml_string(_SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 10)
    return f"{mujoco.mj_versionString()}, the reference"


def _mujoco_rollout() -> str:
    import mujoco
    import numpy as np
    from mujoco import rollout

    from manipose_mj.console.process import CORES

    model = mujoco.MjModel.from_xml_string(_SCENE)
    data = [mujoco.MjData(model) for _ in range(CORES)]
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    start = np.empty(size)
    mujoco.mj_getState(model, data[0], start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    rollout.rollout(model, data, np.tile(start, (2 * CORES, 1)), nstep=2)
    return f"{CORES} threads"


def _mjx_jax() -> str:
    _require("jax", "mujoco.mjx")
    import jax
    import mujoco
    from mujoco import mjx

    mjx.put_model(mujoco.MjModel.from_xml_string(_SCENE))
    devices = ", ".join(sorted({d.device_kind for d in jax.devices()}))
    return f"jax {jax.__version__} on {devices}"


def _mjx_warp() -> str:
    _require("warp", "mujoco_warp")
    import warp  # pyright: ignore[reportMissingImports]

    warp.config.quiet = True
    devices = [d.name for d in warp.get_cuda_devices()]
    if not devices:
        raise RuntimeError(
            "installed, but there is no CUDA device; it needs an NVIDIA GPU and driver"
        )
    return f"warp {warp.__version__} on {', '.join(devices)}"


def _require(*modules: str) -> None:
    for name in modules:
        parent = name.partition(".")[0]
        if importlib.util.find_spec(parent) is None or importlib.util.find_spec(name) is None:
            raise ModuleNotFoundError(f"{name} is not installed; {how_to_install('gpu')}")


def _visuals() -> Finding:
    """Menagerie's meshes, which only make pictures nicer."""
    from manipose_mj.mjcf.panda.menagerie import PREFETCH, find_menagerie_panda

    try:
        folder = find_menagerie_panda()
    except InputError as error:
        return Finding("extras", "Menagerie visuals", "absent", str(error))
    if folder is not None:
        return Finding("extras", "Menagerie visuals", "ok", str(folder))
    prefetch = PREFETCH.replace("python", sys.executable, 1)
    if importlib.util.find_spec("mujoco_menagerie") is None:
        prefetch = f"{how_to_install('render')}, then {prefetch}"
    return Finding("extras", "Menagerie visuals", "absent", prefetch)


def _cache() -> Finding:
    from manipose_mj.storage.cache_root import CACHE_VARIABLE, cache_root

    folder = cache_root()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder):
            pass
    except OSError as error:
        advice = f"{folder}: {error.strerror}; set {CACHE_VARIABLE} to a folder that can be written"
        return Finding("extras", "cache", "absent", advice)
    return Finding("extras", "cache", "ok", str(folder))
