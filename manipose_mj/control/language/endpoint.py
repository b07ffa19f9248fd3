"""A model behind an OpenAI-compatible endpoint, by the official client; brings the extra `llm`."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any

from manipose_mj.control.language.address import (
    URL_VARIABLE,
    check_address,
    credentials_in,
    no_address,
    without_query,
)
from manipose_mj.control.language.completion import answer_in, complaint_in, one_line
from manipose_mj.control.language.exchanges import Answer, Message, NoReplyError
from manipose_mj.errors import InputError, how_to_install

KEY_VARIABLE = "OPENAI_API_KEY"
_TIMEOUT = 60.0  # [s]
_RETRIES = 3  # after 429, 5xx and lost connections; the client waits in between
_WITH_WAITS = 1.25  # of the time of all tries, for what lies between them
# Of ways to ask for structured output, from the strictest on, that which an endpoint may have in the place of another.
_FORMS = {"json_schema": "json_object", "json_object": None}
_NAMES = {
    "response_format": "response_format|json_schema|json_object"
}  # of a parameter, if several
_NOT_TAKEN = (400, 422)  # status of what an endpoint does not take
# A question that is too long is as long without a parameter, though the refusal may list them.
_TOO_LONG = (
    r"context[ _](length|window|size)|(prompt|input|messages) (is|are) too long|too many tokens"
)


class EndpointModel:
    """Asks a chat endpoint, with temperature 0, a seed and structured output; without those that it does not take."""

    def __init__(
        self,
        name: str,
        base_url: str | None = None,
        *,
        timeout: float = _TIMEOUT,
        retries: int = _RETRIES,
    ) -> None:
        """Connects to nothing yet.

        Args:
          name: Of the model.
          base_url: Of the endpoint, such as `http://localhost:8000/v1`; by default that of the variable
            `OPENAI_BASE_URL`, or OpenAI's.
          timeout: For an answer [s]; all tries together take at most a quarter longer than each for itself.
          retries: How often a question that failed for the moment is asked again.

        Raises:
          InputError: The client is not installed, the default endpoint has no key, or address or key cannot be one.
        """
        try:
            import openai
        except ImportError:
            raise InputError(
                f"a language model needs the package openai; {how_to_install('llm')}"
            ) from None
        option = URL_VARIABLE if base_url is None else "--base-url"
        base_url = os.environ.get(URL_VARIABLE) or None if base_url is None else base_url
        key = os.environ.get(KEY_VARIABLE, "").strip()
        if not key and base_url is None:
            raise InputError(
                f"no key for the language model; set {KEY_VARIABLE}, or give --base-url"
            )
        if not (key.isascii() and key.isprintable()):
            raise InputError(f"{KEY_VARIABLE}: holds characters that no key has; copy the key anew")
        if base_url is not None:
            check_address(base_url, option)
        address, query = (None, {}) if base_url is None else without_query(base_url)
        self.name = name
        self.parameters: dict[str, Any] = {
            "temperature": 0.0,
            "seed": 0,
            "response_format": "json_schema",
        }
        self._errors = openai
        self._credentials = credentials_in(base_url or "", key)
        self._longest = _WITH_WAITS * timeout * (1 + retries)
        try:
            self._client = openai.OpenAI(
                api_key=key or "none",  # local servers ask for no key, but the client for any
                base_url=address,
                default_query=query,
                timeout=timeout,
                max_retries=retries,
            )
        except Exception:  # the library of the client's choice has errors of its own for addresses
            raise no_address(base_url or "", option) from None

    def begin(self, task: str, episode: int) -> None:
        """An episode is as good as any other."""

    def answer(self, messages: list[Message], schema: dict[str, Any]) -> Answer:
        """The model's reply, without key, user, password and query.

        Raises:
          NoReplyError: It did not answer, or declined in its own way.
        """
        try:
            answer = answer_in(self._body(messages, schema))
        except NoReplyError as failure:
            # Cut last: half of a key would not be found.
            said = self._credentials.removed_from_error(str(failure))
            raise NoReplyError(one_line(said)) from None
        return Answer(self._credentials.removed_from_reply(answer.text), answer.cut)

    def _body(self, messages: list[Message], schema: dict[str, Any]) -> bytes:
        """The body of the answer to a question that is asked for less where an endpoint does not take all.

        Raises:
          NoReplyError: There is none.
        """
        ends = time.monotonic() + self._longest
        while True:
            try:
                return _within(ends, lambda: self._asked(messages, schema))
            except (self._errors.APITimeoutError, TimeoutError):
                raise NoReplyError("no answer in time") from None
            except self._errors.APIStatusError as error:
                parameter, said = complaint_in(error.response.content)
                if error.status_code in _NOT_TAKEN and self._ask_for_less(parameter, said):
                    continue
                status = f"the endpoint answered with status {error.status_code}"
                raise NoReplyError(f"{status}: {said}" if said.strip() else status) from None
            except self._errors.APIConnectionError:
                raise NoReplyError("the endpoint cannot be reached, or broke off") from None
            except (self._errors.OpenAIError, ValueError, RecursionError) as error:
                raise NoReplyError(f"the answer cannot be read ({type(error).__name__})") from None

    def _asked(self, messages: list[Message], schema: dict[str, Any]) -> bytes:
        chat: Any = self._client.chat.completions
        given = dict(self.parameters)
        form = given.pop("response_format", None)
        if form is not None:
            given["response_format"] = {"type": form}
        if form == "json_schema":
            given["response_format"]["json_schema"] = {
                "name": "reply",
                "schema": schema,
                "strict": True,
            }
        return chat.with_raw_response.create(model=self.name, messages=messages, **given).content

    def _ask_for_less(self, parameter: str, said: str) -> bool:
        """Leave out the parameter that a refusal names; whether it names one."""
        if parameter not in self.parameters and re.search(_TOO_LONG, said, re.IGNORECASE):
            return False
        for text in (parameter, said):
            for name in tuple(self.parameters):
                if re.search(rf"\b({_NAMES.get(name, name)})\b", text, re.IGNORECASE):
                    less = _FORMS.get(self.parameters.pop(name))
                    if less is not None:
                        self.parameters[name] = less
                    return True
        return False


def _within(ends: float, ask: Callable[[], bytes]) -> bytes:
    """What a call returns, if it does so by then: the client waits for ever for a server that drips.

    Args:
      ends: When, on the monotonic clock [s].
      ask: The call; it goes on in the background when its time is over.

    Raises:
      TimeoutError: It does not.
    """
    done: SimpleQueue[tuple[bytes, BaseException | None]] = SimpleQueue()

    def run() -> None:
        try:
            done.put((ask(), None))
        except BaseException as error:
            done.put((b"", error))

    Thread(target=run, daemon=True).start()
    try:
        body, error = done.get(timeout=max(0.0, ends - time.monotonic()))
    except Empty:
        raise TimeoutError from None
    if error is not None:
        raise error
    return body
