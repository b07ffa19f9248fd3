"""A model behind an OpenAI-compatible endpoint, by the official client; brings the extra `llm`."""

from __future__ import annotations

import os
from typing import Any

from manipose_mj.control.language.exchanges import Message, NoReplyError
from manipose_mj.errors import InputError

KEY_VARIABLE = "OPENAI_API_KEY"
_TIMEOUT = 60.0  # [s]
_RETRIES = 3  # after 429, 5xx and lost connections; the client waits in between


class EndpointModel:
    """Asks a chat endpoint, with temperature 0 and structured output."""

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
          InputError: The client is not installed, or the default endpoint has no key.
        """
        try:
            import openai
        except ImportError:
            raise InputError(
                "a language model needs the package openai: pip install 'manipose-mj[llm]'"
            ) from None
        key = os.environ.get(KEY_VARIABLE)
        if key is None and base_url is None:
            raise InputError(
                f"no key for the language model; set {KEY_VARIABLE}, or give --base-url"
            )
        self.name = name
        self.parameters: dict[str, Any] = {"temperature": 0.0, "seed": 0}
        self._errors = openai
        # Local servers ask for no key, but the client for any.
        self._client = openai.OpenAI(
            api_key=key or "none", base_url=base_url, timeout=timeout, max_retries=retries
        )

    def answer(self, messages: list[Message], schema: dict[str, Any]) -> str:
        """The model's reply.

        Raises:
          NoReplyError: It did not answer, or declined in its own way.
        """
        chat: Any = self._client.chat.completions
        form = {"name": "reply", "schema": schema, "strict": True}
        try:
            completion = chat.create(
                model=self.name,
                messages=messages,
                response_format={"type": "json_schema", "json_schema": form},
                **self.parameters,
            )
        except self._errors.APITimeoutError:
            raise NoReplyError("no answer in time") from None
        except self._errors.APIStatusError as error:
            raise NoReplyError(f"the endpoint answered with status {error.status_code}") from None
        except self._errors.APIConnectionError:
            raise NoReplyError("the endpoint cannot be reached, or broke off") from None
        except self._errors.OpenAIError as error:
            raise NoReplyError(f"the answer cannot be read ({type(error).__name__})") from None
        choices = getattr(completion, "choices", None)
        if not choices:
            raise NoReplyError("an answer without a choice")
        message = choices[0].message
        if getattr(message, "refusal", None):
            raise NoReplyError(
                "the model declined: " + " ".join(str(message.refusal).split())[:200]
            )
        return message.content or ""
