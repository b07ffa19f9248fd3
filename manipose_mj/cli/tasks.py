"""`manipose list`: what there is to run."""

from __future__ import annotations


def list_tasks(*, json: bool = False) -> None:
    """List the tasks and the built-in objects.

    Args:
      json: Print JSON, for other programs.
    """
    from asset_pipeline.catalogue import CATALOGUE
    from manipose_mj.cli import output
    from manipose_mj.suite import ALL_TASKS, describe

    tasks = [{"task": f"{d}/{t}", "description": describe(d, t)} for d, t in ALL_TASKS]
    if json:
        output.write_json({"tasks": tasks, "objects": list(CATALOGUE)})
        return
    from rich.table import Table

    console = output.standard_output()
    table = Table("task", "description", title="Tasks", title_justify="left")
    for row in tasks:
        table.add_row(row["task"], row["description"])
    console.print(table)
    console.print(f"Built-in objects: {', '.join(CATALOGUE)}", highlight=False)
