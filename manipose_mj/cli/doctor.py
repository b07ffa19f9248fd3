"""`manipose doctor`: what works on this machine, and how to get the rest."""

from __future__ import annotations

STYLES = {"ok": "green", "missing": "bold red", "absent": "yellow"}


def doctor() -> int:
    """Say which packages, renderers and engines work here, and how to get the others; exit with 1
    if something that every command needs is missing.
    """
    from rich.table import Table
    from rich.text import Text

    from manipose_mj.cli.diagnosis import examine
    from manipose_mj.console import output

    with output.working_on("trying renderers and engines"):
        findings = examine()
    table = Table(
        "", "what", "status", "detail", title="ManiPose-MJ on this machine", title_justify="left"
    )
    group = ""
    for finding in findings:
        table.add_row(
            "" if finding.group == group else finding.group,
            finding.what,
            Text(finding.status, STYLES[finding.status]),
            finding.detail,
        )
        group = finding.group
    console = output.standard_output()
    console.print(table)
    missing = [f.what for f in findings if f.status == "missing"]
    if missing:
        console.print(f"needed and missing: {', '.join(missing)}")
        return 1
    console.print("everything needed is here; what is absent is optional")
    return 0
