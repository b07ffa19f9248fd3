"""Where the data sets come from: addresses and licences of those anybody may download, steps for the others."""

from __future__ import annotations

from dataclasses import dataclass

from asset_pipeline.sources import ycb


@dataclass(frozen=True)
class Publisher:
    """One data set's publisher.

    Attributes:
      title: The data set.
      licence: As the publisher states it.
      homepage: Page to read.
      base: Address below which the files lie; a mirror stands in for it.
      file: Name of an object's file below it, with `{name}` in it.
      names: The objects, where the publisher's list is known here.
      index: Otherwise what follows `base` for page `{page}` of the publisher's own list: JSON objects
        with a `name`.
      afterwards: What is left to do once the files are there.
      steps: How to get the data set by hand, where it may not be downloaded unasked; then no `base`.
    """

    title: str
    licence: str
    homepage: str
    base: str = ""
    file: str = ""
    names: tuple[str, ...] = ()
    index: str = ""
    afterwards: str = ""
    steps: tuple[str, ...] = ()


PUBLISHERS: dict[str, Publisher] = {
    "ycb": Publisher(
        title="YCB objects, google_16k meshes",
        licence="CC BY 4.0",
        homepage="https://www.ycbbenchmarks.com/object-models/",
        base="https://ycb-benchmarks.s3.amazonaws.com/data/google",
        file="{name}_google_16k.tgz",
        names=tuple(ycb.OBJECTS),
    ),
    # Fuel rather than the MuJoCo conversion on GitHub: the publisher's own server, an archive an object.
    "google_scanned_objects": Publisher(
        title="Google Scanned Objects",
        licence="CC BY 4.0",
        homepage="https://app.gazebosim.org/GoogleResearch/fuel/collections/Scanned%20Objects%20by%20Google%20Research",
        base="https://fuel.gazebosim.org/1.0/GoogleResearch/models",
        file="{name}.zip",
        index="?per_page=100&page={page}",
    ),
    "pace": Publisher(
        title="PACE, object models",
        licence="MIT; models 693-1260 CC BY 4.0 (Sketchfab), 1165 and 1166 GrabCAD",
        homepage="https://github.com/qq456cvb/PACE",
        base="https://huggingface.co/datasets/qq456cvb/PACE/resolve/main",
        file="{name}.tar.gz",
        names=("models",),
        afterwards="unpack it first (tar -xzf models.tar.gz): one archive holds all objects",
    ),
    "omniobject3d": Publisher(
        title="OmniObject3D, raw scans",
        licence="CC BY 4.0",
        homepage="https://github.com/omniobject3d/OmniObject3D",
        steps=(
            "register at https://opendatalab.com and open OpenXDLab/OmniObject3D-New there",
            "pip install openxlab, then openxlab login with the keys of your account",
            "openxlab dataset download --dataset-repo OpenXDLab/OmniObject3D-New "
            "--source-path /raw/raw_scans --target-path DIR",
            "unpack the categories' archives, each into a folder of its name, so that there is "
            "DIR/raw_scans/apple/apple_001/Scan/Scan.obj",
            "manipose assets build omniobject3d DIR --out ASSETS",
        ),
    ),
    "partnet_mobility": Publisher(
        title="PartNet-Mobility",
        licence="ShapeNet's terms: research only, no redistribution",
        homepage="https://sapien.ucsd.edu/downloads",
        steps=(
            "register at https://sapien.ucsd.edu and accept the terms",
            "download partnet-mobility-v0.zip, or single models by their number",
            "unpack, so that there is DIR/dataset/NUMBER/mobility.urdf",
            "manipose assets build partnet_mobility DIR --out ASSETS",
        ),
    ),
}
