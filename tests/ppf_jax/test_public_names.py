"""What users need is importable from the package, which loads no JAX by itself."""

from __future__ import annotations

import subprocess
import sys

import pytest

from manipose_mj import ppf_jax


@pytest.mark.parametrize("name", ppf_jax.__all__)
def test_every_public_name_is_there(name):
    assert getattr(ppf_jax, name).__name__ == name
    assert name in ppf_jax.__all__


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="has no attribute 'PoseEstimater'"):
        ppf_jax.PoseEstimater  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]


def test_the_package_alone_loads_no_jax():
    script = "import sys, manipose_mj.ppf_jax; sys.exit('jax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0
