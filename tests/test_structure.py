"""What a reader may count on: short files, standard words, nothing written twice, packages that ship whole."""

from __future__ import annotations

import ast
import re
import tokenize
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest

from tests.places import ROOT

LIBRARY = ("manipose_mj", "asset_pipeline")
CODE = (*LIBRARY, "tests", "benchmarks", "plugins", "docs/plots")
MOST_LINES = 400
MOST_SHARED = 12
# Private words for what has a name in the field; parts of identifiers, between underscores or capitals.
WORDS = {
    "handicap": "ambiguity penalty",
    "relatives": "ambiguous rotations",
    "kin": "ambiguous rotations",
    "spoil|spoiled|spoiling": "outlier augmentation",
    "graft|grafts|grafted|grafting": "part-swap augmentation",
    "judge|judged|doubt|doubts": "pose scorer; expected rotation error",
    "faced|righted": "canonicalised; axis refined",
    "close look": "region of interest",
    "front edges?": "plane-edge alignment",
    "flattened": "two-network fusion",
    "home (box|cabinet|furniture|oven|microwave|part|parts)": "synthetic furniture",
    "senses": "perception",
    "belief": "scene estimate",
    "posed things?|landmarks?|wanted poses?": "frames; extra frames; goal frame",
    "movable|furnishings?|things?": "objects; articulated objects; object",
    "clearing|carrying": "rearrangement; transport",
    "part holds?": "handle grasps",
    "nudge": "contact allowance",
    "open hand|pad contact": "gripper clearance; contact patch",
    "link looks?": "link visuals",
    "strange answers?": "false positives",
    "turned round": "flipped",
}
# The same as names of types; as variables they are plain English, or mechanics.
TYPES = {
    "Carried": "BodyFrame; AttachedObject",
    "Lain": "Placement",
    "Moment": "StepCache",
    "MomentCache": "StepCache",
    "Wanted": "GoalFrame",
}
WORD = re.compile(rf"\b(?:{'|'.join(WORDS)})\b")


@cache
def files(folders: tuple[str, ...] = CODE) -> tuple[Path, ...]:
    return tuple(sorted(file for folder in folders for file in (ROOT / folder).rglob("*.py")))


def name(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


def words(identifier: str) -> str:
    """The words of an identifier or a file's name, in small letters, with spaces between."""
    split = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", identifier)
    return re.sub(r"[_\W]+", " ", split).strip().lower()


def identifiers(file: Path) -> set[str]:
    with tokenize.open(file) as text:
        return {
            t.string for t in tokenize.generate_tokens(text.readline) if t.type == tokenize.NAME
        }


def shared_lines(texts: dict[str, list[tuple[int, str]]], most: int) -> list[tuple[str, str]]:
    """Pairs of places, as `file:line`, where more than `most` lines in a row are equal.

    Args:
      texts: By file, its lines that count, each with its number.
    """
    places: dict[tuple[str, ...], list[tuple[str, int]]] = defaultdict(list)
    for file, lines in texts.items():
        for i in range(len(lines) - most):
            window = tuple(line for _, line in lines[i : i + most + 1])
            places[window].append((file, i))
    found = {}
    for homes in places.values():
        first, *others = homes
        for other in others:  # windows of one long passage differ by their start alone
            passage = (first[0], other[0], first[1] - other[1])
            found.setdefault(passage, (first, other))
    return [
        (f"{one}:{texts[one][i][0]}", f"{two}:{texts[two][j][0]}")
        for (one, i), (two, j) in found.values()
    ]


def code_lines(file: Path) -> list[tuple[int, str]]:
    """Lines without blanks, comments, imports and indentation; docstrings count, since they are copied too."""
    text = file.read_text(encoding="utf-8")
    imports = {
        line
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Import | ast.ImportFrom)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    return [
        (i, line.strip())
        for i, line in enumerate(text.splitlines(), 1)
        if i not in imports and line.strip() and not line.strip().startswith("#")
    ]


def test_files_are_short():
    long = {name(file): len(file.read_text(encoding="utf-8").splitlines()) for file in files()}
    assert not {file: lines for file, lines in long.items() if lines > MOST_LINES}


def test_no_passage_of_library_code_is_written_twice():
    texts = {name(file): code_lines(file) for file in files(LIBRARY)}
    assert not shared_lines(texts, MOST_SHARED)


def test_the_detector_finds_a_copied_passage_and_nothing_shorter():
    passage = [f"step_{i}()" for i in range(MOST_SHARED + 1)]
    one = list(enumerate(["start()", *passage, "end()"], 1))
    two = list(enumerate(["other()", "more()", *passage], 1))
    assert shared_lines({"a": one, "b": two}, MOST_SHARED) == [("a:2", "b:3")]
    assert shared_lines({"a": one, "b": two[:-1]}, MOST_SHARED) == []
    twice = list(enumerate([*passage, *passage], 1))
    assert shared_lines({"a": twice}, MOST_SHARED)


def test_code_speaks_the_words_of_the_field():
    found = sorted(
        {
            f"{name(file)}: {each}"
            for file in files()
            for each in (identifiers(file) | {file.stem.removeprefix("test_")})
            if not each.startswith("test_")  # names of tests are prose
            and (each in TYPES or WORD.search(words(each)))
        }
    )
    assert not found


@pytest.mark.parametrize(
    ("identifier", "private"),
    [
        ("PosedThing", True),
        ("_close_look", True),
        ("link_looks", True),
        ("kinematics", False),
        ("layers", False),
        ("judgement", False),
        ("PartHolds", True),
    ],
)
def test_private_words_are_found_as_parts_of_identifiers(identifier, private):
    assert bool(WORD.search(words(identifier))) == private


def test_every_folder_of_modules_is_a_package():
    """setuptools finds only those: modules elsewhere would be missing from the wheel."""
    folders = {file.parent for file in files(LIBRARY)}
    assert not [name(folder) for folder in folders if not (folder / "__init__.py").is_file()]


def test_imports_are_absolute():
    wrong = [
        f"{name(file)}:{node.lineno}"
        for file in files()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.level
    ]
    assert not wrong
