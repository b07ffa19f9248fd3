"""`manipose assets list` and `manipose assets stats`: what is built in, or in a folder of assets."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

if TYPE_CHECKING:
    from manipose_mj.assets.inventory import Entry

Text = Annotated[str | None, arg(help_behavior_hint="")]


@dataclass(frozen=True)
class Selection:
    """Which assets.

    Attributes:
      directory: Folder of assets; without it the built-in objects.
      category: Only this category.
      type: Only this labelling rule: axial, mirror, functional, articulated.
      split: Only train or only test.
      source: Only from sources whose name contains this.
      graspable: Only those with, or without, 20 grasps that survive a lift and shake in simulation.
    """

    directory: Annotated[Positional[Path | None], arg(metavar="[DIR]", help_behavior_hint="")] = (
        None
    )
    category: Text = None
    type: Text = None
    split: Text = None
    source: Text = None
    graspable: Annotated[Literal["yes", "no"] | None, arg(help_behavior_hint="")] = None

    def entries(self) -> list[Entry]:
        """Those assets."""
        from manipose_mj.assets.inventory import Filter, built_in, in_folder, select

        entries = built_in() if self.directory is None else in_folder(self.directory)
        hold = None if self.graspable is None else self.graspable == "yes"
        return select(entries, Filter(self.category, self.type, self.split, self.source, hold))


Selected = Annotated[Selection, arg(name="")]


def list_objects(selection: Selected = Selection(), *, json: bool = False) -> None:
    """List assets with their category, type, split, source and whether a Panda can grasp them.

    Args:
      selection: Which assets.
      json: Print JSON, for other programs.
    """
    from manipose_mj.assets.inventory import as_json
    from manipose_mj.console import output

    rows = selection.entries()
    if json:
        output.write_json([as_json(entry) for entry in rows])
        return
    from rich.table import Table

    table = Table("name", "category", "type", "split", "source", "graspable")
    for e in rows:
        held = {True: "yes", False: "no", None: "not tried"}[e.graspable]
        table.add_row(e.name, e.category, e.type, e.split or "-", e.source, held)
    console = output.standard_output()
    console.print(table)
    console.print(f"{len(rows)} assets")


def show_statistics(selection: Selected = Selection(), *, json: bool = False) -> None:
    """Count assets by category, with the share that a Panda can grasp; filters as for `list`.

    Args:
      selection: Which assets.
      json: Print JSON, for other programs.
    """
    from manipose_mj.assets.inventory import statistics
    from manipose_mj.console import output

    counts = statistics(selection.entries())
    if json:
        output.write_json(counts)
        return
    from rich.table import Table

    table = Table("category", "type", "instances", "graspable", "share")
    for column in table.columns[2:]:
        column.justify = "right"
    for name, row in counts["categories"].items():
        share = f"{row['graspable'] / row['instances']:.0%}"
        table.add_row(name, row["type"], str(row["instances"]), str(row["graspable"]), share)
    console = output.standard_output()
    console.print(table)
    console.print(
        f"{counts['rigid']} rigid and {counts['articulated']} articulated assets "
        f"in {len(counts['categories'])} categories"
    )
