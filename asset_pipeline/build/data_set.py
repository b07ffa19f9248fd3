"""Build asset folders from the objects of a source, in parallel, resumably."""

from __future__ import annotations

import hashlib
import logging
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from types import ModuleType

import mujoco
import numpy as np
import trimesh

from asset_pipeline.build.articulated import build_articulated
from asset_pipeline.build.pool import BuildJob, BuildResult, run_jobs
from asset_pipeline.build.relabel import MEASURED_FILE, OVERRIDE, relabelled, write_measured
from asset_pipeline.build.replaceable import PLACE, check_origin, check_source, place
from asset_pipeline.build.rigid import box_center, finish_rigid
from asset_pipeline.build.workers.limited_call import LimitError, Limits, limited_call
from asset_pipeline.checks.handle_check import handle_remarks
from asset_pipeline.geometry.convexify import ConvexSettings, convexify
from asset_pipeline.geometry.mass import shell_mass_properties, solid_mass_properties
from asset_pipeline.geometry.repair import closed
from asset_pipeline.labelling.overrides.applying import overridden
from asset_pipeline.labelling.overrides.reading import LABELS_FILE, Override, read_overrides
from asset_pipeline.labelling.scan_label import scan_label
from asset_pipeline.sources import google_scanned_objects, meshes, omniobject3d, pace, ycb
from asset_pipeline.sources.articulated_scan import ArticulatedScan
from asset_pipeline.sources.meshes import MeshItem, MeshOptions
from asset_pipeline.sources.partnet_mobility import objects as partnet_mobility
from asset_pipeline.sources.scan import Scan, ScanItem, write_texture
from manipose_mj.assets.asset import GRASPS_FILE, Asset
from manipose_mj.assets.asset_json import read_asset
from manipose_mj.assets.geometry import Body, MassProperties, Shape
from manipose_mj.assets.label import ObjectType
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.storage.staging import made_for_result

log = logging.getLogger(__name__)

OWN, FURNITURE = "meshes", "partnet_mobility"
# A source is a module with `items(path)`, `inputs(item)` and the context manager `opened(item)`.
SOURCES: dict[str, ModuleType] = {
    "google_scanned_objects": google_scanned_objects,
    OWN: meshes,
    "omniobject3d": omniobject3d,
    "pace": pace,
    FURNITURE: partnet_mobility,
    "ycb": ycb,
}
# To be raised with every change that alters what is built.
GENERATOR_VERSION = 6
# Of household objects whose mass nobody published: between foam (150) and filled bottles (1000).
DENSITY = 400.0  # [kg/m^3]
_BALL = 0.95  # of the largest distance from the middle is the least one of a ball
DEFAULT_LIMITS = Limits()


def build(
    source: str,
    path: Path,
    out: Path,
    *,
    jobs: int = 1,
    only: Sequence[str] = (),
    limits: Limits = DEFAULT_LIMITS,
    labels: Path | None = None,
    said: MeshOptions | None = None,
    licence: str | None = None,
    progress: Callable[[BuildResult, int], None] | None = None,
) -> list[BuildResult]:
    """Build every object at `path` into `out/<name>`.

    An asset whose inputs and generator are unchanged is left alone; one bad object never stops the
    rest. Every object is read and built in a process that is killed at a limit. The caller sees each
    result as it comes, so that a terminal can show a bar; see `pool.run_jobs` for clusters.

    Args:
      source: A key of `SOURCES`.
      path: What the source reads: a folder of objects, or one object.
      out: Folder of asset folders; made if it is not there.
      jobs: Worker processes.
      only: Names of the objects to build; empty for all.
      limits: Of each object.
      labels: A person's labels, which override what is measured; see `labelling.overrides`. None:
        `labels.yaml` in `out`, where there is one.
      said: What is known of own meshes, the source `"meshes"`; the others know it themselves.
      licence: Of one's own furniture, read by the source `"partnet_mobility"`; None is the data set's.
      progress: Called with each result and the number of objects in all.

    Returns:
      One result an object, sorted by name.

    Raises:
      InputError: The source or a name in `only` is unknown, `path` holds no object, the labels are
        wrong, or `out` cannot be written.
    """
    if source not in SOURCES:
        raise unknown_name("source", source, SOURCES)
    if source == OWN:
        said = said or MeshOptions()
    elif said is not None:
        raise InputError(f"{source} knows its objects; options are for the source {OWN!r} only")
    if licence is not None and source != FURNITURE:
        raise InputError(f"{source} has its licence; this one is for the source {FURNITURE!r} only")
    # Objects are built in processes with other working directories.
    path, out = Path(path).absolute(), Path(out).absolute()
    found = {
        item.name: item for item in _items(source, path, limits, licence if said is None else said)
    }
    for name in only:
        if name not in found:
            raise unknown_name(f"object in {path}", name, found)
    for remark in said.remarks() if said is not None else ():
        log.warning("%s: %s", path, remark)
    with writable(out):
        overrides = _overrides(labels, out, found)
        return run_jobs(
            [
                BuildJob(
                    name=name,
                    folder=out / name,
                    where=found[name].where,
                    build=build_item,
                    arguments=(source, found[name], overrides.get(name)),
                    limits=limits,
                    sources=found[name].files,
                )
                for name in (sorted(set(only)) or sorted(found))
            ],
            jobs=jobs,
            progress=progress,
        )


def build_item(
    source: str, item: ScanItem, override: Override | None, folder: Path, target: Path
) -> bool:
    """Build one object into `target`, and return True, unless `folder` is up to date.

    Raises:
      InputError: The object, or what a person said of its label, cannot be used; or `folder` is the asset of
        another mesh or another source.
    """
    module = SOURCES[source]
    said = {} if override is None else {OVERRIDE: override.digest}
    inputs = module.inputs(item)
    if up_to_date(folder, inputs | said, generator()):
        return False
    if isinstance(item, MeshItem):
        check_origin(folder, item.file, meshes.SOURCE, inputs)
    with module.opened(item) as scan:
        provenance = scan.provenance
        check_source(folder, provenance.source)
        if isinstance(scan, ArticulatedScan):
            provenance = replace(provenance, generator=generator())
            asset = build_articulated(replace(scan, provenance=provenance), target)
            if override is not None:
                asset = relabelled(asset, override)
            for remark in handle_remarks(asset):
                log.warning("%s: %s", scan.name, remark)
        else:
            if isinstance(item, MeshItem):
                where = {PLACE: place(item.file, folder)}
                provenance = replace(provenance, inputs=provenance.inputs | where)
            options = item.options if isinstance(item, MeshItem) else None
            said_type = None if options is None else options.object_type
            guessed = options is not None and said_type is None and options.category is None
            asset = build_scan(
                replace(scan, provenance=provenance),
                target,
                override,
                type_checked=guessed or said_type is not None,
            )
            if override is None:
                _tell_type(said_type, asset, guessed=guessed)
    return True


def _tell_type(said: ObjectType | None, asset: Asset, *, guessed: bool) -> None:
    """Warn where the type that a person said, or that was guessed by the object's name, does not fit the shape."""
    found = asset.label.object_type
    residuals = {} if asset.label_quality is None else asset.label_quality.residuals
    if found == "axial" and (guessed or said == found) and "axis" not in residuals:
        log.warning(
            "%s: no axis of revolution was found; labelled by planes: say --type mirror",
            f"category {asset.category} by its name" if guessed else "--type axial",
        )
    if said not in (None, found):
        # A vessel with a handle has no axis that all of it is round about.
        log.warning(
            "--type %s does not fit what sticks out at its side; labelled as %s", said, found
        )


def build_scan(
    scan: Scan, folder: Path, override: Override | None = None, *, type_checked: bool = False
) -> Asset:
    """Label, decompose and weigh one scan, and write its asset folder.

    Args:
      scan: Its mesh and what is known of it.
      folder: Of the asset.
      override: What a person said of its label.
      type_checked: Whether its type is to be checked, as in `scan_label`.
    """
    label, quality = scan_label(
        scan.mesh,
        scan.object_type,
        scan.up,
        category=scan.category,
        functional=scan.functional,
        textured=scan.texture is not None,
        texture=scan.texture,
        type_checked=type_checked,
    )
    measured = Asset(
        folder=folder,
        name=scan.name,
        kind="rigid",
        category=scan.category,
        label=label,
        up=np.asarray(scan.up, float),
        mass_properties=scan_mass_properties(scan),
        stable_poses=(),
        provenance=replace(scan.provenance, generator=generator()),
        label_quality=quality,
    )
    draft = measured
    if override is not None:
        draft = overridden(
            measured,
            override,
            scan.mesh,
            textured=scan.texture is not None,
            texture=scan.texture,
        )
        inputs = draft.provenance.inputs | {OVERRIDE: override.digest}
        draft = replace(draft, provenance=replace(draft.provenance, inputs=inputs))
    if scan.texture is None and getattr(scan.mesh.visual, "uv", None) is not None:
        log.warning("%s: its texture is not there; built without", scan.name)
    parts = convexify(scan.mesh)
    with tempfile.TemporaryDirectory(prefix="manipose-texture-") as scratch:
        texture = scan.texture and write_texture(scan.texture, Path(scratch) / "texture.png")
        body = Body(
            name=scan.name,
            collision=parts,
            visual=(Shape("mesh", mesh=scan.mesh, rgba=scan.rgba, texture=texture),),
            mass_properties=draft.mass_properties,
        )
        asset = finish_rigid(
            folder,
            name=scan.name,
            category=draft.category,
            label=draft.label,
            up=draft.up,
            body=body,
            provenance=draft.provenance,
            label_quality=draft.label_quality,
        )
    if not asset.graspable:
        log.warning(
            "%s: the gripper can hold it nowhere; tasks that have it moved refuse it", scan.name
        )
    if _is_a_ball(scan.mesh):
        log.warning(
            "%s: round on all sides: nothing seen tells its axis, so that goals of orientation are met by "
            "chance with estimated poses",
            scan.name,
        )
    if override is not None:
        centred = replace(measured.label, center=box_center(body, measured.label))
        write_measured(folder, replace(measured, label=centred, stable_poses=asset.stable_poses))
    return asset


def _is_a_ball(mesh: trimesh.Trimesh) -> bool:
    """Whether the whole surface is about as far from the middle."""
    surface = np.concatenate([mesh.vertices, mesh.triangles_center])
    far = np.linalg.norm(surface - mesh.bounds.mean(axis=0), axis=1)
    return bool(far.min() > _BALL * far.max())


def scan_mass_properties(scan: Scan) -> MassProperties:
    """Mass and inertia of a scan: published mass, else volume times 400 kg/m^3."""
    solid = closed(scan.mesh)
    if solid is None:
        log.warning("%s: the surface cannot be closed; mass and inertia are its hull's", scan.name)
        solid = scan.mesh.convex_hull
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
    return f"asset_pipeline.build.data_set {GENERATOR_VERSION} {hashlib.sha256(settings).hexdigest()[:12]}"


def up_to_date(folder: Path, inputs: dict[str, str], generator: str) -> bool:
    """Whether an asset folder is whole and was built from these inputs by this generator, wherever they lay."""
    try:
        asset = read_asset(folder)
        provenance = asset.provenance
        found = {key: value for key, value in provenance.inputs.items() if key != PLACE}
        return found == inputs and provenance.generator == generator and _is_whole(asset)
    except InputError:
        return False


def _is_whole(asset: Asset) -> bool:
    """Whether every file is there that a build writes beside `asset.json`."""
    try:
        spec = mujoco.MjSpec.from_file(str(asset.model_path))
    except (ValueError, mujoco.FatalError):
        return False
    files = [Path(spec.compiler.meshdir, mesh.file) for mesh in spec.meshes if mesh.file]
    files += [Path(spec.compiler.texturedir, each.file) for each in spec.textures if each.file]
    if asset.kind == "rigid":
        files.append(Path(GRASPS_FILE))  # also where the gripper can hold it nowhere
    if OVERRIDE in asset.provenance.inputs:
        files.append(Path(MEASURED_FILE))
    return all((asset.folder / file).is_file() for file in files)


@contextmanager
def writable(out: Path) -> Iterator[None]:
    """Make a folder, as `made_for_result`.

    Raises:
      InputError: It cannot be written.
    """
    with ExitStack() as stack:
        try:
            stack.enter_context(made_for_result(out))
            with tempfile.NamedTemporaryFile(dir=out):
                pass
        except OSError as error:
            raise InputError(f"{out}: cannot be written ({error.strerror})") from None
        yield


def _overrides(labels: Path | None, out: Path, found: dict[str, ScanItem]) -> dict[str, Override]:
    """A person's labels; a line for each that is of no object here."""
    path = out / LABELS_FILE if labels is None else labels
    if labels is None and not path.exists():
        return {}
    overrides = read_overrides(path)
    for name in overrides:
        # A file may serve several sources that are built into one folder.
        if name not in found and not (out / name).is_dir():
            log.warning("%s: %s", path, unknown_name("object", name, found))
    return overrides


def _items(
    source: str, path: Path, limits: Limits, said: MeshOptions | str | None
) -> list[ScanItem]:
    """What the source finds, looking into archives under the same limits."""
    with tempfile.TemporaryDirectory(prefix="manipose-list-") as scratch:
        arguments = (path,) if said is None else (path, said)
        outcome = limited_call(
            SOURCES[source].items, *arguments, limits=limits, scratch=Path(scratch)
        )
    if isinstance(outcome.error, LimitError):
        raise InputError(f"{path}: cannot be listed ({outcome.error})")
    if outcome.error is not None:
        raise outcome.error
    for warning in outcome.warnings:
        log.warning("%s", warning)
    return outcome.value
