"""The journal and the files: what was written is there after any crash, and half of anything never is."""

import errno
import os
import random
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from data import CHECKOUT

from gazeloc_core.errors import InputError
from gazeloc_core.storage.files import folder_replaced_atomically, settle_folders, write_text_atomically
from gazeloc_core.storage.journal import Journal


def test_lines_are_read_again_by_the_next_one(tmp_path):
    journal = Journal(tmp_path / "new" / "a.jsonl")
    journal.append([{"a": 1}, "two"])
    journal.append([3.5], flush=False)
    again = Journal(journal.path)
    assert again.read() == [{"a": 1}, "two", 3.5]
    again.rewrite(["only"])
    again.append(["more"])
    assert Journal(journal.path).read() == ["only", "more"]


@pytest.mark.parametrize("kept", range(1, 9))
def test_a_line_that_was_torn_is_cut_off_and_the_next_one_stands_alone(tmp_path, kept):
    journal = Journal(tmp_path / "a.jsonl")
    journal.append([1])
    journal.append([{"torn": 2}])
    data = journal.path.read_bytes()
    journal.path.write_bytes(data[: 2 + kept])
    after = Journal(journal.path)
    assert after.read() == [1]
    after.append([3])
    assert Journal(journal.path).read() == [1, 3]


def test_a_garbled_line_is_said_and_nothing_of_it_is_taken(tmp_path):
    path = tmp_path / "a.jsonl"
    path.write_text("1\nnot json\n3\n")
    with pytest.raises(InputError, match=r"a\.jsonl.*JSON"):
        Journal(path)


def test_a_full_disk_leaves_the_lines_before_and_the_next_append_works(tmp_path, monkeypatch):
    journal = Journal(tmp_path / "a.jsonl")
    journal.append([1])
    write = os.write

    def half(file, data):
        write(file, bytes(data[: len(data) // 2]))
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "write", half)
        with pytest.raises(OSError, match="No space"):
            journal.append([{"lost": True}])
    assert Journal(journal.path).read() == [1]
    journal.append([2])
    assert Journal(journal.path).read() == [1, 2]


_WRITE_FOR_EVER = """
import itertools, sys
from pathlib import Path
from gazeloc_core.storage.journal import Journal
journal = Journal(Path(sys.argv[1]))
for i in itertools.count(len(journal.read())):
    journal.append([{"i": i, "long": "x" * 3000}])
    print(i, flush=True)
"""


def test_what_was_acknowledged_survives_kill_9(tmp_path):
    path, rng = tmp_path / "a.jsonl", random.Random(0)
    for _ in range(4):
        command = [sys.executable, "-c", _WRITE_FOR_EVER, str(path)]
        environment = os.environ | {"PYTHONPATH": str(CHECKOUT)}
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
        assert process.stdout is not None
        for _ in range(rng.randint(1, 30)):
            acknowledged = int(process.stdout.readline())
        process.send_signal(signal.SIGKILL)
        seen = [acknowledged, *(int(line) for line in process.stdout.read().splitlines())]
        process.wait()
        kept = [line["i"] for line in Journal(path).read()]
        assert kept == list(range(len(kept)))
        assert len(kept) > seen[-1]


def test_a_file_is_flushed_before_its_name_and_the_name_before_it_is_said(tmp_path, monkeypatch):
    done: list[str] = []
    fsync, replace = os.fsync, Path.replace
    monkeypatch.setattr(os, "fsync", lambda file: (done.append("fsync"), fsync(file))[1])
    monkeypatch.setattr(Path, "replace", lambda self, target: (done.append("rename"), replace(self, target))[1])
    write_text_atomically(tmp_path / "a.txt", "text")
    assert done == ["fsync", "rename", "fsync"]


def test_threads_that_write_one_file_at_the_same_time_each_write_it_whole(tmp_path):
    path = tmp_path / "a.txt"
    texts = [letter * 200_000 for letter in "abcd"]
    with ThreadPoolExecutor(4) as pool:
        for _ in range(5):
            list(pool.map(lambda text: write_text_atomically(path, text), texts))
            assert path.read_text() in texts
    assert [left.name for left in tmp_path.iterdir()] == ["a.txt"]


def test_a_file_that_cannot_be_written_leaves_the_old_one_and_nothing_beside_it(tmp_path, monkeypatch):
    write_text_atomically(tmp_path / "a.txt", "old")

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_text_atomically(tmp_path / "a.txt", "new")
    assert [(left.name, left.read_text()) for left in tmp_path.iterdir()] == [("a.txt", "old")]


def test_a_folder_whose_replacement_was_killed_between_its_two_renames_comes_back(tmp_path):
    folder = tmp_path / "model"
    with folder_replaced_atomically(folder) as part:
        (part / "a").write_text("old")
    folder.rename(tmp_path / ".model.4711.old")
    (tmp_path / ".model.4711.part").mkdir()
    (tmp_path / ".project.json.4711.part").write_text("{")
    settle_folders(tmp_path)
    assert (folder / "a").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["model"]


def test_leftovers_do_not_replace_what_is_in_place(tmp_path):
    folder = tmp_path / "model"
    folder.mkdir()
    (tmp_path / ".model.4711.old").mkdir()
    settle_folders(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["model"]
