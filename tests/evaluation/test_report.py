"""The report: everything in one file, pictures of a success and of each kind of failure."""

from __future__ import annotations

import base64
import importlib.util
import io
import json
import os
import re
import time
from html.parser import HTMLParser
from pathlib import Path

import mujoco
import numpy as np
import pytest
from PIL import Image

from manipose_mj.errors import InputError
from manipose_mj.evaluation import film
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.histograms import error_histograms
from manipose_mj.evaluation.records import Trajectory, read_results, trajectory_path
from manipose_mj.evaluation.report import HEIGHT, WIDTH, write_report
from manipose_mj.evaluation.runner import evaluate
from manipose_mj.tasks.success import Tolerance

_spec = importlib.util.spec_from_file_location(
    "fake_episodes", Path(__file__).with_name("fake_episodes.py")
)
assert _spec is not None and _spec.loader is not None
fake = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(fake)

ADDRESS = re.compile(r'src="data:image/webp;base64,([^"]+)"')
VOID = {"meta", "img", "br", "wbr", "link", "hr", "input"}


class Tags(HTMLParser):
    """Collects addresses and checks that every element that opens also closes."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []

    def handle_starttag(self, tag, attrs) -> None:
        self.addresses += [v for k, v in attrs if k in ("src", "href", "xlink:href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs) -> None:
        self.addresses += [v for k, v in attrs if k in ("src", "href", "xlink:href")]

    def handle_endtag(self, tag) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def out(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("evaluation")
    config = EvaluationConfig(fake.TASKS, folder, episodes=12, seed=1)
    evaluate(config, runner=fake.make_runner())
    return folder


@pytest.fixture(autouse=True)
def no_gl(monkeypatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")


@pytest.fixture(scope="module")
def html(out: Path) -> str:
    before = os.environ.get("MUJOCO_GL")
    os.environ["MUJOCO_GL"] = "disable"
    start = time.perf_counter()
    text = write_report(out, scene=fake.scene).read_text(encoding="utf-8")
    assert time.perf_counter() - start < 15
    if before is None:
        del os.environ["MUJOCO_GL"]
    else:
        os.environ["MUJOCO_GL"] = before
    return text


def test_it_is_well_formed_and_needs_nothing_beside_it(html: str) -> None:
    tags = Tags()
    tags.feed(html)
    assert tags.open == []
    assert len(tags.addresses) > 20
    assert all(a.startswith(("data:image/webp;base64,", "#")) for a in tags.addresses)
    assert "url(http" not in html and "<script" not in html


def test_it_shows_six_pictures_of_a_success_and_of_every_kind_of_failure(
    html: str, out: Path
) -> None:
    results, _ = read_results(out / "results.jsonl")
    kinds = {(r.task, r.failure) for r in results}
    pictures = ADDRESS.findall(html)
    assert len(pictures) == 6 * len(kinds) > 18
    sizes = {Image.open(io.BytesIO(base64.b64decode(p))).size for p in pictures}
    assert sizes == {(WIDTH, HEIGHT)}
    for task, stage in kinds:
        first = min((r for r in results if (r.task, r.failure) == (task, stage)), key=lambda r: r.key)
        assert f"episode {first.episode}, seed {first.seed}, mug" in html
        assert first.reason in html
    assert "1.2 s grasp_at" in html
    assert "No animation: GL is switched off" in html


def test_its_numbers_are_those_of_the_summary(html: str, out: Path) -> None:
    summary = json.loads((out / "summary.json").read_text())
    text = re.sub(r"<[^>]+>", " ", html)
    for task, row in summary["tasks"].items():
        low, high = (round(100 * bound) for bound in row["wilson_95"])
        expected = rf"{task}\s+12\s+{row['success_at_end']}\s+{low}–{high} %\s+{row['success_once']}"
        assert re.search(expected, text), task
        for stage, count in row["failures"].items():
            assert f"{stage} {count}" in text
    for version in summary["versions"].values():
        assert version in text
    assert "--episodes 12 --seed 1 --pose oracle" in text


def test_histograms_take_their_colours_from_the_page(html: str) -> None:
    assert html.count("<svg") == 4
    assert "var(--good)" in html and "currentColor" in html
    assert "#010203" not in html


def test_histograms_count_every_episode_once(out: Path) -> None:
    results, _ = read_results(out / "results.jsonl")
    results = [r for r in results if r.task == fake.TASKS[0]]
    far = [r for r in results if r.translation_error is not None and r.translation_error > 0.06]
    translation, rotation = error_histograms(results, Tolerance())
    assert ("≥6" in translation) == bool(far)
    assert "rotation error at the end [deg]" in rotation
    assert error_histograms([], Tolerance()) == []


def test_reasons_are_text_not_markup(tmp_path: Path) -> None:
    def hostile(task, **options):
        raise RuntimeError("<script>alert('x')</script>")

    evaluate(EvaluationConfig(fake.TASKS[:1], tmp_path, episodes=2), runner=hostile)
    html = write_report(tmp_path, scene=fake.scene).read_text(encoding="utf-8")
    assert "<script" not in html and "&lt;script&gt;" in html
    assert "no pictures: the episode left no trajectory" in html


def test_a_scene_that_cannot_be_drawn_costs_only_its_pictures(out: Path) -> None:
    def other(task, **options) -> mujoco.MjModel:
        return mujoco.MjModel.from_xml_string("<mujoco/>")

    path = write_report(out, scene=other)
    html = path.read_text(encoding="utf-8")
    assert "no pictures: 21 states of shape (21, 2) do not fit a scene of 0" in html
    assert not ADDRESS.search(html) and html.count("<svg") == 4


def test_the_scene_is_that_of_the_episode(tmp_path: Path) -> None:
    assets = tmp_path / "assets"
    config = EvaluationConfig(
        fake.TASKS[:1], tmp_path / "out", episodes=3, assets=assets, object_name="bowl"
    )
    results = evaluate(config, runner=fake.make_runner())
    seen = []

    def scene(task, **options):
        seen.append(options)
        return fake.scene(task, **options)

    write_report(tmp_path / "out", scene=scene)
    seeds = {r.seed for r in results}
    assert seen and all(
        o["assets"] == assets and o["object_name"] == "bowl" and o["seed"] in seeds for o in seen
    )


def test_without_an_evaluation_there_is_no_report(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="run the evaluation first"):
        write_report(tmp_path)


class Slate:
    """A painter whose picture tells the state that it was made of."""

    def __init__(self) -> None:
        self.shown: list[float] = []

    def paint(self, data, camera):
        assert camera == "overview"
        self.shown.append(float(data.qpos[0]))
        return np.full((8, 8, 3), round(255 * data.qpos[0]), np.uint8)


def test_an_animation_plays_the_whole_episode_and_stops_at_its_end(out: Path) -> None:
    results, _ = read_results(out / "results.jsonl")
    times = np.arange(301) / 10
    qpos = np.stack([np.linspace(0, 1, 301), np.zeros(301)], axis=1)
    trajectory = Trajectory(times, qpos, ["move_to"] * 301)
    slate = Slate()
    model = fake.scene("", seed=0, assets=None, object_name=None)
    shot = film.shoot(
        film.Film("success", results[0]), model, trajectory, slate, animate=True
    )
    assert len(shot.stills) == 6
    assert slate.shown[:6] == pytest.approx([0, 0.2, 0.4, 0.6, 0.8, 1.0], abs=0.01)
    assert slate.shown[6] == 0 and slate.shown[-1] == 1
    assert shot.animation is not None
    moving = Image.open(io.BytesIO(base64.b64decode(shot.animation.partition(",")[2])))
    durations = []
    for frame in range(moving.n_frames):
        moving.seek(frame)
        durations.append(moving.info["duration"])
    assert sum(durations[:-1]) / 1000 == pytest.approx(6, abs=0.3)
    assert durations[-1] >= 1000, "the last picture must stay"
    assert shot.speed == pytest.approx(30 / 6, rel=0.02)


def test_short_episodes_have_as_many_pictures_as_states(out: Path) -> None:
    results, _ = read_results(out / "results.jsonl")
    model = fake.scene("", seed=0, assets=None, object_name=None)
    one = Trajectory(np.zeros(1), np.zeros((1, 2)), ["move_to"])
    shot = film.shoot(film.Film("success", results[0]), model, one, Slate(), animate=True)
    assert len(shot.stills) == 1


def test_a_damaged_trajectory_costs_only_its_pictures(tmp_path: Path) -> None:
    results = evaluate(
        EvaluationConfig(fake.TASKS[:1], tmp_path, episodes=1), runner=fake.make_runner()
    )
    path = trajectory_path(tmp_path, results[0].task, 0)
    path.write_bytes(path.read_bytes()[:50])
    assert "not a trajectory" in write_report(tmp_path, scene=fake.scene).read_text("utf-8")
