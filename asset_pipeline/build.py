"""Build asset folders from the objects of a source, in parallel, resumably."""

from __future__ import annotations

import hashlib
import logging
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Literal

import numpy as np
from joblib import Parallel, delayed

from asset_pipeline.asset_json import read_asset
from asset_pipeline.assets import Asset
from asset_pipeline.convexify import ConvexSettings, convexify
from asset_pipeline.finish import finish_rigid
from asset_pipeline.geometry import Body, MassProperties, Shape
from asset_pipeline.labelling.scan_label import scan_label
from asset_pipeline.mass import shell_mass_properties, solid_mass_properties
from asset_pipeline.repair import closed
from asset_pipeline.scan import Scan, ScanItem, write_texture
from asset_pipeline.sources import ycb
from manipose_mj.errors import InputError, unknown_name

log = logging.getLogger(__name__)

# A source is a module with `items(path)`, `inputs(item)` and the context manager `opened(item)`.
SOURCES: dict[str, ModuleType] = {"ycb": ycb}
# To be raised with every change that alters what is built.
GENERATOR_VERSION = 2
# Of household objects whose mass nobody published: between foam (150) and filled bottles (1000).
DENSITY = 400.0  # [kg/m^3]


@dataclass(frozen=True)
class BuildResult:
    """What became of one object.

    Attributes:
      name: The object.
      status: `"built"`, `"skipped"` (up to date) or `"failed"`.
      folder: Its asset folder.
      seconds: Wall time.
      reason: One line, when it failed.
    """

    name: str
    status: Literal["built", "skipped", "failed"]
    folder: Path
    seconds: float
    reason: str = ""


def build(
    source: str,
    path: Path,
    out: Path,
    *,
    jobs: int = 1,
    only: Sequence[str] = (),
    progress: Callable[[BuildResult, int], None] | None = None,
) -> list[BuildResult]:
    """Build every object at `path` into `out/<name>`.

    An asset whose inputs and generator are unchanged is left alone; one bad object never stops the
    rest. The caller sees each result as it comes, so that a terminal can show a bar.

    Args:
      source: A key of `SOURCES`.
      path: What the source reads: a folder of objects, or one object.
      out: Folder of asset folders; made if it is not there.
      jobs: Worker processes.
      only: Names of the objects to build; empty for all.
      progress: Called with each result and the number of objects in all.

    Returns:
      One result an object, sorted by name.

    Raises:
      InputError: The source or a name in `only` is unknown, `path` holds no object, or `out` cannot
        be written.
    """
    if source not in SOURCES:
        raise unknown_name("source", source, SOURCES)
    found = {item.name: item for item in SOURCES[source].items(Path(path))}
    for name in only:
        if name not in found:
            raise unknown_name(f"object in {path}", name, found)
    chosen = [found[name] for name in (sorted(set(only)) or sorted(found))]
    _require_writable(Path(out))
    results = []
    calls = (delayed(build_item)(source, item, Path(out)) for item in chosen)
    for result in Parallel(n_jobs=jobs, return_as="generator_unordered")(calls):
        results.append(result)
        if progress is not None:
            progress(result, len(chosen))
    return sorted(results, key=lambda r: r.name)


def build_item(source: str, item: ScanItem, out: Path) -> BuildResult:
    """Build one object unless it is up to date; failures come back as a result."""
    start = time.perf_counter()
    folder = out / item.name

    def result(status: Literal["built", "skipped", "failed"], reason: str = "") -> BuildResult:
        return BuildResult(item.name, status, folder, time.perf_counter() - start, reason)

    module = SOURCES[source]
    try:
        if _up_to_date(folder, module.inputs(item)):
            return result("skipped")
        with module.opened(item) as scan:
            build_scan(scan, folder)
    except InputError as error:
        message = str(error)
        return result("failed", message if str(item.path) in message else f"{item.path}: {message}")
    except Exception as error:  # whatever a mesh does to a library, the other objects go on
        log.error("%s:\n%s", item.path, traceback.format_exc())
        line = (str(error).splitlines() or [""])[0]
        return result("failed", f"{item.path}: {type(error).__name__}: {line}")
    return result("built")


def build_scan(scan: Scan, folder: Path) -> Asset:
    """Label, decompose and weigh one scan, and write its asset folder."""
    label = scan_label(
        scan.mesh,
        scan.object_type,
        scan.up,
        functional=scan.functional,
        textured=scan.texture is not None,
    )
    parts = convexify(scan.mesh)
    with tempfile.TemporaryDirectory(prefix="manipose-texture-") as scratch:
        texture = scan.texture and write_texture(scan.texture, Path(scratch) / "texture.png")
        body = Body(
            name=scan.name,
            collision=parts,
            visual=(Shape(kind="mesh", mesh=scan.mesh, texture=texture),),
            mass_properties=scan_mass_properties(scan),
        )
        return finish_rigid(
            folder,
            name=scan.name,
            category=scan.category,
            label=label,
            up=np.asarray(scan.up, float),
            body=body,
            provenance=replace(scan.provenance, generator=generator()),
        )


def scan_mass_properties(scan: Scan) -> MassProperties:
    """Mass and inertia of a scan: published mass, else volume times 400 kg/m^3."""
    solid = closed(scan.mesh) or scan.mesh.convex_hull
    mass = scan.mass
    if mass is None:
        mass = DENSITY * float(solid.volume)
        log.info("%s: mass unknown; taken as %.3f kg from its volume", scan.name, mass)
    if scan.fill == "shell":
        return shell_mass_properties(solid, mass)
    return solid_mass_properties(solid, mass)


def generator() -> str:
    """The version and settings that an asset was built with, as its provenance records them."""
    settings = repr(sorted(asdict(ConvexSettings()).items())).encode()
    return f"asset_pipeline.build {GENERATOR_VERSION} {hashlib.sha256(settings).hexdigest()[:12]}"


def _up_to_date(folder: Path, inputs: dict[str, str]) -> bool:
    try:
        provenance = read_asset(folder).provenance
    except InputError:
        return False
    return provenance.inputs == inputs and provenance.generator == generator()


def _require_writable(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=out):
            pass
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror})") from None
