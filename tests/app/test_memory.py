"""What was read once is remembered, by all threads, and nobody waits for what somebody else reads."""

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
from gazeloc_app.memory import Memory

PATIENCE_S = 10


def test_a_value_is_made_again_only_where_its_content_changed():
    memory, made = Memory(), []
    for content in ("old", "old", "new", "new", "old"):
        memory.of("poses", content, lambda content=content: made.append(content))
    assert made == ["old", "new", "old"]


def test_a_value_that_takes_long_holds_no_other_up():
    memory, is_making, may_end = Memory(), threading.Event(), threading.Event()

    def make_slowly() -> str:
        is_making.set()
        assert may_end.wait(PATIENCE_S)
        return "slow"

    with ThreadPoolExecutor(2) as pool:
        slow = pool.submit(memory.of, "scan", None, make_slowly)
        assert is_making.wait(PATIENCE_S)
        quick = pool.submit(memory.of, "poses", None, lambda: "quick")
        assert quick.result(PATIENCE_S) == "quick"
        assert not slow.done()
        may_end.set()
        assert slow.result(PATIENCE_S) == "slow"


def test_two_who_ask_for_the_same_get_the_same_made_once():
    memory, together, made = Memory(), threading.Barrier(4), []

    def ask(_: int) -> object:
        together.wait(PATIENCE_S)
        return memory.of("scan", None, lambda: made.append(1) or object())

    with ThreadPoolExecutor(4) as pool:
        assert len({id(one) for one in pool.map(ask, range(4))}) == 1
    assert len(made) == 1


def test_a_value_may_be_made_of_others():
    memory = Memory()
    assert memory.of("mesh", None, lambda: memory.of("scan", None, lambda: 2) + 1) == 3


def test_what_could_not_be_made_is_tried_again():
    memory = Memory()
    with pytest.raises(ZeroDivisionError):
        memory.of("poses", None, lambda: 1 // 0)
    assert memory.of("poses", None, lambda: 1) == 1
