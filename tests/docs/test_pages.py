"""Pages are short, keep to the glossary, tell no history, and every link in them leads somewhere."""

from __future__ import annotations

import re

import pytest

from tests.docs.pages import DOCS, PAGES, anchors, links, name, read, without_code
from tests.places import ROOT

MOST_WORDS, MOST_WORDS_README = 1500, 600
# Words of this project's own that the field has another word for; `nudge:` is a field of labels.yaml.
PRIVATE = (
    r"handicap\w*|relatives|kin|spoil\w*|graft\w*|judg\w*|doubt\w*|faced|settled|righted|flattened|FlattenedEstimator"
    r"|close looks?|front edges|home_\w+|Senses|\w+Senses|Beliefs?|posed_things|landmarks|furnishings|part_holds"
    r"|open_hand|pad_contact|link looks|strange answers|strange|turned round|the wrong way round|made anew|anew"
    r"|things?|movable|nudges?(?!:)|being made"
)
# A page says what holds today, not how its numbers came about.
HISTORY = r"before it was|at the last stop|the defaults then|used to be|formerly|earlier changes|has become|have become|since then"
OUTSIDE = ("https://", "mailto:")


def lines_with(page, pattern: str) -> list[str]:
    """Lines outside code that hold a word of the pattern, with their numbers."""
    text = re.sub(r"`[^`\n]*`", "``", without_code(page))
    found = re.compile(rf"\b(?:{pattern})\b", re.IGNORECASE)
    return [
        f"{name(page)}:{number}: {match[0]!r}"
        for number, line in enumerate(text.splitlines(), 1)
        for match in found.finditer(line)
    ]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_a_page_is_short(page):
    most = MOST_WORDS_README if page == ROOT / "README.md" else MOST_WORDS
    assert len(read(page).split()) <= most


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_a_page_has_one_title(page):
    titles = re.findall(r"^# .+$", without_code(page), re.MULTILINE)
    assert len(titles) == 1 and read(page).startswith(titles[0])


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_a_page_keeps_to_the_glossary(page):
    assert lines_with(page, PRIVATE) == []


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_a_page_tells_no_history(page):
    assert lines_with(page, HISTORY) == []


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page):
    for link in links(page):
        if link.startswith(OUTSIDE):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.is_file(), f"{name(page)} links to {link}, which does not exist"
        if anchor:
            assert anchor in anchors(target), f"{name(page)} links to {link}: no such heading"


def test_every_experiment_asks_shows_and_concludes():
    index = read(DOCS / "experiments" / "index.md")
    for page in sorted((DOCS / "experiments").glob("*.md")):
        if page.name == "index.md":
            continue
        text = read(page)
        assert "**Question.**" in text and "**Conclusion.**" in text, name(page)
        assert re.search(r"^\| ?-", text, re.MULTILINE) or "![" in text, (
            f"{name(page)}: no table, no plot"
        )
        assert f"]({page.name})" in index, f"{name(page)} is not in the index"


def test_nothing_is_left_of_pages_that_moved():
    """Code and tests name pages that exist."""
    for folder in ("manipose_mj", "asset_pipeline", "tests", "benchmarks"):
        for file in (ROOT / folder).rglob("*.py"):
            for path in re.findall(
                r"\bdocs/[\w/]+\.(?:md|webp|png)", file.read_text(encoding="utf-8")
            ):
                assert (ROOT / path).is_file() or "docs/plots/" in path, f"{file} names {path}"
