"""The page of protocol v1 counts the starts that are certified, unsolved and untried."""

from __future__ import annotations

import importlib.util
from types import SimpleNamespace

from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.certification.certificates import causes, load_certificates
from tests.places import ROOT


def load_hook():
    file = ROOT / "docs" / "hooks" / "certificates.py"
    spec = importlib.util.spec_from_file_location("certificates_hook", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_counts_what_the_package_ships():
    hook, v1 = load_hook(), protocol.load("v1")
    page = SimpleNamespace(file=SimpleNamespace(src_uri=hook.PAGE))
    source = (ROOT / "docs" / hook.PAGE).read_text(encoding="utf-8")
    shown = hook.on_page_markdown(source, page)
    assert hook.PLACE in source and hook.PLACE not in shown
    known = load_certificates(v1)
    untried = 100 * len(v1.tasks) - len(known.solved) - len(known.unsolved)
    unsolved = sum(causes(known).values())
    assert (
        f"| all | {len(known.solved)} of {100 * len(v1.tasks)} | {unsolved} | {untried} |" in shown
    )
    assert all(f"| `{task}` |" in shown for task in v1.tasks)
