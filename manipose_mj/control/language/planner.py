"""The planner that asks a language model, with a bounded number of repairs."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from manipose_mj.control.language.completion import one_line
from manipose_mj.control.language.description import RULES, scene_text
from manipose_mj.control.language.destinations import Destination, named_destinations
from manipose_mj.control.language.exchanges import (
    INSTRUCTION,
    Answer,
    ChatModel,
    Exchange,
    Message,
    NoReplyError,
    append_exchange,
)
from manipose_mj.control.language.reply import (
    NamedMove,
    RefusedError,
    plain,
    read_again,
    read_reply,
    reply_schema,
    resolved_plans,
    step_text,
)
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.plan import CandidatePlan, Step
from manipose_mj.control.planning.set_aside import places_aside
from manipose_mj.control.planning.table_places import CONTACT, HOME
from manipose_mj.control.scene.collision_query import CollisionQuery
from manipose_mj.control.scene.scene_estimate import SceneEstimate
from manipose_mj.errors import InputError
from manipose_mj.tasks.goals import Goal, Tolerance

_NO_TEXT = "(no text)"  # endpoints refuse empty messages
MAX_REPAIRS = 2
_MOST_TOLD = 60  # steps that were carried out, the latest
_MOST_SENT_BACK = 20_000  # characters of a plan that is to be mended
_MOST_QUOTED = 100  # characters of its last answer, in the reason of a failure
_TOO_LONG = "reply: it was cut off, for it is longer than an answer may be; give a shorter one"


class LanguagePlanner:
    """Asks for a plan, has its mistakes put right, and resolves its places.

    What a model may do is the same as for any planner: the reply is data of a schema, and is checked before
    anything moves.
    """

    def __init__(
        self, model: ChatModel, instruction: str | None = None, record: Path | None = None
    ) -> None:
        """Plans by this model.

        Args:
          model: What is asked.
          instruction: What to do instead of what the episode asks for.
          record: File that every exchange is added to.
        """
        self._model, self._instruction, self._record = model, instruction, record
        self._asked_for = instruction or ""
        self._episode: tuple[str, int | None] = ("", None)
        self._number = 0  # of the next question of this episode
        self._left: tuple[Step | NamedMove, ...] = ()  # of the latest answer, to be carried out
        self._done: list[str] = []  # what a model is told of this episode

    @property
    def follows_goals(self) -> bool:
        """Whether it plans what the episode asks for."""
        return self._instruction is None

    def name_episode(self, task: str, episode: int) -> None:
        """This episode comes next; its exchanges bear its name."""
        self._episode, self._number = (task, episode), 0
        self._model.begin(task, episode)

    def reset(self, instruction: str) -> None:
        """An episode begins, which asks for this in words."""
        self._asked_for = self._instruction or instruction
        self._left, self._done = (), []

    def carried_out(self, step: Step) -> None:
        """This step of the present plan was carried out: the next question says so."""
        as_answered = bool(self._left) and plain(self._left[0]) is step
        self._done.append(step_text(self._left[0] if as_answered else step))
        # What a plan sets down on the way is no step of the answer: what is left of that is not known then.
        self._left = self._left[1:] if as_answered else ()

    def failed(self, reason: str) -> None:
        """The rest of the answer is given up: the next question says why."""
        self._left = ()
        self._done.append(f"given up, with the hand emptied: {one_line(reason)}")

    def step_by_step(self, goals: tuple[Goal, ...], estimate: SceneEstimate) -> bool:
        """A model plans to the end."""
        return False

    def candidates(
        self,
        goals: tuple[Goal, ...],
        estimate: SceneEstimate,
        planner: MotionPlanner,
        tolerance: Tolerance,
    ) -> Iterator[CandidatePlan]:
        """Plans that do what the model says, the straight one first.

        An answer of which only the first steps were carried out, before the scene was looked at, goes on with the others
        at their places as they are now; where these are wrong now, the model is asked again.

        Args:
          goals: Of the task.
          estimate: What is where.
          planner: Of motions in the scene of `estimate`.
          tolerance: The task's; a model is not told.

        Raises:
          InputError: The model does not answer, declines, or its last repair is still wrong.
          RecordError: The exchange cannot be written.
        """

        # What was opened may stand where the arm waits otherwise: every place would seem taken.
        blocked = planner.collides(HOME, CollisionQuery(clearance=CONTACT))
        joints = estimate.joints if blocked else HOME

        def free(obj):
            return places_aside(obj, (), estimate, planner, joints=joints)

        destinations = named_destinations(goals, estimate, free)
        steps = self._what_is_left(estimate, destinations)
        if not steps:
            messages = self.question(scene_text(estimate, destinations))
            schema = reply_schema(estimate, destinations)
            steps = self.steps(messages, schema, estimate, destinations)
        self._left = steps
        for plan in resolved_plans(steps, estimate, planner):
            yield CandidatePlan(lambda plan=plan: plan)

    def _what_is_left(
        self, estimate: SceneEstimate, destinations: Mapping[str, Destination]
    ) -> tuple[Step | NamedMove, ...]:
        """The steps of the latest answer that come next; none where they cannot be carried out any more."""
        try:
            return read_again(self._left, estimate, destinations)
        except InputError:
            return ()

    def steps(
        self,
        messages: list[Message],
        schema: dict[str, Any],
        estimate: SceneEstimate,
        destinations: Mapping[str, Destination],
    ) -> tuple[Step | NamedMove, ...]:
        """The steps of the model's answer, after as many repairs as it needs and may have.

        Args:
          messages: The question.
          schema: Of the answer.
          estimate: What is where.
          destinations: Places by name.

        Raises:
          InputError: The model does not answer, declines, or its last repair is still wrong.
          RecordError: The exchange cannot be written.
        """
        mistake = said = ""
        for _ in range(1 + MAX_REPAIRS):
            answer = self._ask(messages, schema)
            try:
                return read_reply(answer.text, estimate, destinations)
            except RefusedError as refusal:
                raise InputError(f"the language model declines: {refusal}") from None
            except InputError as error:
                mistake = _TOO_LONG if answer.cut else str(error)
                said = " ".join(answer.text.split())[:_MOST_QUOTED]
            messages = [
                *messages,
                {"role": "assistant", "content": answer.text[:_MOST_SENT_BACK] or _NO_TEXT},
                {"role": "user", "content": f"That plan is refused: {mistake}. Mend it."},
            ]
        raise InputError(
            f"the language model's plan is still wrong after {MAX_REPAIRS} repairs: {mistake}; "
            f"its last answer begins with {said!r}"
        )

    def question(self, scene: str) -> list[Message]:
        """The conversation that opens an exchange."""
        lines = "".join(f"\n- {each}" for each in self._done[-_MOST_TOLD:])
        done = f"\nDone so far:{lines}" if lines else ""
        return [
            {"role": "system", "content": RULES},
            {"role": "user", "content": f"{scene}{done}{INSTRUCTION}{self._asked_for}"},
        ]

    def _ask(self, messages: list[Message], schema: dict[str, Any]) -> Answer:
        started = time.perf_counter()
        answer, error = Answer(""), "the question was broken off"
        try:
            answer, error = self._model.answer(messages, schema), ""
        except NoReplyError as failure:
            error = str(failure)
        finally:  # whatever came of it
            self._keep(messages, schema, answer, error, time.perf_counter() - started)
        if error:
            raise InputError(f"the language model gives no plan: {error}")
        return answer

    def _keep(
        self,
        messages: list[Message],
        schema: dict[str, Any],
        answer: Answer,
        error: str,
        seconds: float,
    ) -> None:
        """Put an exchange on record.

        Raises:
          RecordError: It cannot be written.
        """
        number, self._number = self._number, self._number + 1
        if self._record is None:
            return
        task, episode = self._episode
        exchange = Exchange(
            self._model.name,
            self._model.parameters,
            messages,
            schema,
            answer.text,
            error,
            round(seconds, 3),
            answer.cut,
            task,
            episode,
            number,
            self._instruction or "",
            round(time.time(), 3),
        )
        append_exchange(self._record, exchange)
