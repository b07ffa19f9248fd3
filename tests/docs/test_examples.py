"""Python blocks of README and guides compile, and run from top to bottom as a reader would run them."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest

from tests.docs.pages import PAGES, blocks, name
from tests.places import ROOT

WITH_CODE = [page for page in PAGES if blocks(page, "python")]
OWN_TASKS = (
    ROOT / "docs" / "guides" / "own_tasks.md"
)  # tests/conformance runs it at every front door
RUN = [page for page in WITH_CODE if page != OWN_TASKS]


@pytest.mark.parametrize("page", WITH_CODE, ids=name)
def test_python_blocks_compile(page):
    for block in blocks(page, "python"):
        compile("\n" * (block.line - 1) + block.code, str(page), "exec")


@pytest.mark.full
@pytest.mark.parametrize("page", RUN, ids=name)
def test_python_blocks_run(page, tmp_path):
    """In a process of their own: they register tasks, which other tests must not see."""
    code = "\n".join(block.code for block in blocks(page, "python"))
    script = tmp_path / "page.py"
    script.write_text(code, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]


def test_commands_in_pages_exist():
    """`manipose COMMAND` and `benchmarks/NAME.py` in shell blocks are there, with the options shown."""
    help_of: dict[tuple[str, ...], str] = {}
    for page in PAGES:
        for block in blocks(page, "sh"):
            for line in block.code.replace("\\\n", " ").splitlines():
                for script in re.findall(r"\bbenchmarks/[\w/]+\.py", line):
                    assert (ROOT / script).is_file(), f"{name(page)} names {script}"
                found = re.match(
                    r"\s*manipose ((?:assets |demos |pose |protocol |train )?[\w-]+)(.*)",
                    line.partition("#")[0],
                )
                if found is None:
                    continue
                words = tuple(found[1].split())
                if words not in help_of:
                    help_of[words] = _help(words)
                for option in re.findall(r"--[\w-]+", found[2]):
                    assert option in help_of[words], (
                        f"{name(page)}: manipose {' '.join(words)} {option}"
                    )
    assert len(help_of) > 8


def _help(words: tuple[str, ...]) -> str:
    done = subprocess.run(
        [sys.executable, "-c", "from manipose_mj.cli.main import main; main()", *words, "--help"],
        env={**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"manipose {' '.join(words)}: {done.stderr[-500:]}"
    return done.stdout


def test_names_in_pages_exist():
    """Dotted names of the package in pages are modules of it, or something that such a module names."""
    for page in PAGES:
        for dotted in re.findall(
            r"\bmanipose_mj(?:\.[a-zA-Z_]\w*)+", page.read_text(encoding="utf-8")
        ):
            parts, module = dotted.split("."), ROOT
            while parts and ((module / parts[0]).is_dir() or (module / f"{parts[0]}.py").is_file()):
                module = module / parts.pop(0)
            file = module / "__init__.py" if module.is_dir() else module.with_suffix(".py")
            text = file.read_text(encoding="utf-8")
            for part in parts[:1]:
                assert re.search(rf"\b{part}\b", text), f"{name(page)} names {dotted}"
