"""The site and an evaluation's report in a browser: complete, readable on a phone, readable in the dark."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.report.html import write_report
from manipose_mj.evaluation.runner import evaluate
from tests.docs.browser import browser
from tests.evaluation import fake_episodes as fake
from tests.places import ROOT

pytestmark = pytest.mark.full
PHONE, DESK = 400, 1280
READABLE = 4.5  # WCAG 2, level AA, body text


@pytest.fixture(scope="module")
def chromium(tmp_path_factory):
    with browser(tmp_path_factory.mktemp("chromium")) as window:
        yield window


@pytest.fixture(scope="module")
def site(tmp_path_factory, chromium) -> Path:
    """The site, built as `make docs` builds it."""
    pytest.importorskip("mkdocs", reason="needs the extra docs (mkdocs)")
    out = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(out)],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return out


@pytest.fixture(scope="module")
def report(tmp_path_factory, chromium) -> Path:
    """The report of an evaluation with successes and failures of several kinds."""
    out = tmp_path_factory.mktemp("evaluation")
    evaluate(EvaluationConfig(fake.TASKS, out, episodes=8), runner=fake.make_runner())
    return write_report(out, scene=fake.scene)


def faults(window, page: Path, *, width: int, dark: bool) -> list[str]:
    """What is wrong with a page at this width and in this scheme."""
    window.open(page, width=width, dark=dark)
    found = [f"console: {line}" for line in window.complaints()]
    found += [f"picture: {source}" for source in window.broken_pictures()]
    found += [f"overflow: {element}" for element in window.overflow()]
    return found + [f"contrast: {text}" for text in window.faint_text(READABLE)[:5]]


def checked(site: Path) -> list[Path]:
    """Every page, and three of those that one template makes: cards of tasks, the reference."""
    pages = [page for page in sorted(site.rglob("*.html")) if page.name != "404.html"]
    places = [page.relative_to(site).parts for page in pages]
    cards = [page for page, parts in zip(pages, places, strict=True) if len(parts) == 3]
    reference = [page for page, parts in zip(pages, places, strict=True) if parts[0] == "reference"]
    own = [page for page in pages if page not in cards and page not in reference]
    return own + cards[:3] + reference[:3]


@pytest.mark.parametrize(("width", "dark"), [(PHONE, False), (PHONE, True), (DESK, True)])
def test_the_site_is_whole_and_readable(chromium, site, width, dark):
    pages = checked(site)
    assert len(pages) > 40
    found = {
        str(page.relative_to(site)): wrong
        for page in pages
        if (wrong := faults(chromium, page, width=width, dark=dark))
    }
    assert found == {}


@pytest.mark.parametrize("width", [PHONE, DESK])
@pytest.mark.parametrize("dark", [False, True])
def test_the_report_is_whole_and_readable(chromium, report, width, dark):
    assert faults(chromium, report, width=width, dark=dark) == []
    assert chromium.pictures() > 6


def test_the_schemes_differ(chromium, site, report):
    for page in (site / "index.html", report):
        grounds = []
        for dark in (False, True):
            chromium.open(page, width=DESK, dark=dark)
            grounds.append(chromium.background())
        assert grounds[0] != grounds[1]


def test_the_site_asks_no_network(site):
    """No page, script or style sheet loads anything from elsewhere."""
    loads = re.compile(
        r"""(?:src|href)=["']?(?:https?:)?//[^"' >]+\.(?:js|css|woff2?|png|svg|webp)|url\(["']?(?:https?:)?//|@import"""
    )
    for file in [*site.rglob("*.html"), *site.rglob("*.css")]:
        assert not loads.search(file.read_text(encoding="utf-8")), file


def test_faults_are_seen(chromium, tmp_path):
    """A page with one fault of each kind: the checks above can fail."""
    page = tmp_path / "bad.html"
    page.write_text(
        "<!doctype html><body style='background:#fff'><p style='color:#999'>faint</p><img src='none.png'>"
        "<div style='width:900px'>wide</div><script>console.error('broken')</script>",
        encoding="utf-8",
    )
    found = faults(chromium, page, width=PHONE, dark=False)
    kinds = {line.partition(":")[0] for line in found}
    assert kinds == {"console", "picture", "overflow", "contrast"}
