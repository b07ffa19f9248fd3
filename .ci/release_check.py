"""Build the source and wheel distributions, install the wheel outside the repository, and use it there.

    python .ci/release_check.py [DIST]

Ends with 1 at the first step that fails. Needs `build`, and a network from which pip can install.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import tempfile
import time
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("manipose_mj", "asset_pipeline")
# What a build reads beside the packages.
BUILD_FILES = ("pyproject.toml", "README.md", "LICENSE")
# Of one step [s]: pip installs about 800 MB.
LIMIT = 600.0
# A user starts from a plain shell: nothing of this repository, and one thread for each of the demo's processes.
LEFT_OUT = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV", "MANIPOSE_CACHE")


class CheckError(Exception):
    """A step of the check failed; the message says which and how."""


def run(what: str, command: list[str | Path], folder: Path, home: Path) -> str:
    """What a command printed; the step and how long it took are printed."""
    environment = {name: v for name, v in os.environ.items() if name not in LEFT_OUT}
    environment |= {"MANIPOSE_CACHE": str(home / "cache"), "MPLCONFIGDIR": str(home / "matplotlib")}
    start = time.monotonic()
    try:
        ended = subprocess.run(
            [str(part) for part in command],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=LIMIT,
        )
    except subprocess.TimeoutExpired:
        raise CheckError(f"{what}: not done after {LIMIT:.0f} s") from None
    if ended.returncode != 0:
        raise CheckError(f"{what}: exit code {ended.returncode}\n{ended.stdout}{ended.stderr}")
    print(f"ok   {time.monotonic() - start:5.0f} s  {what}", flush=True)
    return ended.stdout


def package_files() -> set[str]:
    """Every file of the packages, by its path in the repository."""
    return {
        path.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }


def check_contents(what: str, held: set[str], requested: set[str]) -> None:
    """Raise CheckError unless a distribution holds what is wanted."""
    missing = sorted(requested - held)
    if missing:
        raise CheckError(f"{what}: lacks {len(missing)} files: {', '.join(missing[:10])}")
    print(f"ok            {what}: {len(held)} files", flush=True)


def only(folder: Path, pattern: str) -> Path:
    """The one file of a pattern."""
    found = list(folder.glob(pattern))
    if len(found) != 1:
        raise CheckError(f"{folder}: {len(found)} files {pattern}, not one")
    return found[0]


def build(dist: Path, home: Path) -> Path:
    """The wheel, built from the source distribution as pip does it, its contents checked."""
    command = [sys.executable, "-m", "build", "--outdir", dist, ROOT]
    run("build sdist, and wheel from it", command, ROOT, home)
    sdist, wheel = only(dist, "*.tar.gz"), only(dist, "*.whl")
    with tarfile.open(sdist) as tar:
        names = {member.name.partition("/")[2] for member in tar if member.isfile()}
    check_contents(sdist.name, names, package_files() | set(BUILD_FILES))
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    check_contents(wheel.name, names, package_files())
    strange = sorted({n.partition("/")[0] for n in names if ".dist-info/" not in n} - {*PACKAGES})
    if strange:
        raise CheckError(f"{wheel.name}: holds folders that are no package: {', '.join(strange)}")
    return wheel


def use(wheel: Path, home: Path) -> None:
    """Install the wheel into an empty environment and run what a newcomer runs first."""
    venv.create(home / "venv", with_pip=True)
    scripts = home / "venv" / ("Scripts" if os.name == "nt" else "bin")
    python, manipose = scripts / "python", scripts / "manipose"
    away = home / "away"
    away.mkdir()
    pip = [python, "-m", "pip", "--disable-pip-version-check"]
    run("pip install the wheel", [*pip, "install", "--quiet", wheel], away, home)
    run("pip check", [*pip, "check"], away, home)
    where = (
        "import manipose_mj, asset_pipeline; print(manipose_mj.__file__, manipose_mj.__version__)"
    )
    print(f"     {run('import', [python, '-c', where], away, home).strip()}")
    listed = run("manipose list", [manipose, "list"], away, home)
    if "single_object" not in listed:
        raise CheckError(f"manipose list: names no task\n{listed}")
    run("manipose demo", [manipose, "demo", "--out", "demo"], away, home)
    report = only(away / "demo", "report.html")
    print(f"     {report.name}: {report.stat().st_size / 1e6:.1f} MB")


def main() -> int:
    """The exit code: 0 when everything works."""
    with tempfile.TemporaryDirectory(prefix="manipose-release-") as temporary:
        home = Path(temporary)
        dist = Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else home / "dist"
        try:
            use(build(dist, home), home)
        except CheckError as error:
            print(f"FAIL {error}", flush=True)
            return 1
    print("the release works")
    return 0


if __name__ == "__main__":
    sys.exit(main())
