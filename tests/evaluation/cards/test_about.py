"""What the makers of a method say of it is one line each."""

from __future__ import annotations

import pytest

from manipose_mj.cli.main import main
from manipose_mj.errors import InputError
from manipose_mj.evaluation.cards.card import About


@pytest.mark.parametrize("said", ["bad\udcff", "ours\n", "a\nb", "a\x1b[1mb", "a\x85b", " "])
@pytest.mark.parametrize("option", ["--name", "--training-data"])
def test_what_is_not_one_line_of_text_is_refused(option, said, tmp_path, capsys):
    told = {"--name": "ours", "--code-url": "https://a.org", "--training-data": "none"}
    words = [word for pair in {**told, option: said}.items() for word in pair]
    assert main(["card", str(tmp_path), *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    field = option.removeprefix("--").replace("-", "_")
    assert line == f"manipose: {field} is {said!r}; expected one line of text"


@pytest.mark.parametrize(
    "url", ["https://", "https://a.org/my code", "https://a><b>", "https://a)[b](c"]
)
def test_an_address_of_code_has_no_blanks(url):
    with pytest.raises(InputError, match="without blanks"):
        About("ours", url, "none")
