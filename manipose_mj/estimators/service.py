"""An estimator behind checks: asked for one object at a time, wherever it runs."""

from __future__ import annotations

import atexit
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from manipose_mj.errors import ServerLostError
from manipose_mj.estimators.answer import EstimatorFailedError, checked_answer
from manipose_mj.estimators.observation import Observation
from manipose_mj.ppf_jax.pose_estimate import PoseEstimate
from manipose_mj.user_code import reason_of
from manipose_mj.wire.address import shown
from manipose_mj.wire.client import Client, RemoteFailureError


class Estimator(Protocol):
    """What a factory makes."""

    def estimate(self, observation: Observation, /) -> Mapping[str, Any] | PoseEstimate:
        """The pose of the object; keys are those of `observation` and `answer`."""
        ...


class RemoteEstimator:
    """An estimator on a server: an observation is sent as it is, the answer comes back as it is.

    Attributes:
      address: Such as `ws://localhost:8000`.
    """

    def __init__(self, address: str) -> None:
        """Connects.

        Raises:
          InputError: Nobody answers there.
        """
        self.address = address
        self._client = Client(address, "estimator server")
        self._client.open()
        atexit.register(self.close)

    @property
    def metadata(self) -> dict[str, Any]:
        """What the server said of itself."""
        return self._client.metadata

    def close(self) -> None:
        """Hangs up; the next question connects again."""
        self._client.close()

    def estimate(self, observation: Observation, /) -> Any:
        """The server's answer; connects again after the server has failed on a question.

        Raises:
          ServerLostError: It is there no more.
          EstimatorFailedError: It failed on this question.
        """
        try:
            return self._client.ask(observation)
        except RemoteFailureError as error:
            self.close()
            raise EstimatorFailedError(f"{shown(self.address)}: {error}") from error


class EstimatorService:
    """Somebody's estimator, whose mistakes are told from ours.

    Attributes:
      name: For messages.
      estimator: It.
    """

    def __init__(self, name: str, estimator: Estimator) -> None:
        self.name, self.estimator = name, estimator

    def close(self) -> None:
        """Hangs up, where the estimator is on a server."""
        if isinstance(self.estimator, RemoteEstimator):
            self.estimator.close()

    def estimate(self, observation: Observation) -> PoseEstimate:
        """The checked answer to an observation.

        Raises:
          EstimatorFailedError: It raised an error or gave no pose; the message names it.
          ServerLostError: Its server is there no more.
        """
        mesh = observation.get("mesh")
        given = None if mesh is None else {name: np.array(values) for name, values in mesh.items()}
        try:
            answer = self.estimator.estimate(observation)
        except (ServerLostError, MemoryError):
            raise
        except EstimatorFailedError as error:
            raise EstimatorFailedError(f"estimator {self.name}: {error}") from error
        except (Exception, SystemExit) as error:  # whatever a stranger's code raises
            raise EstimatorFailedError(
                f"estimator {self.name} raised {reason_of(error)}"
            ) from error
        try:
            return checked_answer(answer, given)  # raises another error only by a mistake of ours
        except EstimatorFailedError as error:
            raise EstimatorFailedError(f"estimator {self.name}: {error}") from error
