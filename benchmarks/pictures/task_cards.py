"""Write a card for every task, with a picture of its start: python benchmarks/pictures/task_cards.py [docs/tasks].

The text comes from the factories' docstrings, the protocol and the tasks themselves; a test holds it to that.
"""

from __future__ import annotations

import inspect
import io
from math import degrees
from pathlib import Path

import tyro
from dm_control import composer
from PIL import Image

from manipose_mj import suite
from manipose_mj.assets import catalogue
from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.protocol.freeze import builtin_tasks
from manipose_mj.evaluation.protocol.frozen import FrozenTask
from manipose_mj.gym import env_id
from manipose_mj.mjcf.cameras.pictures import render
from manipose_mj.tasks.core.registry import TaskSpec

SEED = 0  # of the episode whose start is drawn
WIDTH, HEIGHT, COLOURS = 400, 300, 128


def head(spec: TaskSpec) -> str:
    """What a card says without building the task: names, docstring, objects, horizon, tolerances."""
    frozen = protocol.load(protocol.VERSIONS[0])
    fixed, tolerance = frozen.task(spec.full_name), frozen.task(spec.full_name).tolerance
    lines = [
        f"# `{spec.full_name}`",
        spec.summary,
        f"![The start of an episode]({spec.name}.png)",
        *([spec.description] if spec.description else []),
        "| | |\n| --- | --- |\n"
        + "\n".join(
            f"| {name} | {value} |"
            for name, value in (
                ("dm_control", f'`suite.load("{spec.domain}", "{spec.name}")`'),
                ("Gymnasium", f"`{env_id(spec.name)}`"),
                ("tags", ", ".join(spec.tags)),
                ("horizon", f"{fixed.horizon:g} s"),
                (
                    "a pose is met within",
                    f"{100 * tolerance['translation']:g} cm and {degrees(tolerance['rotation']):g} deg",
                ),
                (
                    "an object is at rest under",
                    f"{100 * tolerance['linear_speed']:g} cm/s and "
                    f"{tolerance['angular_speed']:g} rad/s",
                ),
                (f"objects of protocol {frozen.version}", _objects(fixed)),
                (
                    f"protocol {frozen.version}",
                    f"{len(fixed.seeds)} episodes, seeds {', '.join(map(str, _first(fixed, 3)))}, ...",
                ),
            )
        ),
    ]
    return "\n\n".join(lines) + "\n"


def _objects(fixed: FrozenTask) -> str:
    """How many there are, of which categories."""
    categories = sorted({catalogue.find(name)[0] for name in fixed.objects})
    count = f"{len(fixed.objects)} of {len(categories)} categories"
    return count if len(categories) > 6 else f"{count}: {', '.join(fixed.objects)}"


def card(spec: TaskSpec, environment: composer.Environment) -> str:
    """The whole card.

    Args:
      spec: Of the task.
      environment: Of it, after a reset, with the observations `state+pose`.
    """
    goals = dict.fromkeys(type(goal) for goal in environment.task.goals)
    lines = [head(spec), "## Goals", "", "Success is all of:", ""]
    for goal in goals:
        sentence = " ".join((inspect.getdoc(goal) or "").partition("\n\n")[0].split())
        lines.append(f"- `{goal.__name__}`: {sentence}")
    lines += [
        "",
        "## Observations",
        "",
        "With `state+pose`; [Observations](../../guides/observations.md) explains the keys, images and clouds.",
        "",
    ]
    lines += ["| key | shape | type |", "| --- | --- | --- |"]
    for name, array in environment.observation_spec().items():
        lines.append(f"| `{name}` | {tuple(array.shape)} | {array.dtype} |")
    return "\n".join(lines) + "\n"


FAMILIES = {
    "single_object": "Single objects",
    "clutter": "Clutter",
    "articulated": "Furniture",
}
HEAD = """# Tasks

*Written by `python benchmarks/pictures/task_cards.py`.*

Each card holds a task's goals, tolerances, objects, seeds and observations. [Protocol v1](../results/protocol_v1.md) holds the baseline's
success rates.
"""


def index() -> str:
    """The gallery of the cards, by families."""
    specs = sorted(builtin_tasks(), key=lambda spec: spec.full_name)
    sections = [HEAD]
    for domain, title in FAMILIES.items():
        sections.append(f'## {title}\n\n<div class="gallery" markdown>\n')
        sections += [
            f"- [![{spec.name}]({domain}/{spec.name}.png)]({domain}/{spec.name}.md)\n\n"
            f"    [`{spec.full_name}`]({domain}/{spec.name}.md)\n\n    {spec.summary}\n"
            for spec in specs
            if spec.domain == domain
        ]
        sections.append("</div>\n")
    return "\n".join(sections)


def built(spec: TaskSpec) -> composer.Environment:
    """The environment that a card describes, at the start of an episode."""
    environment = suite.load(spec.domain, spec.name, seed=SEED, obs_mode="state+pose")
    environment.reset()
    return environment


def picture(environment: composer.Environment) -> bytes:
    """The start as a small PNG, drawn by rays: the same on every machine."""
    physics = environment.physics
    pixels = render(physics.model.ptr, physics.data.ptr, "overview", HEIGHT, WIDTH, engine="ray")
    small = Image.fromarray(pixels).quantize(COLOURS, dither=Image.Dither.NONE)
    file = io.BytesIO()
    small.save(file, "PNG", optimize=True)
    return file.getvalue()


def main(out: tyro.conf.Positional[Path] = Path("docs/tasks"), only: tuple[str, ...] = ()) -> None:
    """Write the cards.

    Args:
      out: Their folder.
      only: Tasks whose cards to write; all by default.
    """
    for spec in builtin_tasks():
        if only and spec.full_name not in only:
            continue
        environment = built(spec)
        folder = out / spec.domain
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{spec.name}.md").write_text(card(spec, environment), encoding="utf-8")
        (folder / f"{spec.name}.png").write_bytes(picture(environment))
        environment.close()
        print(spec.full_name)
    (out / "README.md").write_text(index(), encoding="utf-8")


def _first(fixed: protocol.FrozenTask, count: int) -> list[int]:
    return list(fixed.seeds.values())[:count]


if __name__ == "__main__":
    tyro.cli(main)
