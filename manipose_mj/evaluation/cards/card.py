"""Making cards and checking them: a card is a function of what its makers say and of their results."""

from __future__ import annotations

import json
import math
import re
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path, PurePosixPath
from statistics import fmean
from typing import Any

from manipose_mj.errors import InputError
from manipose_mj.evaluation.cards.markdown import OWN_CODE, card_markdown
from manipose_mj.evaluation.cards.method import method_of
from manipose_mj.evaluation.cards.run_record import RunRecord, read_run
from manipose_mj.evaluation.cards.text import is_line
from manipose_mj.evaluation.records import write_atomically
from manipose_mj.evaluation.results_folder import RESULTS_FILE, RUN_FILE
from manipose_mj.evaluation.statistics import summarize

CARD_FILE, TEXT_FILE, SCHEMA_VERSION = "card.json", "card.md", 1
# Neither HTML nor Markdown can end within one; all else is written as %20 and the like.
_ADDRESS = re.compile(r"https://[A-Za-z0-9._~:/?#@!$&*+,;=%-]+")
# Of a task's statistics, what a card states.
STATED = ("success_at_end", "success_once", "wilson_95", "wilson_95_once", "failures")


@dataclass(frozen=True)
class About:
    """What the makers of a method say of it.

    Attributes:
      name: Of the method.
      code_url: Where its code is: an address, or `OWN_CODE` for what comes with this package.
      training_data: What it was trained on, or `none`.

    Raises:
      InputError: Something is empty, or no address.
    """

    name: str
    code_url: str
    training_data: str

    def __post_init__(self) -> None:
        for field, value in asdict(self).items():
            if not is_line(value):
                raise InputError(f"{field} is {value!r}; expected one line of text")
        if not _ADDRESS.fullmatch(self.code_url) and self.code_url != OWN_CODE:
            raise InputError(
                f"code_url is {self.code_url!r}; expected https://... without blanks, brackets and quotes, or {OWN_CODE!r}"
            )


def make_card(folders: Sequence[Path], about: About, out: Path | None = None) -> Path:
    """Write `card.json` and `card.md`.

    Args:
      folders: Of evaluations on a protocol, such as one on its frozen seeds and one on resampled ones.
      about: The method.
      out: New folder for the card and copies of the results; None: the card goes into the evaluation's own
        folder, if there is one alone.

    Returns:
      The card's folder.

    Raises:
      InputError: An evaluation is not complete or not on a protocol, two have the same episodes or are of different
        methods, none is on the frozen seeds, or the folder exists or cannot be written.
    """
    if not folders:
        raise InputError("no folder of results given")
    if out is None and len(folders) > 1:
        raise InputError(f"{len(folders)} folders of results need --out: where the card goes")
    if out is not None and out.exists():
        raise InputError(f"{out}: exists; choose another --out")
    records = [read_run(folder) for folder in folders]
    where = ["."] if out is None else [f"runs/{number}" for number in range(len(folders))]
    card = _card(about, where, records)
    target = folders[0] if out is None else out
    try:
        if out is not None:
            for folder, place in zip(folders, where, strict=True):
                copied = out / place
                copied.mkdir(parents=True)
                for name in (RESULTS_FILE, RUN_FILE):
                    shutil.copyfile(folder / name, copied / name)
        text = json.dumps(card, indent=1, allow_nan=False) + "\n"
        write_atomically(target / TEXT_FILE, card_markdown(card).encode("utf-8"))
        write_atomically(target / CARD_FILE, text.encode("utf-8"))
    except OSError as error:
        raise InputError(f"{target}: cannot be written ({error.strerror or error})") from None
    return target


def check_card(folder: Path) -> int:
    """Compute a card anew from the results beside it, and compare.

    Args:
      folder: With `card.json`.

    Returns:
      How many episodes it is of.

    Raises:
      InputError: The card or its results are broken or do not agree; one line says where.
    """
    path = folder / CARD_FILE
    try:
        stated = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        what = "no card; `manipose card` writes one" if folder.is_dir() else "no such folder"
        raise InputError(f"{folder}: {what}") from None
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    except ValueError as error:
        raise InputError(f"{path}: not JSON ({error})") from None
    try:
        version = stated["schema_version"]
        about = About(**{name: stated[name] for name in About.__annotations__})
        where = [_inside(run["folder"]) for run in stated["runs"]]
        hashes = [run["results_sha256"] for run in stated["runs"]]
    except (KeyError, TypeError) as error:
        raise InputError(f"{path}: not a card ({error!r})") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    if version != SCHEMA_VERSION:
        raise InputError(f"{path}: schema_version is {version!r}; expected {SCHEMA_VERSION}")
    records = [read_run(folder / place) for place in where]
    for place, record, sha256 in zip(where, records, hashes, strict=True):
        if record.sha256 != sha256:
            raise InputError(
                f"{folder / place / RESULTS_FILE}: sha256 {record.sha256[:12]}..., the card states "
                f"{str(sha256)[:12]}...: the results are not those the card was made of"
            )
    expected = _card(about, where, records)
    difference = _difference(stated, json.loads(json.dumps(expected)), "")
    if difference is not None:
        raise InputError(f"{path}: {difference}")
    text = folder / TEXT_FILE
    if not text.is_file() or text.read_text(encoding="utf-8") != card_markdown(stated):
        raise InputError(f"{text}: missing, or not the text of {CARD_FILE}")
    return sum(len(record.results) for record in records)


def _card(about: About, where: Sequence[str], records: Sequence[RunRecord]) -> dict[str, Any]:
    """The content of `card.json`."""
    runs = [_entry(place, record) for place, record in zip(where, records, strict=True)]
    if not runs:
        raise InputError("a card is of at least one run")
    methods = [method_of(record.run) for record in records]
    for method in methods[1:]:
        others = [n for n in {**methods[0], **method} if method.get(n) != methods[0].get(n)]
        if others:
            raise InputError(
                f"the runs are of different methods ({', '.join(others)} differ); a card is of one"
            )
    _check_seeds(records)
    return {"schema_version": SCHEMA_VERSION, **asdict(about), "method": methods[0], "runs": runs}


def _check_seeds(records: Sequence[RunRecord]) -> None:
    """Every episode counts once, and the frozen seeds of each protocol are among them."""
    seen: set[tuple[Any, ...]] = set()
    for record in records:
        seeds = record.run["protocol"], record.run.get("resample")
        episodes = {(*seeds, *result.key) for result in record.results}
        for *_, task, episode in sorted(episodes & seen, key=lambda each: each[2:]):
            raise InputError(f"two of the runs are the same: both play episode {episode} of {task}")
        seen |= episodes
    frozen = {version for version, resample, *_ in seen if resample is None}
    for version, resample, *_ in sorted(seen, key=str):
        if version not in frozen:
            raise InputError(
                f"the runs on protocol {version} have seeds resampled from {resample} only; a card needs one on the "
                "frozen seeds: evaluate without --resample too"
            )


def _entry(place: str, record: RunRecord) -> dict[str, Any]:
    """What a card states of a run."""
    run = record.run
    tasks = {
        task: {"n": row["episodes"], **{name: row[name] for name in STATED}}
        for task, row in summarize(record.results).items()
    }
    rates = {
        f"mean_{name}": fmean(row[name] / row["n"] for row in tasks.values())
        for name in ("success_at_end", "success_once")
    }
    return {
        "folder": place,
        "results_sha256": record.sha256,
        "protocol": run["protocol"],
        "protocol_sha256": run["protocol sha256"],
        "resample": run.get("resample"),
        "versions": {
            k.removesuffix(" version"): v for k, v in run.items() if k.endswith(" version")
        },
        "machine": run.get("machine"),
        "command": run.get("command"),
        **rates,
        "tasks": tasks,
    }


def _inside(place: Any) -> str:
    """A folder within the card's."""
    path = PurePosixPath(str(place))
    if path.is_absolute() or ".." in path.parts:
        raise InputError(f"folder {place!r} lies outside of the card's")
    return str(place)


def _difference(stated: Any, expected: Any, where: str) -> str | None:
    """The first place where a card says something else than its results; numbers agree to rounding."""
    if isinstance(stated, dict) and isinstance(expected, dict):
        for name in [*expected, *(each for each in stated if each not in expected)]:
            if name not in stated or name not in expected:
                return f"{where}{name} is {'missing' if name not in stated else 'not of a card'}"
            found = _difference(stated[name], expected[name], f"{where}{name}: ")
            if found is not None:
                return found
        return None
    if isinstance(stated, list) and isinstance(expected, list) and len(stated) == len(expected):
        pairs = enumerate(zip(stated, expected, strict=True))
        each = (_difference(one, other, f"{where}{i}: ") for i, (one, other) in pairs)
        return next((found for found in each if found is not None), None)
    if isinstance(stated, float) and isinstance(expected, float):
        same = math.isclose(stated, expected, rel_tol=1e-9, abs_tol=1e-12)
    else:
        same = type(stated) is type(expected) and stated == expected
    return None if same else f"{where}{stated!r}; the results say {expected!r}"
