"""The report: one file that stands alone, with what each episode looked like."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import tests.evaluation.fake_episodes as fake
from manipose_mj.errors import InputError
from manipose_mj.evaluation import records
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.records import Trajectory, read_results
from manipose_mj.evaluation.report import film
from manipose_mj.evaluation.report.film import Playback, choose, shoot
from manipose_mj.evaluation.report.histograms import error_histograms
from manipose_mj.evaluation.report.html import write_report
from manipose_mj.evaluation.runner import evaluate
from manipose_mj.tasks.goals import Tolerance

VOID = {"meta", "img", "br", "wbr", "path", "use", "rect", "circle", "line"}


class Outline(HTMLParser):
    """What a page is made of, and whether its elements nest."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.attributes: list[tuple[str, dict[str, str | None]]] = []
        self.feed(html)

    def handle_starttag(self, tag, attrs) -> None:
        self.attributes.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs) -> None:
        self.attributes.append((tag, dict(attrs)))

    def handle_endtag(self, tag) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.attributes if name == tag]


@pytest.fixture(scope="module")
def evaluation(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("evaluation")
    config = EvaluationConfig(fake.TASKS, out, episodes=8, objects=("mug<&>",))
    evaluate(config, runner=fake.make_runner())
    return out


@pytest.fixture(scope="module")
def page(evaluation: Path) -> str:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(film, "STILL_SIZE", (30, 40))
        small = Playback(height=30, width=40, fps=2.0)
        patch.setattr("manipose_mj.evaluation.report.html.WITHOUT_GL", small)
        patch.setattr("manipose_mj.evaluation.report.html.WITH_GL", small)
        return write_report(evaluation, scene=fake.scene).read_text(encoding="utf-8")


def pictures(page: str) -> list[Image.Image]:
    sources = [str(attributes["src"]) for attributes in Outline(page).all("img")]
    assert all(s.startswith("data:image/webp;base64,") for s in sources)
    return [Image.open(io.BytesIO(base64.b64decode(s.partition(",")[2]))) for s in sources]


def test_page_stands_alone_and_nests(page: str) -> None:
    outline = Outline(page)
    assert outline.open == []
    for _, attributes in outline.attributes:
        for name in ("src", "href", "xlink:href"):
            value = attributes.get(name) or "#"
            assert value.startswith(("data:", "#")), f"{name}={value[:60]} is outside the file"
    assert not outline.all("script") and not outline.all("link")
    assert "url(http" not in page and "@import" not in page


def test_page_says_what_was_run(page: str, evaluation: Path) -> None:
    assert "instance masks from <b>none</b>" in page
    text = re.sub(r"<wbr>|</?span[^>]*>", "", page)
    for task in fake.TASKS:
        assert task in text
    assert "mug&lt;&amp;&gt;" in text and "mug<&>" not in text, "names are not escaped"
    assert "manipose evaluate single_object/target_pose" in text
    for version in ("mujoco <b>3.", "base seed 0"):
        assert version in page.replace("<span>", "")


@pytest.mark.parametrize(
    ("resample", "starts"), [(None, "frozen starts"), (7, "starts resampled from 7")]
)
def test_page_of_a_protocol_names_it(tmp_path, monkeypatch, resample, starts):
    monkeypatch.setattr(film, "STILL_SIZE", (30, 40))
    for name in ("WITHOUT_GL", "WITH_GL"):
        small = Playback(height=30, width=40, fps=2.0)
        monkeypatch.setattr(f"manipose_mj.evaluation.report.html.{name}", small)
    task = ("single_object/target_pose",)
    config = EvaluationConfig(task, tmp_path, episodes=1, protocol="v1", resample=resample)
    evaluate(config, runner=fake.make_runner())
    page = write_report(tmp_path, scene=fake.scene).read_text(encoding="utf-8")
    assert f"protocol v1, {starts}" in " ".join(page.split()) and "base seed" not in page


def test_each_kind_of_ending_has_its_strip(page: str, evaluation: Path) -> None:
    results, _ = read_results(evaluation / "results.jsonl")
    kinds = {(r.task, r.failure) for r in results}
    assert {None} < {failure for _, failure in kinds}, "the fake episodes should fail, too"
    assert page.count("<figure>") == len(kinds)
    for task, failure in kinds - {(t, None) for t in fake.TASKS}:
        first = next(r for r in results if (r.task, r.failure) == (task, failure))
        assert f'{first.reason}<span class="quiet"> · episode {first.episode},' in page
    shown = pictures(page)
    moving = [p for p in shown if getattr(p, "is_animated", False)]
    assert len(moving) == 2, "one animation for each task's success"
    assert len(shown) == 6 * len(kinds) + len(moving)


def test_a_strip_shows_the_episode_in_order(page: str) -> None:
    captions = re.findall(r'alt="([\d.]+ s [a-z_]+)"', page)[:6]
    assert captions == [
        f"{t:.1f} s {name}"
        for t, name in zip(
            (0.0, 0.4, 0.8, 1.2, 1.6, 2.0),
            ("move_to",) * 2 + ("grasp_at",) * 2 + ("release",) * 2,
            strict=True,
        )
    ]
    stills = [p for p in pictures(page) if not getattr(p, "is_animated", False)]
    arrays = [np.asarray(p.convert("RGB"), float) for p in stills[:6]]
    assert all(a.shape == (30, 40, 3) for a in arrays)
    assert all(np.abs(a - b).mean() > 0.5 for a, b in zip(arrays, arrays[1:], strict=False))


@pytest.mark.full
def test_what_cannot_be_drawn_is_said(evaluation: Path) -> None:
    def lost(env_config, spec):
        raise InputError("assets: no such folder")

    page = write_report(evaluation, jobs=2, scene=lost).read_text(encoding="utf-8")
    assert page.count("no pictures: assets: no such folder") == page.count("<figure>")


def test_an_episode_without_trajectory_keeps_its_place(tmp_path: Path) -> None:
    def crashing(env_config, spec, **options):
        raise FloatingPointError("qacc is not finite")

    evaluate(EvaluationConfig(fake.TASKS[:1], tmp_path, episodes=2), runner=crashing)
    page = write_report(tmp_path, scene=fake.scene).read_text(encoding="utf-8")
    assert "the episode left no trajectory" in page
    assert "qacc is not finite" in page


def test_a_reason_with_half_a_character_does_not_lose_the_page(tmp_path: Path) -> None:
    evaluate(EvaluationConfig(fake.TASKS[:1], tmp_path, episodes=4), runner=fake.make_runner())
    first = read_results(tmp_path / "results.jsonl")[0][0]
    broken = replace(first, success_at_end=False, failure="plan", reason="no \ud83d")
    records.write_sorted(tmp_path / "results.jsonl", [broken])
    assert "no ?" in write_report(tmp_path, scene=fake.scene).read_text(encoding="utf-8")


def test_a_folder_without_evaluation_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="run the evaluation first"):
        write_report(tmp_path, scene=fake.scene)


def test_a_trajectory_of_another_scene_is_refused(evaluation: Path) -> None:
    results, _ = read_results(evaluation / "results.jsonl")
    model = fake.scene(None, None)
    other = Trajectory(np.zeros(3), np.zeros((3, 5), np.float32), ["", "", ""])
    with pytest.raises(ValueError, match="do not fit a scene of 2"):
        shoot(choose(results)[0], model, other, None)


def test_histograms_count_every_episode(evaluation: Path) -> None:
    results, _ = read_results(evaluation / "results.jsonl")
    svgs = error_histograms(results, Tolerance())
    assert len(svgs) == 2
    for svg in svgs:
        assert "currentColor" in svg and "var(--good)" in svg
        assert "#010203" not in svg, "a stand-in colour is left"
    assert svgs == error_histograms(results, Tolerance()), "the drawing does not repeat"
    none = [
        records.EpisodeResult(**{**vars(r), "translation_error": None, "rotation_error": None})
        for r in results
    ]
    assert error_histograms(none, Tolerance()) == []
