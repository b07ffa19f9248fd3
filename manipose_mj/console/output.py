"""Consoles, tables and progress on the terminal."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.table import Table

PIPED_WIDTH = 140
QUIET_S = 2.0
REPORT_EVERY_S = 15.0


def standard_output() -> Console:
    """For results. As wide as the tables need where nobody's window limits it."""
    width = None if sys.stdout.isatty() else PIPED_WIDTH
    return Console(width=width, markup=False, highlight=False)


def standard_error() -> Console:
    """For progress and notes."""
    return Console(stderr=True, markup=False, highlight=False)


def write_json(document: Any) -> None:
    """Plain JSON on standard output, for other programs; figures that are not finite are null."""
    sys.stdout.write(json.dumps(_finite(document), indent=1, allow_nan=False) + "\n")


def figure(value: float, form: str) -> str:
    """A figure of a table in the form of `format`; a dash where there is none to give."""
    return format(value, form) if math.isfinite(value) else "-"


def _finite(document: Any) -> Any:
    if isinstance(document, dict):
        return {name: _finite(value) for name, value in document.items()}
    if isinstance(document, list | tuple):
        return [_finite(value) for value in document]
    return None if isinstance(document, float) and not math.isfinite(document) else document


@contextmanager
def working_on(what: str) -> Iterator[None]:
    """Show on standard error that something of unknown length is under way."""
    console = standard_error()
    if console.is_terminal:
        with console.status(what):
            yield
        return
    start = time.monotonic()
    yield
    if (took := time.monotonic() - start) > QUIET_S:
        console.print(f"{what}: {took:.0f} s")


class Progress:
    """How far something countable is, on standard error: a bar on a terminal, now and then a line elsewhere."""

    def __init__(self, unit: str, *, in_bytes: bool = False) -> None:
        """Show nothing yet.

        Args:
          unit: What is counted, in the plural; what is fetched, where that is bytes.
          in_bytes: Count bytes, and show how fast they come.
        """
        self._unit = unit
        self._in_bytes = in_bytes
        self._console = standard_error()
        self._bar: Any = None
        self._start = time.monotonic()
        self._last = self._start + QUIET_S - REPORT_EVERY_S  # the first line comes after QUIET_S

    def __enter__(self) -> Progress:
        if self._console.is_terminal:
            from rich import progress

            self._bar = progress.Progress(
                progress.TextColumn(self._unit),
                progress.BarColumn(),
                *(
                    (progress.DownloadColumn(), progress.TransferSpeedColumn())
                    if self._in_bytes
                    else (progress.MofNCompleteColumn(),)
                ),
                progress.TextColumn("{task.description}"),
                progress.TimeElapsedColumn(),
                progress.TextColumn("left"),
                progress.TimeRemainingColumn(),
                console=self._console,
            )
            self._bar.add_task("", total=None)
            self._bar.start()
        return self

    def __exit__(self, *exception: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def update(self, done: int, total: int | None, note: str) -> None:
        """Say that `done` of `total` (None: nobody knows) are finished, and what came of them."""
        if self._bar is not None:
            self._bar.update(self._bar.task_ids[0], completed=done, total=total, description=note)
        elif done and time.monotonic() - self._last > REPORT_EVERY_S:
            self._last = time.monotonic()
            seconds = self._last - self._start
            of = "?" if total is None else f"{total / 1e6:.1f}" if self._in_bytes else str(total)
            count = f"{done / 1e6:.1f}/{of} MB of" if self._in_bytes else f"{done}/{of}"
            text = f"{count} {self._unit}, {note}, {seconds:.0f} s"
            self._console.print(text)

    def say(self, line: str) -> None:
        """A line of its own, above the bar where there is one."""
        self._console.print(line, soft_wrap=True, markup=False, highlight=False)


def fail_line(message: str) -> None:
    """One line on standard error about something wrong."""
    sys.stderr.write(f"manipose: {' '.join(message.split())}\n")


def summary_table(summary: dict[str, dict[str, Any]]) -> Table:
    """The tasks of a `summary.json`, one row each."""
    table = Table()
    # Names fold rather than vanish in a narrow window.
    table.add_column("task", overflow="fold", min_width=24)
    for name in ("at end", "95 %", "once", "policy s", "wall s"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("failures", overflow="fold", min_width=10)
    for task, row in summary.items():
        low, high = row["wilson_95"]
        table.add_row(
            task,
            f"{row['success_at_end']}/{row['episodes']}",
            f"{100 * low:.0f}-{100 * high:.0f} %",
            str(row["success_once"]),
            f"{row['median_policy_s']:.1f}",
            f"{row['median_wall_s']:.1f}",
            ", ".join(f"{stage} {n}" for stage, n in row["failures"].items()) or "none",
        )
    return table
