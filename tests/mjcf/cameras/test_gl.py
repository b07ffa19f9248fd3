"""The GL probe: it answers for every platform, never raises, and leaves this process alone."""

import subprocess
import sys
from types import SimpleNamespace

import pytest

from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras import gl


@pytest.fixture
def fresh_probe():
    gl.probe.cache_clear()
    yield
    gl.probe.cache_clear()


def test_every_platform_gets_an_answer():
    statuses = gl.probe_all()
    assert [s.backend for s in statuses] == list(gl.BACKENDS)
    for status in statuses:
        assert status.works == (not status.reason) == (not status.remedy)
        assert "\n" not in status.reason


def test_a_probe_is_made_once(monkeypatch, fresh_probe):
    calls = []

    def run(command, **settings):
        calls.append(settings["env"]["MUJOCO_GL"])
        return SimpleNamespace(returncode=0, stdout="rendered\n", stderr="")

    monkeypatch.setattr(gl.subprocess, "run", run)
    assert gl.probe("osmesa").works and gl.probe("osmesa").works
    assert calls == ["osmesa"]


@pytest.mark.parametrize(
    ("child", "reason"),
    [
        (SimpleNamespace(returncode=-11, stdout="", stderr=""), "crashed with signal 11"),
        (
            SimpleNamespace(
                returncode=1,
                stdout="",
                stderr="Traceback (most recent call last):\n  File x\n"
                "ImportError: no libOSMesa\nException ignored in: <f>\n",
            ),
            "ImportError: no libOSMesa",
        ),
        (SimpleNamespace(returncode=1, stdout="", stderr=""), "no message"),
        (SimpleNamespace(returncode=0, stdout="", stderr=""), "no message"),
    ],
)
def test_failures_are_told_in_one_line(monkeypatch, fresh_probe, child, reason):
    monkeypatch.setattr(gl.subprocess, "run", lambda *a, **k: child)
    status = gl.probe("osmesa")
    assert not status.works and status.reason == reason
    assert "libosmesa6" in status.remedy


def test_a_hanging_driver_is_given_up(monkeypatch, fresh_probe):
    def hang(command, timeout, **settings):
        raise subprocess.TimeoutExpired(command, timeout)

    monkeypatch.setattr(gl.subprocess, "run", hang)
    assert "no picture within" in gl.probe("egl").reason


def test_without_a_display_glfw_is_not_tried(monkeypatch, fresh_probe):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(gl.sys, "platform", "linux")
    assert "DISPLAY" in gl.probe("glfw").reason


def test_the_environment_decides(monkeypatch):
    works = {"egl": False, "osmesa": True, "glfw": False}
    monkeypatch.setattr(gl, "probe", lambda b: gl.GLStatus(b, works[b]))
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    assert gl.working_backend() == "osmesa"
    monkeypatch.setenv("MUJOCO_GL", "egl")
    assert gl.working_backend() is None
    monkeypatch.setenv("MUJOCO_GL", "disable")
    assert gl.working_backend() is None
    with pytest.raises(InputError, match="switched off"):
        gl.activate()


def test_unknown_platform():
    with pytest.raises(InputError, match="did you mean osmesa"):
        gl.probe("osmeso")


def test_importing_the_pictures_binds_no_gl():
    script = (
        "import sys, manipose_mj.mjcf.cameras.pictures, manipose_mj.mjcf.cameras.gl;"
        "assert 'OpenGL' not in sys.modules, 'PyOpenGL was imported'"
    )
    environment = {**gl.os.environ, "MUJOCO_GL": "disable"}
    child = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False
    )
    assert child.returncode == 0, child.stderr
