"""A trained policy: its file, and what `manipose evaluate` plays.

manipose evaluate articulated/open_middle_drawer --policy manipose_mj.learning:TrainedPolicy \
    --policy-args '{"path": "drawer/policy.npz"}' --obs-mode state+pose --control-mode pd_ee_pose --hz 10
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from manipose_mj.errors import InputError, unknown_name
from manipose_mj.learning import grip
from manipose_mj.learning.frames import FRAMES
from manipose_mj.learning.network import ActorCritic, NetworkConfig, Normaliser
from manipose_mj.policies.protocol import ActionSpace
from manipose_mj.storage.cache_file import new_cache_file

SHIPPED = "open_middle_drawer"
_FORMAT, _HEADER = 1, "header"


@dataclass(frozen=True)
class Trained:
    """What a training left.

    Attributes:
      network: Its actor counts.
      normaliser: Of features.
      config: Sizes of the network.
      hz: Actions a second of simulated time.
      task: Trained on, `"domain/name"`.
      seed: Of the training.
      frame: In which it sees and acts, a name of `frames.FRAMES`.
    """

    network: ActorCritic
    normaliser: Normaliser
    config: NetworkConfig
    hz: float
    task: str
    seed: int
    frame: str = "handle"

    def save(self, path: Path) -> None:
        """Write the actor, in half precision, and what is needed to run it."""
        header = {
            "format": _FORMAT,
            "network": dataclasses.asdict(self.config),
            "hz": self.hz,
            "task": self.task,
            "seed": self.seed,
            "frame": self.frame,
        }
        arrays: dict[str, Any] = {
            f"leaf_{i}": np.asarray(leaf, np.float16)
            for i, leaf in enumerate(jax.tree.leaves(eqx.filter(self.network.actor, eqx.is_array)))
        }
        arrays["mean"], arrays["variance"] = self.normaliser.mean, self.normaliser.variance
        arrays[_HEADER] = np.frombuffer(json.dumps(header).encode(), np.uint8)
        with new_cache_file(path) as scratch, scratch.open("wb") as file:
            np.savez_compressed(file, **arrays)

    @classmethod
    def load(cls, path: Path) -> Trained:
        """Read what `save` wrote; the critic is not in it.

        Raises:
          InputError: There is no such file, or it is none of these.
        """
        stored = _arrays(path)
        try:
            header = json.loads(bytes(stored[_HEADER]))
            if header["format"] != _FORMAT:
                raise InputError(f"{path}: format {header['format']}; expected {_FORMAT}")
            config = NetworkConfig(**header["network"])
            network = ActorCritic(config, key=jax.random.key(0))
            frame = header.get("frame", "handle")
            if frame not in FRAMES:
                raise ValueError(f"unknown frame {frame!r}")
            return cls(
                eqx.tree_at(lambda net: net.actor, network, _filled(network.actor, stored)),
                Normaliser(
                    jnp.asarray(stored["mean"]), jnp.asarray(stored["variance"]), jnp.asarray(1.0)
                ),
                config,
                header["hz"],
                header["task"],
                header["seed"],
                frame,
            )
        except KeyError as error:
            raise InputError(
                f"{path}: no trained policy can be read from it (lacks {error})"
            ) from None
        except (ValueError, TypeError) as error:
            raise InputError(f"{path}: no trained policy can be read from it ({error})") from None


def _arrays(path: Path) -> dict[str, np.ndarray]:
    """What a `.npz` file holds.

    Raises:
      InputError: There is no such file, or it is none of these.
    """
    try:
        with path.open("rb") as file:
            if zipfile.is_zipfile(file):
                stored = np.load(path)
                return {name: stored[name] for name in stored.files}
        reason = "it is no .npz file"
    except OSError as error:
        reason = error.strerror or str(error)
    except (ValueError, EOFError, zlib.error, zipfile.BadZipFile):
        reason = "it is damaged, or holds others than arrays of numbers"
    raise InputError(f"{path}: no trained policy can be read from it ({reason})")


def _filled(actor: eqx.nn.MLP, stored: Mapping[str, np.ndarray]) -> eqx.nn.MLP:
    """An actor of this shape with the numbers of a file."""
    arrays, fixed = eqx.partition(actor, eqx.is_array)
    leaves, structure = jax.tree.flatten(arrays)
    read = [jnp.asarray(stored[f"leaf_{i}"], jnp.float32) for i in range(len(leaves))]
    for i, (leaf, found) in enumerate(zip(leaves, read, strict=True)):
        if found.shape != leaf.shape:
            raise ValueError(f"leaf_{i} has shape {found.shape}; expected {leaf.shape}")
    return eqx.combine(jax.tree.unflatten(structure, read), fixed)


class TrainedPolicy:
    """Plays the mean action; the same observations give the same actions."""

    def __init__(self, path: str = SHIPPED) -> None:
        """Reads the file.

        Args:
          path: Of a file, or the name of a policy that ships.

        Raises:
          InputError: There is none, or it is no trained policy.
        """
        weights = Path(str(resources.files("manipose_mj.learning"))) / "weights"
        own = weights / f"{path}.npz"
        file = own if own.is_file() else Path(path)
        if not file.exists() and path == file.stem:  # meant as a name
            shipped = [each.stem for each in weights.glob("*.npz")]
            raise unknown_name("trained policy", path, shipped)
        self._trained = trained = Trained.load(file)
        self._frame = FRAMES[trained.frame]
        self.metadata = {
            "trained on": trained.task,
            "seed": trained.seed,
            "weights sha256": hashlib.sha256(file.read_bytes()).hexdigest(),
        }
        self._act = jax.jit(self.act)

    def act(self, observation: Mapping[str, Array]) -> Float[Array, "worlds 7"]:
        """The actions of many worlds, for `jax.jit`.

        Raises:
          InputError: The observations lack something that it sees.
        """
        frame = self._frame
        missing = [name for name in frame.SEEN if name not in observation]
        if missing:
            raise InputError(
                f"this policy sees {', '.join(missing)}; add --obs-mode {grip.OBS_MODE}, and take {frame.NEEDS}"
            )
        seen = self._trained.normaliser(frame.features(observation))
        return frame.command(observation, self._trained.network.mean(seen))

    def reset(self, *, task: str, instruction: str, seed: int, action_space: ActionSpace) -> None:
        """Check that actions mean what they meant in training.

        Raises:
          InputError: They do not.
        """
        mode, hz = grip.CONTROL_MODE, self._trained.hz
        if action_space.control_mode != mode or abs(action_space.hz - hz) > 1e-6:
            raise InputError(
                f"this policy acts in {mode} at {hz:g} Hz; got {action_space.control_mode} at {action_space.hz:g} "
                f"Hz: add --control-mode {mode} --hz {hz:g}"
            )

    def infer(self, obs: Mapping[str, Any]) -> dict[str, Any]:
        """The next action.

        Raises:
          InputError: The observations lack something that it sees.
        """
        seen = {
            name: jnp.asarray(obs[name], jnp.float32)[None]
            for name in self._frame.SEEN
            if name in obs
        }
        return {"actions": np.asarray(self._act(seen), float)}
