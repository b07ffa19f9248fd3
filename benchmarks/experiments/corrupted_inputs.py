"""Build damaged objects of every source, end to end, and count what became of them.

    pip install -e ".[dev]"
    python benchmarks/experiments/corrupted_inputs.py [--examples 1000] [--limit-s 60] [--seed 0]

The damages are those of `tests/asset_pipeline/sources/damaged_files.py`: files truncated, emptied, missing, with
NaN, zero area, inverted faces, gigantic coordinates, other units, wrong indices and counts; references and
archive members that leave their folder; cyclic URDFs and expanding entities. Every one has to be rejected
with the file and the reason in one line, or repaired with a warning.

What is built without either is compared with the asset of the undamaged object: "equal" are same category,
label, joints and masses, geometry within 0.5 mm and colours within 2 of 255 (a digit in a comment was hit,
or the sixth decimal); "different" is a damage that nobody was told of, and each is listed with what differs.
Two kinds of it are known, and cannot be told from a sound file: a digit that moves one vertex by less than
about twice the length of the edges around it, and bytes of a JPEG, which has no checksum.
"Stopped" is rejected at the time limit. Exits with 1 if a build hangs past its limit, an error is not one
line that names the file, or anything is written outside `--out`: the data, the working directory, the
home, the temporary folder.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings

sys.path.insert(0, str(Path(__file__).parents[2]))  # its `tests` hold what damages files

from asset_difference import difference

from asset_pipeline.build.data_set import build
from asset_pipeline.build.workers.limited_call import Limits
from manipose_mj.errors import InputError
from manipose_mj.storage.cache_root import CACHE_VARIABLE
from tests.asset_pipeline.sources.damaged_files import Case, cases
from tests.asset_pipeline.sources.valid_files import SOURCES, valid

# To stop a build and tell so, on a busy machine [s].
LEEWAY = 15.0


def main() -> None:
    """Run the examples and print one row for each damage."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--examples", type=int, default=1000)
    parser.add_argument("--limit-s", type=float, default=60.0, help="for each object")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    limits = Limits(seconds=arguments.limit_s)
    counts: Counter[tuple[str, str]] = Counter()
    faults: list[str] = []
    unnoticed: list[str] = []
    slowest = 0.0
    tried = 0
    undamaged = tempfile.TemporaryDirectory(prefix="undamaged-")
    sound = {source: build_sound(source, Path(undamaged.name) / source) for source in SOURCES}

    @seed(arguments.seed)
    @settings(
        max_examples=arguments.examples,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=cases())
    def run(case: Case) -> None:
        nonlocal slowest, tried
        tried += 1
        start = time.monotonic()
        outcome, fault = attempt(case, limits, sound[case.source])
        slowest = max(slowest, time.monotonic() - start)
        if time.monotonic() - start > 2 * limits.seconds + LEEWAY:
            outcome, fault = "hung", fault or "went on past its limit"
        counts[case.damage, outcome] += 1
        if outcome == "different":
            unnoticed.append(f"{case.source}, {case.damage}: {fault}; {changes(case)}")
        elif fault:
            faults.append(f"{case.source}, {case.damage}: {fault}")

    run()
    outcomes = (
        "rejected",
        "repaired",
        "equal",
        "different",
        "stopped",
        "crashed",
        "hung",
        "written outside",
    )
    print(f"{'damage':20s}" + "".join(f"{o:>16s}" for o in outcomes))
    for damage in sorted({d for d, _ in counts}):
        print(f"{damage:20s}" + "".join(f"{counts[damage, o]:16d}" for o in outcomes))
    totals = {o: sum(n for (_, own), n in counts.items() if own == o) for o in outcomes}
    print(f"{'total':20s}" + "".join(f"{totals[o]:16d}" for o in outcomes))
    print(f"{tried} examples, slowest {slowest:.1f} s, limit {limits.seconds:g} s an object")
    if unnoticed:
        print("different without a warning:")
    print("\n".join(unnoticed + faults))
    undamaged.cleanup()
    sys.exit(1 if faults else 0)


def build_sound(source: str, folder: Path) -> Path:
    """The asset of the undamaged object."""
    root = Case(source, "none", valid(source), "").write(folder / "in")
    (result,) = build(source, root, folder / "out")
    assert result.status == "built" and not result.warnings, result
    return result.folder


def changes(case: Case) -> str:
    """The files that were damaged, and the first line of each that changed."""
    found = []
    for name, before in valid(case.source).items():
        after = case.content.get(name, b"")
        lines = zip(before.split(b"\n"), after.split(b"\n"), strict=False)
        if after != before:
            first = next((f"{a[:60]!r} -> {b[:60]!r}" for a, b in lines if a[:60] != b[:60]), "")
            found.append(f"{name}: {first}")
    return ", ".join(found)


def attempt(case: Case, limits: Limits, sound: Path) -> tuple[str, str]:
    """Build one; the outcome, and what is wrong with that, if anything.

    Args:
      case: The damaged object.
      limits: For the build.
      sound: The asset of the undamaged one.
    """
    with tempfile.TemporaryDirectory(prefix="corrupted-") as folder:
        home = Path(folder).resolve()
        for name in ("temporary", "work", "cache", "in"):
            (home / name).mkdir()
        root, out = case.write(home / "in"), home / "out"
        os.environ |= {"HOME": folder, CACHE_VARIABLE: str(home / "cache")}
        tempfile.tempdir = os.environ["TMPDIR"] = str(home / "temporary")
        os.chdir(home / "work")
        before = tree(home)
        try:
            results = build(case.source, root, out, limits=limits)
        except InputError as error:
            outcome, messages = "rejected", [str(error)]
        else:
            # Reading may find no object left to build.
            messages = [r.reason for r in results if r.status == "failed"]
            warned = any(r.warnings for r in results)
            outcome = "rejected" if messages else "repaired" if warned else "equal"
            if any("stopped: not done" in m for m in messages):
                outcome = "stopped"
            elif any("process died" in m or "Error: " in m for m in messages):
                outcome = "crashed"
        finally:
            os.chdir("/")
            tempfile.tempdir = None
            del os.environ["TMPDIR"]
        names = {r.name for r in results} if outcome in ("repaired", "equal") else set()
        left = {p.name for p in out.iterdir()} if out.exists() else set()
        if (after := tree(home)) != before or not left <= names:
            return "written outside", str(set(after.items()) ^ set(before.items()) or left)
        for message in messages:
            if "\n" in message or str(root) not in message:
                return outcome, f"not one line that names the file: {message!r}"
        if outcome == "equal":
            told = difference(results[0].folder, sound) if len(results) == 1 else "not one object"
            return "different" if told else "equal", told
        return outcome, messages[0] if outcome == "crashed" else ""


def tree(home: Path) -> dict[str, tuple[int, int]]:
    """Size and time of everything but the assets and the cache."""
    found = {}
    for path in home.rglob("*"):
        relative = path.relative_to(home)
        if relative.parts[0] not in ("out", "cache") and path.is_file() | path.is_symlink():
            found[str(relative)] = (path.stat().st_size, path.stat().st_mtime_ns)
    return found


if __name__ == "__main__":
    main()
