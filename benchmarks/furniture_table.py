"""Every handled drawer and door of some furniture, opened and shut by the baseline, part by part.

    python benchmarks/furniture_table.py [--assets DIR] [--only NAME ...] [--skip NAME ...] [--seeds 0 1]
        [--parts NAME ...] [--verbs open close] [--pose estimated] [--jobs 2] [--list]

Without a folder: the catalogue's test cabinets, microwaves and ovens. One line a part and verb: how many of the
seeds succeeded, and why the others did not. Before that, one line a part that is not played, with the reason.
`--list` prints those lines and the parts that are played, and plays none. With `--pose estimated` handles, joints and
openings come from what the cameras see, not from the simulator.
"""

from __future__ import annotations

import argparse
import multiprocessing
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Literal

from manipose_mj.console.process import one_thread_per_process

one_thread_per_process()

from manipose_mj.assets import catalogue  # noqa: E402
from manipose_mj.assets.asset import Asset, MovingPart  # noqa: E402
from manipose_mj.assets.asset_json import read_asset  # noqa: E402
from manipose_mj.assets.categories import CATALOGUE  # noqa: E402
from manipose_mj.control.grasping.candidates import MIN_CLEARANCE  # noqa: E402
from manipose_mj.control.perception.pose_sources import POSE_SOURCES, sensors_for  # noqa: E402
from manipose_mj.evaluation.episode import run_episode  # noqa: E402
from manipose_mj.evaluation.statistics import wilson_interval  # noqa: E402
from manipose_mj.mjcf.panda.robot import MAX_OPENING  # noqa: E402
from manipose_mj.tasks.articulated.object_draw import RequestedFurniture, furniture_alone  # noqa: E402
from manipose_mj.tasks.articulated.open_close import OpenClose, OpenCloseConfig  # noqa: E402
from manipose_mj.tasks.articulated.part_choice import PartChoice, kind_of  # noqa: E402
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec  # noqa: E402
from manipose_mj.tasks.core.registry import DrawnTaskFactory, register_task  # noqa: E402
from manipose_mj.tasks.core.scene_objects import SceneObjects  # noqa: E402

_FURNITURE = ("cabinet", "microwave", "oven")
_SPLIT = "test"
_WIDEST = MAX_OPENING - MIN_CLEARANCE  # that the gripper takes between its fingers [m]
# Names of what opens, as built: `door_0`; the others are knobs, buttons and trays.
_OPENING = ("drawer", "door", "lid", "flap")


@dataclass(frozen=True)
class Case:
    """One part of one asset, to be opened or to be shut, with every seed."""

    folder: Path | None  # None: of the catalogue
    asset: str
    part: str
    verb: str
    seeds: tuple[int, ...]
    pose: str

    def load(self) -> Asset:
        """The asset."""
        if self.folder is not None:
            return read_asset(self.folder)
        category, index = self.asset.rsplit("_", 1)
        return catalogue.load(category, int(index))


@dataclass(frozen=True)
class Row:
    """What came of a case: of each seed an empty string, or why not."""

    case: Case
    kind: str
    width: float
    reasons: tuple[str, ...]
    seconds: float


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--assets", type=Path, help="folder of asset folders")
    parser.add_argument("--only", nargs="+", default=[], help="names of assets")
    parser.add_argument("--skip", nargs="+", default=[], help="names of assets to leave out")
    parser.add_argument("--parts", nargs="+", default=[], help="names of parts")
    parser.add_argument("--verbs", nargs="+", default=["open", "close"])
    parser.add_argument("--pose", choices=POSE_SOURCES, default="oracle")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--list", action="store_true", help="play nothing")
    options = parser.parse_args()
    assets = [
        (folder, asset)
        for folder, asset in assets_in(options.assets)
        if (not options.only or asset.name in options.only) and asset.name not in options.skip
    ]
    for _, asset in assets:
        for line in listed(asset, played=options.list):
            print(line)
    if options.list:
        return
    cases = [
        Case(folder, asset.name, part.name, verb, tuple(options.seeds), options.pose)
        for folder, asset in assets
        for part in handled_parts(asset)
        if not options.parts or part.name in options.parts
        for verb in options.verbs
    ]
    rows = []
    with multiprocessing.get_context("spawn").Pool(options.jobs, maxtasksperchild=8) as pool:
        for row in pool.imap(run, cases):
            rows.append(row)
            print(_line(row), flush=True)
    for verb in options.verbs:
        reasons = [r for row in rows if row.case.verb == verb for r in row.reasons]
        fits = [r for row in rows if row.case.verb == verb and _fits(row) for r in row.reasons]
        done, able = reasons.count(""), fits.count("")
        print(
            f"{verb}, {options.pose}: {done} of {len(reasons)}{_interval(done, len(reasons))}; "
            f"of handles that fit: {able} of {len(fits)}"
        )


def run(case: Case) -> Row:
    """Every seed of a case."""
    started = time.perf_counter()
    asset = case.load()
    part = asset.part(case.part)
    config = replace(config_for(asset, part, case.verb), sensors=sensors_for(case.pose))
    reasons = []
    for seed in case.seeds:
        spec = EpisodeSpec(seed, furniture=asset.name, part=part.name)
        result, _ = run_episode(config, spec, pose=case.pose)
        done = result.success_at_end
        reasons.append("" if done else f"{result.failure}: {result.reason}")
    seconds = time.perf_counter() - started
    return Row(case, kind_of(part), _width(part), tuple(reasons), seconds)


def config_for(asset: Asset, part: MovingPart, verb: str) -> EnvConfig:
    """The environment in which a part with a handle is opened or shut, whatever furniture it is of."""
    _register_tasks()
    task = f"furniture/{verb}_{kind_of(part)}"
    return EnvConfig(task, obs_mode="state", objects=(str(asset.folder),))


def handled_parts(asset: Asset) -> list[MovingPart]:
    """The parts that are played: no task is about a sliding door."""
    return [p for p in asset.parts if p.handle is not None and kind_of(p) != "sliding door"]


def listed(asset: Asset, *, played: bool) -> list[str]:
    """One line for each part that is not played, with the reason; those that are played too, if asked for.

    Knobs and buttons of one asset share a line.
    """
    lines = []
    for part in handled_parts(asset) if played else []:
        across = f"handle of {1000 * _width(part):.0f} mm"
        wide = "" if _width(part) <= _WIDEST else ", wider than the gripper"
        lines.append(f"played  {asset.name:<16}{part.name:<16}{kind_of(part)}: {across}{wide}")
    for part in asset.parts:
        if part.handle is None and not _is_control(part):
            lines.append(f"skipped {asset.name:<16}{part.name:<16}no handle in the data")
    controls = [part.name for part in asset.parts if _is_control(part)]
    if controls:
        lines.append(
            f"skipped {asset.name:<16}{len(controls)} knobs, buttons or trays: no task moves them"
        )
    if not any(word in part.name for part in asset.parts for word in _OPENING):
        lines.append(f"skipped {asset.name:<16}-               no drawer, door or lid moves")
    return lines


def _is_control(part: MovingPart) -> bool:
    return part.handle is None and not any(word in part.name for word in _OPENING)


def _moving(requested: Literal["open", "shut"]) -> DrawnTaskFactory:
    def factory(env_config: EnvConfig, objects: SceneObjects) -> OpenClose:
        (asset,) = objects.assets
        assert objects.part is not None
        config = OpenCloseConfig(requested=requested)
        return OpenClose(asset, asset.part(objects.part), env_config, config)

    factory.__doc__ = "Any part of a kind."
    return factory


@cache
def _register_tasks() -> None:
    """Make the tasks known; not where this is imported only, since every list of tasks would have them too."""
    for kind in ("drawer", "door", "flap"):
        draws = furniture_alone(RequestedFurniture(_FURNITURE, PartChoice((kind,))))
        register_task("furniture", f"open_{kind}", draws=draws, rigid=False)(_moving("open"))
        register_task("furniture", f"close_{kind}", draws=draws, rigid=False)(_moving("shut"))


def assets_in(folder: Path | None) -> Iterator[tuple[Path | None, Asset]]:
    """Furniture of asset folders, each with its folder; None: the catalogue's."""
    if folder is None:
        for category in _FURNITURE:
            row = CATALOGUE[category]
            for index in range(row.instances):
                if row.split(index) == _SPLIT:
                    yield None, catalogue.load(category, index)
        return
    for path in sorted(folder.iterdir()):
        if (path / "asset.json").is_file() and (asset := read_asset(path)).kind == "articulated":
            yield path, asset


def _width(part: MovingPart) -> float:
    """Of the handle's bar, between the fingers [m]."""
    assert part.handle is not None
    return float(min(part.handle.extents[1:]))


def _fits(row: Row) -> bool:
    return row.width <= _WIDEST


def _interval(done: int, count: int) -> str:
    if not count:
        return ""
    low, high = wilson_interval(done, count)
    return f" (95 % interval {low:.0%} to {high:.0%})"


def _line(row: Row) -> str:
    case, done = row.case, row.reasons.count("")
    why = "; ".join(dict.fromkeys(r for r in row.reasons if r))
    wide = "" if _fits(row) else f" [{1000 * row.width:.0f} mm wide]"
    return (
        f"{case.verb:<6}{case.asset:<16}{case.part:<16}{row.kind:<7} "
        f"{done}/{len(row.reasons)} {row.seconds:6.0f} s  {why}{wide}"
    )


if __name__ == "__main__":
    main()
