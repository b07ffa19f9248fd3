"""Draw contact sheets of random starts: many episodes of a task on one picture, seed and objects under each.

    python benchmarks/pictures/start_sheets.py --out DIR [--tasks articulated/open_oven ...] [--count 30]
    python benchmarks/pictures/start_sheets.py --out DIR --assets FOLDER [--count 3]     # open and close, part by part
    python benchmarks/pictures/start_sheets.py --out DIR --ends 3                         # how the baseline ends instead

Objects and furniture are those of the test split, or the pieces of furniture in a folder. An end is the last
state of the baseline's episode with true poses.
"""

from __future__ import annotations

import io
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from jaxtyping import UInt8
from PIL import Image

from manipose_mj.evaluation.episode import environment_of, run_episode
from manipose_mj.evaluation.protocol.freeze import builtin_tasks
from manipose_mj.mjcf.cameras.pictures import Engine, render
from manipose_mj.mjcf.views.film import film_strip
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec

sys.path.insert(
    0, str(Path(__file__).parents[1])
)  # its `furniture_table` has the tasks of any part

from furniture_table import assets_in, config_for, handled_parts  # noqa: E402

WIDTH, HEIGHT, COLUMNS = 256, 192, 6
CAMERA, SPLIT = "overview", "test"


@dataclass(frozen=True)
class Options:
    """Options of the command line.

    Attributes:
      out: Folder for the sheets.
      tasks: Whose; all by default.
      count: Starts on a sheet; of each part and verb, where a folder is given.
      first_seed: Of the first start; the others follow.
      ends: Play so many episodes and draw their ends instead of starts.
      assets: Folder of asset folders; a sheet for each piece of furniture instead of each task.
      seconds: After which no more tiles are added to a sheet.
      engine: Which renderer.
    """

    out: Path
    tasks: tuple[str, ...] = ()
    count: int = 30
    first_seed: int = 0
    ends: int = 0
    assets: Path | None = None
    seconds: float = 600.0
    engine: Engine = "auto"


@dataclass(frozen=True)
class Tile:
    """One episode to draw. Attributes: config; spec; words: before what is drawn is named."""

    config: EnvConfig
    spec: EpisodeSpec
    words: str = ""


def main(options: tyro.conf.OmitArgPrefixes[Options]) -> None:
    """Write the sheets, and print one line each."""
    options.out.mkdir(parents=True, exist_ok=True)
    for name, tiles in sheets(options):
        started = time.perf_counter()
        pictures, captions = [], []
        for tile in tiles:
            if pictures and time.perf_counter() - started > options.seconds:
                break
            picture, caption = drawn(tile, options)
            pictures.append(picture)
            captions.append(caption)
        path = options.out / f"{name}.jpg"
        path.write_bytes(sheet(pictures, captions))
        seconds = time.perf_counter() - started
        print(f"{path}: {len(pictures)} of {len(tiles)}, {seconds:.0f} s", flush=True)


def sheets(options: Options) -> Iterator[tuple[str, Sequence[Tile]]]:
    """Names of the sheets and what is on them."""
    seeds = range(options.first_seed, options.first_seed + (options.ends or options.count))
    what = "ends" if options.ends else "starts"
    if options.assets is None:
        for spec in builtin_tasks():
            if not options.tasks or spec.full_name in options.tasks:
                config = EnvConfig(spec.full_name, obs_mode="state", split=SPLIT)
                name = f"{spec.full_name.replace('/', '__')}-{what}"
                yield name, [Tile(config, EpisodeSpec(seed)) for seed in seeds]
        return
    for _, asset in assets_in(options.assets):
        tiles = [
            Tile(
                config_for(asset, part, verb),
                EpisodeSpec(seed, furniture=asset.name, part=part.name),
                verb,
            )
            for part in handled_parts(asset)
            for verb in ("open", "close")
            for seed in seeds
        ]
        if tiles:
            yield f"{asset.name}-{what}", tiles


def drawn(tile: Tile, options: Options) -> tuple[UInt8[np.ndarray, "height width 3"], str]:
    """The picture of a start or an end, and what is written below it."""
    environment, end = environment_of(tile.config), ""
    if options.ends:
        result, _ = run_episode(tile.config, tile.spec)
        end = "done" if result.success_at_end else f"{result.failure}: {result.reason}"
    else:
        environment.reset(tile.spec)
    objects = environment.scene_objects
    names = [] if objects is None else list(dict.fromkeys(each.name for each in objects.assets))
    part = None if objects is None else objects.part
    shown = [tile.words, end, environment.task.object_name, part, *names]
    words = " ".join(dict.fromkeys(word for word in shown if word))
    physics = environment.physics
    picture = render(
        physics.model.ptr, physics.data.ptr, CAMERA, HEIGHT, WIDTH, engine=options.engine
    )
    return picture, f"{tile.spec.seed}: {words}"


def sheet(
    pictures: Sequence[UInt8[np.ndarray, "height width 3"]], captions: Sequence[str]
) -> bytes:
    """Pictures in rows with their captions, as a JPEG."""
    drawing = Image.open(io.BytesIO(film_strip(pictures, captions, columns=COLUMNS)))
    stream = io.BytesIO()
    drawing.convert("RGB").save(stream, "JPEG", quality=85)
    return stream.getvalue()


if __name__ == "__main__":
    main(tyro.cli(tyro.conf.OmitArgPrefixes[Options]))
