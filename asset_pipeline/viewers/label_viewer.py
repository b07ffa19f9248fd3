"""Labels on their meshes in the browser, to be looked at, moved and saved; needs viser."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from functools import partial
from types import TracebackType
from typing import Any

import numpy as np

from asset_pipeline.viewers.label_scene import LabelScene
from asset_pipeline.viewers.label_session import OBJECT, LabelSession
from manipose_mj.assets.symmetry_names import SYMMETRIES, symmetry_name
from manipose_mj.errors import InputError, how_to_install

log = logging.getLogger(__name__)

TITLE = "manipose labels"
# Of an adjustment: [deg] and [m].
STEPS = {
    "0.5 deg, 0.5 mm": (0.5, 0.0005),
    "5 deg, 5 mm": (5.0, 0.005),
    "90 deg, 2 cm": (90.0, 0.02),
}
AXES = "XYZ"
STEP_SIZES = {"+": 1.0, "-": -1.0}
UNNAMED = "other"
SHOWN = {"planes": True, "areas": True, "grasps": False, "gizmo": True}
# Where the camera stands, in the label frame, in diagonals of the box: as in the contact sheets.
TOOL_EYE, UPRIGHT_EYE = np.array([0.3, 0.6, 0.9]), np.array([0.5, 0.8, 0.6])


class LabelViewer:
    """A page that shows the session's open asset; its buttons move and save the label.

    The public methods are what the buttons do. What cannot be done is said on the page.
    """

    def __init__(self, session: LabelSession, *, host: str, port: int) -> None:
        """Serve the page.

        Args:
          session: What is shown; the viewer is its only user from now on.
          host: Address to serve on.
          port: The next free one is taken where it is not.

        Raises:
          InputError: viser is not installed.
        """
        try:
            import viser  # pyright: ignore[reportMissingImports]
        except ImportError:
            raise InputError(f"the label viewer needs viser; {how_to_install('label')}") from None
        self.session = session
        self._lock = threading.RLock()  # viser calls from a pool of threads
        self._updating = False
        self._server = viser.ViserServer(host=host, port=port, label=TITLE, verbose=False)
        self._scene = LabelScene(self._server.scene, self._dragged)
        self._add_controls()
        self._open()

    @property
    def address(self) -> str:
        """The page's."""
        return f"http://{self._server.get_host()}:{self._server.get_port()}"

    def wait(self) -> None:
        """Serve until the process is interrupted."""
        self._server.sleep_forever()

    def __enter__(self) -> LabelViewer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._server.stop()

    def step(self, count: int) -> None:
        """Open the asset so many places on."""
        self._do(lambda: self.session.step(count), self._open)

    def open(self, name: str) -> None:
        """Open another asset."""
        self._do(lambda: self.session.open(name), self._open)

    def select(self, target: str) -> None:
        """Move another label of the open asset."""
        self._do(lambda: self.session.select(target), self._draw)

    def turn(self, axis: str, sign: float) -> None:
        """Turn the label by a step about its `"X"`, `"Y"` or `"Z"`, back where `sign` is -1."""
        degrees = sign * STEPS[self._step.value][0]
        self._do(lambda: self.session.turn(AXES.index(axis), degrees), self._draw)

    def shift(self, axis: str, sign: float) -> None:
        """Shift the label by a step along one of its axes."""
        metres = sign * STEPS[self._step.value][1]
        self._do(lambda: self.session.shift(AXES.index(axis), metres), self._draw)

    def set_symmetry(self, name: str) -> None:
        """Say what symmetry the shape has."""
        self._do(lambda: self.session.set_symmetry(name), self._draw)

    def reset(self) -> None:
        """Back to what is saved."""
        self._do(self.session.reset, self._draw)

    def reset_to_measured(self) -> None:
        """Back to what was measured."""
        self._do(self.session.reset_to_measured, self._draw)

    def save(self) -> None:
        """Save the label."""
        self._do(self.session.save, self._draw, f"saved to {self.session.labels}")

    def forget(self) -> None:
        """Take back what was saved."""
        self._do(self.session.forget, self._open, f"taken out of {self.session.labels}")

    def _add_controls(self) -> None:
        gui, names = self._server.gui, self.session.names
        self._asset: Any = gui.add_dropdown("asset", names, initial_value=names[0])
        self._when_chosen(self._asset, lambda: self.open(self._asset.value))
        self._add_buttons("", {"previous": lambda: self.step(-1), "next": lambda: self.step(1)})
        self._text = gui.add_markdown("")
        with gui.add_folder("label"):
            self._target: Any = gui.add_dropdown("of", (OBJECT,))
            self._when_chosen(self._target, lambda: self.select(self._target.value))
            self._symmetry: Any = gui.add_dropdown("symmetry", (*SYMMETRIES, UNNAMED))
            self._when_chosen(self._symmetry, lambda: self.set_symmetry(self._symmetry.value))
            self._step: Any = gui.add_dropdown("step", tuple(STEPS))
            for label, adjust in (("turn", self.turn), ("shift", self.shift)):
                for sign, factor in STEP_SIZES.items():
                    moves = {axis: partial(adjust, axis, factor) for axis in AXES}
                    self._add_buttons(f"{label} {sign}", moves)
        save = gui.add_button("save", color="green")
        save.on_click(lambda _: self.save())
        self._add_buttons(
            "",
            {"reset": self.reset, "as measured": self.reset_to_measured, "forget": self.forget},
        )
        with gui.add_folder("show"):
            self._opacity: Any = gui.add_slider("opacity", 0.1, 1.0, 0.1, 1.0)
            self._when_chosen(self._opacity, self._draw_visuals)
            self._shown: dict[str, Any] = {n: gui.add_checkbox(n, on) for n, on in SHOWN.items()}
            for box in self._shown.values():
                self._when_chosen(box, self._draw)

    def _add_buttons(self, label: str, actions: dict[str, Callable[[], None]]) -> None:
        group = self._server.gui.add_button_group(label, tuple(actions))
        group.on_click(lambda _: actions[group.value]())

    def _when_chosen(self, control: Any, action: Callable[[], None]) -> None:
        """Act on what a person chose, not on what this program put there."""

        def act(_: Any) -> None:
            with self._lock:
                if not self._updating:
                    action()

        control.on_update(act)

    def _do(self, action: Callable[[], None], draw: Callable[[], None], done: str = "") -> None:
        with self._lock:
            try:
                action()
            except (InputError, OSError) as error:
                log.warning("%s", error)
                done = f"**not done:** {error}"
            draw()
            self._describe(done)

    def _dragged(self, pose: np.ndarray) -> None:
        with self._lock:
            self.session.place(pose)
            self._draw_marks()
            self._describe("")

    def _open(self) -> None:
        self._draw_visuals()
        self._draw()
        self._describe("")
        self._aim()

    def _draw_visuals(self) -> None:
        self._scene.draw_visuals(self.session.asset.folder, self._opacity.value)

    def _draw_marks(self) -> None:
        shown = [name for name, box in self._shown.items() if box.value]
        self._scene.draw_marks(self.session.shown, self.session.asset.label, shown)

    def _draw(self) -> None:
        self._draw_marks()
        self._scene.place_gizmo(self.session.label, self._shown["gizmo"].value)

    def _describe(self, done: str) -> None:
        """Bring text and controls up to date with the session."""
        session, label = self.session, self.session.label
        name, quality = session.asset.folder.name, session.asset.label_quality
        lines = [
            f"**{name}**: {session.asset.category}, {label.object_type}, "
            f"{session.names.index(name) + 1} of {len(session.names)}"
        ]
        if quality is None:
            lines.append("made with the shape, or set by a person")
        else:
            lines.append(f"confidence {quality.confidence:.2f}")
            lines += [f"{k}: off by {1000 * v:.1f} mm" for k, v in quality.residuals.items()]
        self._text.content = "\n\n".join([*lines, *([done] if done else [])])
        group = symmetry_name(label.symmetry)
        self._updating = True
        try:
            self._asset.value = name
            self._target.options = session.targets
            self._target.value = session.target
            self._symmetry.value = group if group in SYMMETRIES else UNNAMED
        finally:
            self._updating = False

    def _aim(self) -> None:
        """The whole object in view, from the side that its label says is the front."""
        label = self.session.asset.label
        tool = label.object_type == "functional"
        up = label.rotation[:, 1 if tool else 0]
        away = label.rotation @ (TOOL_EYE if tool else UPRIGHT_EYE)
        eye = label.origin + away * float(np.linalg.norm(label.extents))
        first = self._server.initial_camera
        first.up, first.position, first.look_at = up, eye, label.origin
        for client in self._server.get_clients().values():
            camera: Any = client.camera
            camera.up_direction, camera.position, camera.look_at = up, eye, label.origin
