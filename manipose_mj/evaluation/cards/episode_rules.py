"""What a protocol rules out about a single result, whoever played it."""

from __future__ import annotations

from collections.abc import Iterator

from manipose_mj.evaluation.policy_settings import CONTROL_HZ
from manipose_mj.evaluation.protocol import FrozenEpisode, FrozenTask
from manipose_mj.evaluation.records import EpisodeResult

# Rounding lets the simulator's clock reach the time limit a control step late.
_LATE = 1
_NEVER_NEGATIVE = (
    "steps",
    "sim_time",
    "wall_s",
    "policy_s",
    "decisions",
    "clipped_actions",
    "max_penetration",
    "translation_error",
    "rotation_error",
    "estimate_translation_error",
    "estimate_rotation_error",
)
_ROUNDING = 1e-9


def broken_rules(task: FrozenTask, episode: FrozenEpisode, result: EpisodeResult) -> Iterator[str]:
    """What cannot be about a result, for people, each such as `steps is -1; expected 0 or more`."""
    for name in _NEVER_NEGATIVE:
        value = getattr(result, name)
        if value is not None and value < 0:
            yield f"{name} is {value!r}; expected 0 or more"
    most = round(task.horizon * CONTROL_HZ) + _LATE
    if result.steps > most:
        yield f"steps is {result.steps}; its time limit of {task.horizon:g} s allows {most}"
    if result.sim_time > most / CONTROL_HZ + _ROUNDING:
        yield f"sim_time is {result.sim_time:g}; its time limit is {task.horizon:g} s"
    named = _object(episode)
    if named is not None and result.object not in ("", named):
        yield f"is about {result.object}; the protocol has {named}"
    if result.success_at_end:
        yield from _of_success(task, result)


def _object(episode: FrozenEpisode) -> str | None:
    """What an episode is about, where the protocol leaves that to no seed."""
    # What a seed draws is drawn again where it finds no start; what was asked for never is.
    alone = episode.furniture is not None and episode.objects == (episode.furniture,)
    return episode.furniture if alone else episode.object


def _of_success(task: FrozenTask, result: EpisodeResult) -> Iterator[str]:
    if not result.object:
        yield "succeeds and is about no object"
    if result.reason:
        yield f"succeeds and has the reason {result.reason!r:.80} for a failure"
    for kind in ("translation", "rotation"):
        error, most = getattr(result, f"{kind}_error"), task.tolerance[kind]
        if error is not None and error > most + _ROUNDING:
            yield f"succeeds with {kind}_error {error:g}; the protocol allows {most:g}"
