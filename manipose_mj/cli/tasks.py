"""`manipose list`: what there is to run."""

from __future__ import annotations


def list_tasks(*, json: bool = False) -> None:
    """List the tasks and the built-in objects.

    Args:
      json: Print JSON, for other programs.
    """
    from manipose_mj.assets import catalogue
    from manipose_mj.console import output
    from manipose_mj.suite import ALL_TASKS, describe

    tasks = [{"task": f"{d}/{t}", "description": describe(d, t)} for d, t in ALL_TASKS]
    objects = {category: catalogue.instances(category) for category in catalogue.names()}
    if json:
        output.write_json({"tasks": tasks, "objects": objects})
        return
    from rich.table import Table

    console = output.standard_output()
    table = Table("task", "description", title="Tasks", title_justify="left")
    for row in tasks:
        table.add_row(row["task"], row["description"])
    console.print(table)
    table = Table("category", "objects", title="Built-in objects", title_justify="left")
    for category, instances in objects.items():
        table.add_row(category, f"{instances[0]} to {instances[-1]}")
    console.print(table)
