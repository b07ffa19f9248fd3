"""The citation file agrees with the package, and the README cites the same paper."""

from __future__ import annotations

import tomllib

import yaml

import manipose_mj
from tests.docs.pages import read
from tests.places import ROOT


def test_the_citation_is_of_this_version_and_paper():
    citation = yaml.safe_load(read(ROOT / "CITATION.cff"))
    project = tomllib.loads(read(ROOT / "pyproject.toml"))["project"]
    assert citation["version"] == manipose_mj.__version__ == project["version"]
    assert citation["license"] == project["license"]
    assert citation["cff-version"] == "1.2.0" and citation["authors"] and citation["message"]
    (paper,) = citation["references"]
    (number,) = [i["value"].removeprefix("arXiv:") for i in paper["identifiers"]]
    readme = read(ROOT / "README.md")
    assert number in readme
    assert paper["title"].partition(": ")[2] in readme
