"""What waits for quick changes to come to rest."""

import threading
import time

from gazeloc_app.frames.settling import Settling


def test_of_quick_changes_the_last_one_is_done_once_they_rest():
    done, at_rest = [], threading.Event()
    settling = Settling(rest_s=0.2, most_s=60)
    for number in range(5):
        settling.soon(lambda number=number: (done.append(number), at_rest.set()))
        time.sleep(0.01)
    assert done == []
    assert at_rest.wait(10)
    assert done == [4]


def test_changes_that_never_rest_are_done_now_and_then():
    done, enough = [], threading.Event()
    settling = Settling(rest_s=60, most_s=0.05)
    end = time.monotonic() + 10
    while not enough.is_set() and time.monotonic() < end:
        settling.soon(lambda: (done.append(1), len(done) == 2 and enough.set()))
        time.sleep(0.01)
    assert enough.is_set()


def test_what_is_done_at_once_takes_the_place_of_what_waits():
    done = []
    settling = Settling(rest_s=0.05)
    settling.soon(lambda: done.append("waits"))
    settling.now(lambda: done.append("now"))
    settling.soon(lambda: done.append("dropped"))
    settling.drop()
    time.sleep(0.2)
    assert done == ["now"]
