"""A model behind an OpenAI-compatible endpoint, by the official client; brings the extra `llm`."""

from __future__ import annotations

import os
from typing import Any
from urllib.parse import urlsplit

from manipose_mj.control.language.exchanges import Message, NoReplyError
from manipose_mj.errors import InputError

KEY_VARIABLE = "OPENAI_API_KEY"
_TIMEOUT = 60.0  # [s]
_RETRIES = 3  # after 429, 5xx and lost connections; the client waits in between
_LONGEST = 200  # characters of what an endpoint says of itself
# Of ways to ask for structured output, from the strictest on, that which an endpoint may have in the place of another.
_FORMS = {"json_schema": "json_object", "json_object": None}
_NOT_TAKEN = (400, 422)  # status of what an endpoint does not take


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
          base_url: Of the endpoint, such as `http://localhost:8000/v1`; by default OpenAI's.
          timeout: For an answer [s].
          retries: How often a question that failed for the moment is asked again.

        Raises:
          InputError: The client is not installed, the default endpoint has no key, or address or key cannot be one.
        """
        try:
            import openai
        except ImportError:
            raise InputError(
                "a language model needs the package openai: pip install 'manipose-mj[llm]'"
            ) from None
        key = os.environ.get(KEY_VARIABLE, "").strip()
        if not key and base_url is None:
            raise InputError(
                f"no key for the language model; set {KEY_VARIABLE}, or give --base-url"
            )
        if not (key.isascii() and key.isprintable()):
            raise InputError(f"{KEY_VARIABLE}: holds characters that no key has; copy the key anew")
        if base_url is not None:
            check_address(base_url)
        self.name = name
        self.parameters: dict[str, Any] = {
            "temperature": 0.0,
            "seed": 0,
            "response_format": "json_schema",
        }
        self._errors, self._key = openai, key
        # Local servers ask for no key, but the client for any.
        self._client = openai.OpenAI(
            api_key=key or "none", base_url=base_url, timeout=timeout, max_retries=retries
        )

    def answer(self, messages: list[Message], schema: dict[str, Any]) -> str:
        """The model's reply.

        Raises:
          NoReplyError: It did not answer, or declined in its own way.
        """
        while True:
            try:
                completion = self._asked(messages, schema)
            except self._errors.APITimeoutError:
                raise NoReplyError("no answer in time") from None
            except self._errors.APIStatusError as error:
                said = self._line(error.message)
                if error.status_code in _NOT_TAKEN and self._ask_for_less(error):
                    continue
                raise NoReplyError(
                    f"the endpoint answered with status {error.status_code}: {said}"
                ) from None
            except self._errors.APIConnectionError:
                raise NoReplyError("the endpoint cannot be reached, or broke off") from None
            except (self._errors.OpenAIError, ValueError, RecursionError) as error:
                raise NoReplyError(f"the answer cannot be read ({type(error).__name__})") from None
            return self._text(completion)

    def _asked(self, messages: list[Message], schema: dict[str, Any]) -> Any:
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
        return chat.create(model=self.name, messages=messages, **given)

    def _ask_for_less(self, error: Any) -> bool:
        """Leave out the parameter that a refusal names; whether it names one."""
        said = f"{getattr(error, 'param', '')} {error.message}".lower()
        for name in tuple(self.parameters):
            if name in said or (name == "response_format" and "json_schema" in said):
                less = _FORMS.get(self.parameters.pop(name))
                if less is not None:
                    self.parameters[name] = less
                return True
        return False

    def _text(self, completion: Any) -> str:
        """What an answer says, without the key.

        Raises:
          NoReplyError: Nothing, or that it declines.
        """
        choices = getattr(completion, "choices", None)
        if not isinstance(choices, list) or not choices:
            failed = getattr(completion, "error", None)
            said = failed.get("message") if isinstance(failed, dict) else None
            because = f": {self._line(said)}" if said else ""
            raise NoReplyError(f"an answer without a choice{because}")
        message = getattr(choices[0], "message", None)
        if refusal := getattr(message, "refusal", None):
            raise NoReplyError(f"the model declined: {self._line(refusal)}")
        content = getattr(message, "content", None)
        if isinstance(content, list):
            texts = [part.get("text") for part in content if isinstance(part, dict)]
            content = "".join(text for text in texts if isinstance(text, str))
        return self._without_key(content) if isinstance(content, str) else ""

    def _line(self, said: Any) -> str:
        return " ".join(self._without_key(str(said)).split())[:_LONGEST]

    def _without_key(self, text: str) -> str:
        # Half of a character that takes two cannot be written.
        whole = text.encode("utf-8", "replace").decode("utf-8")
        return whole.replace(self._key, "***") if self._key else whole


def check_address(base_url: str) -> None:
    """Nothing, if this may be an endpoint's address.

    Raises:
      InputError: It is none.
    """
    try:
        parts = urlsplit(base_url)
        valid = parts.scheme in ("http", "https") and bool(parts.hostname)
        valid = valid and (parts.port is None or parts.port > 0)
    except ValueError:
        valid = False
    if not valid:
        raise InputError(
            f"--base-url {without_secrets(base_url)!r}: expected an address such as http://localhost:8000/v1"
        )


def without_secrets(base_url: str) -> str:
    """An address without the user, password and query that may be in it."""
    start, marked, rest = base_url.partition("://")
    if not marked:
        start, rest = "", base_url
    host, slash, path = rest.partition("/")
    known = host.rpartition("@")[2]
    return f"{start}{marked}{known}{slash}{path}".partition("?")[0]
