"""An address is shown and recorded without what lets others in."""

from __future__ import annotations

import pytest

from manipose_mj.errors import InputError, ServerAbsentError
from manipose_mj.wire.address import shown, without_secrets
from manipose_mj.wire.client import Client, is_address

SECRET = "ws://me:s3cret@localhost:9/a?token=abc"


def test_an_address_is_on_record_without_secrets():
    assert without_secrets("http://me:pw@host:1/v1?api-key=s") == "http://host:1/v1"
    assert without_secrets("https://api.openai.com/v1") == "https://api.openai.com/v1"


def test_what_is_no_address_is_shown_whole():
    assert shown("package.module:Factory") == "package.module:Factory"
    assert shown(SECRET) == "ws://localhost:9/a"


def test_what_is_said_of_a_server_that_is_not_there_tells_no_secret():
    with pytest.raises(ServerAbsentError, match="^ws://localhost:9/a: no server answers") as absent:
        Client(SECRET).open()
    with pytest.raises(ServerAbsentError) as invalid:
        Client("ws://me:s3cret@:9/?token=abc#part").open()
    with pytest.raises(InputError, match="^http://localhost:9/a: servers of methods") as other:
        is_address(SECRET.replace("ws", "http"))
    for error in (absent, invalid, other):
        assert "s3cret" not in str(error.value) and "abc" not in str(error.value)
