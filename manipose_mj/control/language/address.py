"""Addresses of endpoints: which can be one, and what of them is nobody's business."""

from __future__ import annotations

from urllib.parse import parse_qsl, unquote, urlsplit

from manipose_mj.control.language.credentials import Credentials
from manipose_mj.errors import InputError
from manipose_mj.wire.address import without_secrets

URL_VARIABLE = "OPENAI_BASE_URL"
_EXAMPLE = "http://localhost:8000/v1"


def check_address(address: str, option: str = "--base-url") -> None:
    """Nothing, if this may be an endpoint's address.

    Args:
      address: As it was given.
      option: By which.

    Raises:
      InputError: It is none.
    """
    try:
        parts = urlsplit(address)
        valid = parts.scheme in ("http", "https") and bool(parts.hostname)
        valid = valid and (parts.port is None or parts.port > 0)
    except ValueError:
        valid = False
    if not valid or not address.isprintable() or " " in address:
        raise no_address(address, option)


def no_address(address: str, option: str = "--base-url") -> InputError:
    """The error for what is no address, without the secrets in it."""
    return InputError(
        f"{option} {without_secrets(address)[:200]!r}: expected an address such as {_EXAMPLE}"
    )


def without_query(address: str) -> tuple[str, dict[str, str]]:
    """An address up to its query, and the query, which belongs behind what is asked for there."""
    start, _, query = address.partition("#")[0].partition("?")
    return start, dict(parse_qsl(query, keep_blank_values=True))


def credentials_in(address: str, key: str = "") -> Credentials:
    """What `without_secrets` leaves out, and a key: user, password and the query's values, as written and as sent."""
    parts = urlsplit(address)
    values = [each.partition("=")[2] for each in parts.query.split("&")]
    secrets = [key, *values, *without_query(address)[1].values()]
    pairs = []
    if parts.username is not None:
        written = (parts.username, parts.password or "")
        user, password = (unquote(each) for each in written)
        secrets += [*written, user, password]
        pairs.append((user, password))
    return Credentials(secrets, pairs)
