"""Credentials that may come back in what an endpoint says, and their removal."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections.abc import Iterable
from urllib.parse import quote, quote_plus

_LEAST = 8  # characters of a part of a secret that is one itself; most words of plans are shorter
_LEAST_WITHIN = 4  # characters of a secret that is found within words; "x" is in most of them
# What follows the scheme of a header, and what somebody else has masked but for its ends.
_AUTHORIZATION = re.compile(r"\b(basic|bearer)(\s+)[^\s\"',;]+", re.IGNORECASE)
_MASKED = re.compile(
    r"(?<![\w-])(?:[\w-]*\*{3,}[\w*-]*|(?=[\w.-]*[\d-])[\w-]+\.{3}[\w-]+)"  # sk-a...1234; no "wait...then"
)
HIDDEN = "***"


class Credentials:
    """Secrets, as they may be written in a header, in JSON and in an address."""

    def __init__(self, secrets: Iterable[str], pairs: Iterable[tuple[str, str]] = ()) -> None:
        """Keeps them in memory only.

        Args:
          secrets: Keys, passwords, users and the like; empty ones are none.
          pairs: User and password of basic authorization.
        """
        together = [f"{user}:{password}" for user, password in pairs]
        encoded = [b64encode(pair.encode("utf-8")).decode("ascii") for pair in together]
        forms = {form for secret in (*secrets, *together, *encoded) for form in _forms(secret)}
        self._short = sorted((form for form in forms if 0 < len(form) < _LEAST), key=len)[::-1]
        self._parts = {
            form[i : i + _LEAST] for form in forms for i in range(len(form) - _LEAST + 1)
        }

    def removed_from_reply(self, text: str) -> str:
        """A reply without secrets or parts of them; short secrets stay, as words of a plan may be alike."""
        spans: list[list[int]] = []
        for start in range(len(text) - _LEAST + 1) if self._parts else ():
            if text[start : start + _LEAST] not in self._parts:
                continue
            if spans and start <= spans[-1][1]:
                spans[-1][1] = start + _LEAST
            else:
                spans.append([start, start + _LEAST])
        kept = zip(
            [0, *(end for _, end in spans)], [*(start for start, _ in spans), None], strict=True
        )
        return HIDDEN.join(text[start:end] for start, end in kept)

    def removed_from_error(self, text: str) -> str:
        """An error's text without secrets of any length, what follows `Basic` or `Bearer`, and what is masked in part."""
        text = self.removed_from_reply(text)
        for form in self._short:
            found = re.escape(form)
            if len(form) < _LEAST_WITHIN:
                found = rf"(?<!\w){found}(?!\w)"
            text = re.sub(found, HIDDEN, text)
        return _MASKED.sub(HIDDEN, _AUTHORIZATION.sub(rf"\1\2{HIDDEN}", text))


def _forms(secret: str) -> set[str]:
    """A secret as it is, and as it stands in JSON and in addresses."""
    quoted = json.dumps(secret)[1:-1]
    within = {quote(secret), quote(secret, ""), quote_plus(secret)}
    return {secret, quoted, quoted.replace("/", "\\/"), *within}
