"""Dependencies point one way, no circle anywhere, and importing the package needs no renderer."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections import Counter
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.places import ROOT

PACKAGES = ("manipose_mj", "asset_pipeline")
# Each line may import the lines below it, and itself; imports inside functions and for types count too.
ORDER = (
    ("manipose_mj.cli",),
    ("manipose_mj.robustness",),
    ("manipose_mj.demos", "manipose_mj.learning"),
    ("manipose_mj.evaluation", "manipose_mj.bop"),
    ("manipose_mj.gym", "manipose_mj.policies"),
    ("manipose_mj.batch",),
    ("manipose_mj.suite",),
    ("manipose_mj.control",),
    ("manipose_mj.estimators",),
    ("manipose_mj.tasks", "manipose_mj.ppf_jax"),
    ("manipose_mj.actions",),
    ("manipose_mj.mjcf",),
    ("manipose_mj.grasp_sampling",),
    ("manipose_mj.assets",),
    ("manipose_mj.user_code",),
    (
        *("manipose_mj.poses", "manipose_mj.storage", "manipose_mj.console", "manipose_mj.wire"),
        "manipose_mj.warp_physics",
    ),
    (
        *("manipose_mj.errors", "manipose_mj.failures", "manipose_mj.lazy_exports"),
        "manipose_mj.small_matrices",
    ),
)
# What scans and generators are made into is the package's; robots and tasks are none of the pipeline's business.
PIPELINE_KNOWS = (
    "manipose_mj.grasp_sampling",
    "manipose_mj.assets",
    "manipose_mj.poses",
    "manipose_mj.storage",
    "manipose_mj.console",
    "manipose_mj.errors",
    "manipose_mj.lazy_exports",
    "manipose_mj.warp_physics",
)
DOOR = "manipose_mj.assets.catalogue"
# Folders with one generator per category.
GENERATORS = ("axial", "functional", "mirror")
MOST_MODULES = 20


@cache
def modules() -> dict[str, Path]:
    """Every module of both packages, by its dotted name."""
    found = {}
    for package in PACKAGES:
        for file in sorted((ROOT / package).rglob("*.py")):
            name = ".".join(file.relative_to(ROOT).with_suffix("").parts)
            found[name.removesuffix(".__init__")] = file
    return found


@cache
def imported(module: str) -> frozenset[str]:
    """The modules of both packages that a module imports, wherever in its text."""
    names = set()
    for node in ast.walk(ast.parse(modules()[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: relative import"
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                names.add(full if full in modules() else str(node.module))
    return frozenset(names & modules().keys()) - {module}


def inside(module: str, package: str) -> bool:
    return module == package or module.startswith(f"{package}.")


def layer(module: str) -> int:
    """How high a module of `manipose_mj` stands; 0 is the highest."""
    found = [i for i, line in enumerate(ORDER) if any(inside(module, each) for each in line)]
    assert found, f"{module}: belongs to no line of ORDER"
    return found[0]


def sisters(module: str, other: str) -> bool:
    """Whether two modules of one line belong to different packages of it."""
    line = ORDER[layer(module)]
    own = [each for each in line if inside(module, each)]
    return not any(inside(other, each) for each in own)


def test_packages_import_only_what_is_below_them():
    wrong = []
    for module in modules():
        if module == "manipose_mj" or not inside(module, "manipose_mj"):
            continue
        for other in imported(module):
            if not inside(other, "manipose_mj"):
                continue
            upwards = layer(other) < layer(module)
            if upwards or (layer(other) == layer(module) and sisters(module, other)):
                wrong.append(f"{module} imports {other}")
    assert not wrong


def test_the_package_reaches_the_pipeline_through_one_door():
    wrong = [
        f"{module} imports {other}"
        for module in modules()
        if inside(module, "manipose_mj") and module != DOOR
        for other in imported(module)
        if inside(other, "asset_pipeline")
    ]
    assert not wrong


def test_the_pipeline_knows_the_asset_contract_and_what_is_below_it():
    wrong = [
        f"{module} imports {other}"
        for module in modules()
        if inside(module, "asset_pipeline")
        for other in imported(module)
        if inside(other, "manipose_mj") and not any(inside(other, p) for p in PIPELINE_KNOWS)
    ]
    assert not wrong


def test_no_modules_import_each_other_in_a_circle():
    try:
        TopologicalSorter({module: imported(module) for module in modules()}).prepare()
    except CycleError as error:
        pytest.fail(f"circle: {' -> '.join(error.args[1])}")


def test_no_folders_import_each_other_in_a_circle():
    """A folder is the modules side by side in it; the door and those of a package's own root stand for themselves."""
    packages = {m for m, file in modules().items() if file.name == "__init__.py"}

    def folder(module: str) -> str:
        parent = module.rpartition(".")[0]
        alone = module in packages or module == DOOR or "." not in parent
        return module if alone else parent

    graph: dict[str, set[str]] = {}
    for module in modules():
        others = {folder(other) for other in imported(module)}
        graph.setdefault(folder(module), set()).update(others - {folder(module)})
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(f"circle: {' -> '.join(error.args[1])}")


def test_a_folder_can_be_read_at_a_glance():
    files = [*modules().values(), *(ROOT / "benchmarks").rglob("*.py")]
    folders = Counter(file.parent for file in files if file.name != "__init__.py")
    wrong = {
        folder.relative_to(ROOT).as_posix(): count
        for folder, count in folders.items()
        if count > MOST_MODULES and folder.name not in GENERATORS
    }
    assert not wrong


def test_low_packages_load_no_simulator():
    for module in ("poses", "errors", "failures", "evaluation.protocol.frozen"):
        text = modules()[f"manipose_mj.{module}"].read_text(encoding="utf-8")
        assert "import mujoco" not in text and "dm_control" not in text


LOAD = """
import sys
import manipose_mj, manipose_mj.poses
assert not any(m.split('.')[0] in ('mujoco', 'dm_control') for m in sys.modules), 'eager import'
from manipose_mj import suite
import manipose_mj.evaluation.episode
assert 'mujoco.renderer' not in sys.modules
environment = suite.load(*suite.ALL_TASKS[0], seed=0, obs_mode='state+depth')
depth = environment.reset().observation['depth/front']
assert (depth > 0).any()
"""


@pytest.mark.sample(1)
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
        [sys.executable, "-c", LOAD],
        env=variables,
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ended.returncode == 0, ended.stderr
    assert "display" not in ended.stderr.lower(), ended.stderr


PUBLIC = tuple(
    name
    for name, file in modules().items()
    if file.name == "__init__.py" and "lazy_exports(" in file.read_text(encoding="utf-8")
)


def test_packages_offer_names_without_loading_what_defines_them():
    script = f"""
import importlib, sys
packages = [importlib.import_module(name) for name in {PUBLIC}]
loaded = {{name.split('.')[0] for name in sys.modules}} & {{'numpy', 'trimesh', 'mujoco', 'jax'}}
assert not loaded, loaded
for package in packages:
    assert package.__all__
    for name in package.__all__:
        getattr(package, name)
"""
    ended = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", script],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ended.returncode == 0, ended.stderr


START = """
import sys, time
start = time.process_time()
import manipose_mj
print(time.process_time() - start)
heavy = {name.split('.')[0] for name in sys.modules} & {
    'jax', 'matplotlib', 'mujoco', 'dm_control', 'numpy', 'scipy', 'trimesh', 'equinox', 'rich', 'tyro'
}
assert not heavy, heavy
"""


def test_importing_the_package_is_quick_and_loads_no_library():
    """Processor time, which a busy machine does not lengthen; the middle of three."""
    times = []
    for _ in range(3):
        ended = subprocess.run(
            [sys.executable, "-c", START], cwd=ROOT, capture_output=True, text=True, timeout=60
        )
        assert ended.returncode == 0, ended.stderr
        times.append(float(ended.stdout))
    assert sorted(times)[1] < 0.3


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
