"""Dependencies point one way, and importing the package needs no renderer."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# Package: what of ours, and of others, its modules must not import; inside functions neither.
FORBIDDEN = {
    "manipose_mj/poses.py": ("mujoco", "dm_control", "asset_pipeline", "manipose_mj"),
    "manipose_mj/errors.py": ("mujoco", "dm_control", "asset_pipeline", "manipose_mj"),
    "manipose_mj/mjcf": (
        "manipose_mj.tasks",
        "manipose_mj.control",
        "manipose_mj.evaluation",
        "manipose_mj.cli",
        "manipose_mj.suite",
    ),
    "manipose_mj/tasks": (
        "manipose_mj.control",
        "manipose_mj.evaluation",
        "manipose_mj.cli",
        "manipose_mj.suite",
    ),
    "manipose_mj/control": (
        "manipose_mj.cli",
        "manipose_mj.evaluation.runner",
        "manipose_mj.gym",
        "benchmarks",
    ),
    "manipose_mj/gym": ("manipose_mj.cli", "manipose_mj.evaluation", "benchmarks"),
    "manipose_mj/protocol/frozen.py": ("mujoco", "dm_control", "manipose_mj.tasks"),
    "manipose_mj/evaluation": ("manipose_mj.cli", "benchmarks"),
}


def _modules(place: str) -> list[Path]:
    path = ROOT / place
    found = [path] if path.is_file() else sorted(path.rglob("*.py"))
    assert found, f"{place} is gone"
    return found


def _imports(file: Path) -> set[str]:
    """Everything a module imports, as full dotted names of modules or of what is in them."""
    names = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: relative import"
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return names


def _inside(name: str, package: str) -> bool:
    return name == package or name.startswith(f"{package}.")


@pytest.mark.parametrize("place", FORBIDDEN)
def test_packages_do_not_import_what_is_above_them(place):
    wrong = [
        f"{file.relative_to(ROOT)} imports {name}"
        for file in _modules(place)
        for name in _imports(file)
        for package in FORBIDDEN[place]
        if _inside(name, package)
    ]
    assert not wrong


def test_the_asset_pipeline_knows_only_poses_and_errors_of_the_package():
    allowed = ("manipose_mj.poses", "manipose_mj.errors")
    wrong = [
        f"{file.relative_to(ROOT)} imports {name}"
        for file in _modules("asset_pipeline")
        for name in _imports(file)
        if _inside(name, "manipose_mj") and not any(_inside(name, each) for each in allowed)
    ]
    assert not wrong


def test_robots_and_scenes_read_built_assets_only():
    """`mjcf` takes the folder's reader and the label from the pipeline, none of what builds."""
    allowed = (
        "asset_pipeline.assets",
        "asset_pipeline.geometry",
        "asset_pipeline.labelling.label",
        "asset_pipeline.labelling.label_marks",
    )
    wrong = [
        f"{file.relative_to(ROOT)} imports {name}"
        for file in _modules("manipose_mj/mjcf")
        for name in _imports(file)
        if _inside(name, "asset_pipeline") and not any(_inside(name, each) for each in allowed)
    ]
    assert not wrong


LOAD = """
import sys
import manipose_mj, manipose_mj.poses
assert not any(m.split('.')[0] in ('mujoco', 'dm_control') for m in sys.modules), 'eager import'
from manipose_mj import suite
import manipose_mj.control.episode
assert 'mujoco.renderer' not in sys.modules
environment = suite.load(*suite.ALL_TASKS[0], seed=0, observations='state+depth')
depth = environment.reset().observation['depth/front']
assert (depth > 0).any()
"""


@pytest.mark.parametrize(
    "environment",
    [
        {"MUJOCO_GL": "disable"},
        {"MUJOCO_GL": None, "DISPLAY": ":987", "EGL_PLATFORM": "no-such-platform"},
    ],
    ids=["disabled", "no display"],
)
def test_importing_and_depth_need_no_renderer(environment):
    variables = {**os.environ, **environment}
    variables = {name: value for name, value in variables.items() if value is not None}
    ended = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", LOAD],
        env=variables,
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ended.returncode == 0, ended.stderr


def test_importing_the_tasks_needs_neither_jax_nor_what_cuts_scans_into_convex_parts():
    script = """
import sys
import manipose_mj.suite
loaded = {name.split('.')[0] for name in sys.modules} & {'coacd', 'jax', 'equinox', 'optax'}
assert not loaded, loaded
"""
    ended = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", script],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ended.returncode == 0, ended.stderr
