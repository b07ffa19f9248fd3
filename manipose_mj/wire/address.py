"""Addresses of servers: what of them is nobody's business."""

from __future__ import annotations


def without_secrets(address: str) -> str:
    """An address without the user, password and query that may be in it."""
    start, marked, rest = address.partition("://")
    if not marked:
        start, rest = "", address
    host, slash, path = rest.partition("/")
    known = host.rpartition("@")[2]
    return f"{start}{marked}{known}{slash}{path}".partition("?")[0].partition("#")[0]


def shown(reference: str) -> str:
    """A method's reference as records and messages have it: the name of an object, or an address without secrets."""
    return without_secrets(reference) if "://" in reference else reference
