"""The documentation's pages as tests read them: their words, links, headings and code."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from tests.places import ROOT

DOCS = ROOT / "docs"
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCS.rglob("*.md")])
_FENCED = re.compile(r"^```(\w*)\n(.*?)^```", re.DOTALL | re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """A fenced block. Attributes: code; line: of its first line."""

    code: str
    line: int


def name(page: Path) -> str:
    """A page's path in the repository."""
    return str(page.relative_to(ROOT))


def read(page: Path) -> str:
    """A page's text."""
    return page.read_text(encoding="utf-8")


def blocks(page: Path, language: str) -> list[Block]:
    """A page's fenced blocks of one language, in order."""
    text = read(page)
    return [
        Block(match[2], text.count("\n", 0, match.start()) + 2)
        for match in _FENCED.finditer(text)
        if match[1] == language
    ]


def without_code(page: Path) -> str:
    """A page's text with its fenced blocks emptied; lines keep their numbers."""
    return _FENCED.sub(lambda match: "\n" * match[0].count("\n"), read(page))


def anchors(page: Path) -> set[str]:
    """The names that headings get, as MkDocs and GitHub make them."""
    titles = re.findall(r"^#{1,6} (.+)$", without_code(page), re.MULTILINE)
    plain = [re.sub(r"[`*]|\[([^]]*)\]\([^)]*\)", r"\1", title).lower() for title in titles]
    return {re.sub(r"[\s-]+", "-", re.sub(r"[^\w\s-]", "", title).strip()) for title in plain}


def links(page: Path) -> list[str]:
    """Targets of a page's links and pictures."""
    text = re.sub(r"`[^`\n]*`", "", without_code(page))
    return re.findall(r"\]\(([^)\s]+)\)", text)
