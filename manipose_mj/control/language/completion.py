"""The body of an endpoint's answer, read without trust: whatever comes is an answer or a line that says why not."""

from __future__ import annotations

import json
from typing import Any

from manipose_mj.control.language.exchanges import Answer, NoReplyError

_LONGEST = 200  # characters of what an endpoint says of itself


def one_line(said: Any, most: int = _LONGEST) -> str:
    """Text of somebody else as one line that can be written: no control characters, no halves of characters."""
    whole = str(said)[: 20 * most].encode("utf-8", "replace").decode("utf-8")
    words = " ".join("".join(c if c.isprintable() else " " for c in whole).split())
    return words if len(words) <= most else f"{words[: most - 3]}..."


def answer_in(body: bytes) -> Answer:
    """What a chat completion says.

    Raises:
      NoReplyError: Nothing, or that the model or the endpoint declines; in its own words, however long.
    """
    document = _document(body)
    if not isinstance(document, dict):
        raise NoReplyError("the answer cannot be read: it is no JSON object")
    choices = document.get("choices")
    choice = choices[0] if isinstance(choices, list) and choices else None
    if not isinstance(choice, dict):
        _, said = complaint_in(body)
        raise NoReplyError("an answer without a choice" + (f": {said}" if said else ""))
    message = choice.get("message")
    # Completions of old have their text beside it.
    message = message if isinstance(message, dict) else {"content": choice.get("text")}
    if refusal := str(message.get("refusal") or "").strip():
        raise NoReplyError(f"the model declined: {refusal}")
    text = _text(message.get("content")).encode("utf-8", "replace").decode("utf-8")
    return Answer(text, cut=choice.get("finish_reason") == "length")


def complaint_in(body: bytes) -> tuple[str, str]:
    """The parameter that a refusal is about, if it names one, and what it says; empty where it says nothing."""
    document = _document(body)
    if not isinstance(document, dict):
        return "", "" if document is not None else body.decode("utf-8", "replace")
    failed = document.get("error") or document.get("detail") or document.get("message") or ""
    if isinstance(failed, dict):
        return str(failed.get("param") or ""), str(failed.get("message") or "")
    if isinstance(failed, list):  # of fields, as servers of FastAPI write them
        fields = [each for each in failed if isinstance(each, dict)]
        return "", "; ".join(f"{_place(each.get('loc'))}: {each.get('msg', '')}" for each in fields)
    return "", str(failed)


def _document(body: bytes) -> Any:
    try:
        return json.loads(body.decode("utf-8", "replace"))
    except (ValueError, RecursionError):
        return None


def _place(location: Any) -> str:
    parts = location if isinstance(location, list) else [location]
    return ".".join(str(part) for part in parts if part != "body")


def _text(content: Any) -> str:
    if isinstance(content, list):
        return "".join(_text(part) for part in content if isinstance(part, dict | str))
    if isinstance(content, dict):
        text = content.get("text")
        return text if isinstance(text, str) else _dumped(content)
    return content if isinstance(content, str) else ""


def _dumped(content: dict[str, Any]) -> str:
    """A plan that came as an object in place of its text; a part that is no text is nothing."""
    try:
        return json.dumps(content) if "plan" in content else ""
    except (ValueError, RecursionError):
        return ""
