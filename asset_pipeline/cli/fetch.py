"""`manipose assets fetch`: the data sets that `assets build` reads."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg


def fetch_assets(
    source: Annotated[Positional[str], arg(metavar="NAME")],
    /,
    *,
    out: Annotated[
        Path | None, arg(metavar="DIR", help_behavior_hint="(a folder of that name)")
    ] = None,
    only: Annotated[tuple[str, ...], arg(metavar="OBJECT...")] = (),
    mirror: Annotated[str | None, arg(metavar="URL", help_behavior_hint="")] = None,
    checksums: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None,
) -> int:
    """Download a data set's scans, or say how to get one that needs an account.

    An interrupted download goes on where it was; what is there already is compared with the checksums
    kept in fetched.json. Exits with 2 if something is missing in the end, also where it has to be got by hand.

    Args:
      source: ycb, google_scanned_objects, pace, omniobject3d or partnet_mobility.
      out: Folder for the files.
      only: Objects to fetch, by name; all without it.
      mirror: Base address to use instead of the publisher's.
      checksums: File as sha256sum writes it, which the downloads must match.
    """
    from asset_pipeline.fetching.publishers import PUBLISHERS
    from asset_pipeline.fetching.scan_files import Position, fetch
    from manipose_mj.console import output
    from manipose_mj.errors import unknown_name

    if source not in PUBLISHERS:
        raise unknown_name("data set", source, PUBLISHERS)
    publisher = PUBLISHERS[source]
    console = output.standard_output()
    console.print(
        f"{publisher.title}; licence: {publisher.licence}; {publisher.homepage}", soft_wrap=True
    )
    if publisher.steps:
        console.print("Its publisher asks for an account, so this has to be done by hand:")
        for number, step in enumerate(publisher.steps, start=1):
            console.print(f"{number}. {step}", soft_wrap=True)
        return 2
    folder = out or Path(source)
    with output.Progress(source, in_bytes=True) as progress:

        def show(position: Position) -> None:
            note = f"{position.name} ({position.number} of {position.count})"
            progress.update(position.done, position.total, note)

        results = fetch(
            source, folder, only=only, mirror=mirror, checksums=checksums, progress=show
        )
    failed = [r for r in results if r.status == "failed"]
    for result in failed:
        output.fail_line(result.reason)
    count = {s: sum(r.status == s for r in results) for s in ("fetched", "present", "absent")}
    absent = f", {count['absent']} not published" if count["absent"] else ""
    console.print(
        f"{count['fetched']} fetched, {count['present']} there already, {len(failed)} failed"
        f"{absent}, in {folder}",
        soft_wrap=True,
    )
    if not failed:
        if publisher.afterwards:
            console.print(publisher.afterwards, soft_wrap=True)
        console.print(f"next: manipose assets build {source} {folder} --out ASSETS", soft_wrap=True)
    return 2 if failed else 0
