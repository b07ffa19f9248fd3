"""Answers of policies: what is one, and what is a failure of the stage `policy`."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.failures import StageFailure
from manipose_mj.policies.client import RemotePolicy
from manipose_mj.policies.loading import load_policy, metadata_of
from manipose_mj.policies.protocol import Policy, answered_width, checked_answer

HERE = "tests.policies.own_policies"


@pytest.mark.parametrize("name", ["actions", "action"])
def test_actions_are_an_array_by_name_or_alone(name):
    actions = np.arange(16.0).reshape(2, 8)
    for answer in ({name: actions}, {name: actions.tolist()}, actions):
        decision = checked_answer(answer, 8)
        np.testing.assert_array_equal(decision.actions, actions)
        assert not decision.done


def test_a_policy_may_be_done_with_or_without_a_last_action():
    assert checked_answer({"actions": np.zeros((0, 8)), "done": True}, 8).done
    last = checked_answer({"actions": np.ones((1, 8)), "done": True}, 8)
    assert last.done and len(last.actions) == 1


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        ({}, "answered with nothing; expected 'actions'"),
        ({"acts": 1}, "answered with 'acts'"),
        ({"actions": None}, "have shape|no numbers"),
        ({"actions": "left"}, "no numbers"),
        ({"actions": np.zeros(8)}, r"shape \(8,\); expected \(t, 8\)"),
        ({"actions": np.zeros((0, 8))}, "t > 0"),
        ({"actions": np.zeros((2, 7))}, r"shape \(2, 7\)"),
        ({"actions": np.full((1, 8), np.nan)}, "no finite number"),
        ({"actions": np.full((1, 8), np.inf)}, "no finite number"),
        ([[1, 2], [3]], "no numbers"),
        (None, "shape|no numbers"),
        ([[10**400] * 8], "no numbers"),
        ({"actions": np.zeros((1, 8)), "done": np.array([True, False])}, "neither true nor false"),
        ({"actions": np.zeros((1, 8)), "done": "no"}, "neither true nor false"),
        ({"actions": np.full((1, 8), 1j)}, "no numbers"),
    ],
)
def test_other_answers_are_failures_of_the_policy(answer, said):
    with pytest.raises(StageFailure, match=said) as caught:
        checked_answer(answer, 8)
    assert caught.value.stage == "policy" and "\n" not in caught.value.reason


class OnAGpu:
    def __array__(self, dtype=None, copy=None):
        raise TypeError("can't convert a tensor on a GPU; call cpu() first")


def test_the_library_s_reason_is_told():
    with pytest.raises(StageFailure, match=r"no numbers: TypeError: can't .* call cpu\(\) first$"):
        checked_answer({"actions": OnAGpu()}, 8)


def test_the_width_of_an_answer_is_known_where_it_has_one():
    assert answered_width({"actions": np.zeros((2, 7))}) == 7
    assert answered_width(np.zeros((2, 7))) == 7
    assert answered_width({"actions": np.zeros(7)}) is None
    assert answered_width({"actions": "left"}) is None
    assert answered_width(None) is None
    assert answered_width({"actions": [[0] * 8, [0] * 7]}) is None


def test_policies_are_loaded_by_name_once():
    one = load_policy(f"{HERE}:Reaching", '{"horizon": 2}')
    assert isinstance(one, Policy) and load_policy(f"{HERE}:Reaching", '{"horizon": 2}') is one
    assert one.horizon == 2 and metadata_of(one) == {"name": "reaching"}
    assert load_policy(f"{HERE}:Reaching") is not one


@pytest.mark.parametrize(
    ("name", "arguments", "said"),
    [
        ("policy", None, "expected package.module:Factory or ws://host:port"),
        (
            "./own/policy.py:Make",
            None,
            "a file.s path; expected a module.s name, such as own.policy:Make",
        ),
        ("no.such.module:Factory", None, "cannot import no.such.module"),
        (f"{HERE}:Reachign", None, "unknown attribute .* 'Reachign'; did you mean Reaching"),
        (f"{HERE}:np.pi", None, "cannot be called"),
        (f"{HERE}:WithoutInfer", None, "WithoutInfer that it makes has no method infer"),
        (f"{HERE}:failing_factory", None, "factory failed .FileNotFoundError: no weights.pt in"),
        (f"{HERE}:Reaching", '{"horizont": 2}', "factory failed .TypeError"),
        (f"{HERE}:Reaching", "{horizon", "no JSON"),
        (f"{HERE}:Reaching", "[2]", "expected a JSON object"),
        ("ws://localhost:9", None, "no policy server answers there"),
        ("ws://", None, "no policy server answers there"),
        ("ws://localhost:9", '{"horizon": 2}', "a server takes no --policy-args"),
    ],
)
def test_what_is_no_policy_is_one_line(name, arguments, said):
    with pytest.raises(InputError, match=said) as caught:
        load_policy(name, arguments)
    assert "\n" not in str(caught.value)


def test_a_remote_policy_connects_when_it_is_first_asked():
    remote = RemotePolicy("ws://localhost:9")
    assert remote.metadata == {} and remote.dialect == "openpi"
    with pytest.raises(InputError):
        remote.open()
