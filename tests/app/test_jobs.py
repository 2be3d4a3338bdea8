"""The worker process: progress, results and failures arrive; cancel and crashes leave an app that works on."""

import multiprocessing
import os
import queue
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import job_tasks
import pytest
from gazeloc_app.actions.action import Action
from gazeloc_app.actions.jobs import JobEnded, JobProgressed
from gazeloc_app.state import Level
from gazeloc_app.work import job_log, jobs
from gazeloc_app.work.job_log import JobLog
from gazeloc_app.work.jobs import JobRunner
from gazeloc_app.work.remaining import Remaining

START_S = 60.0
"""A worker's first start imports what its tasks import."""


class Listener:
    """What the store would be told."""

    def __init__(self) -> None:
        self.actions: queue.Queue[Action] = queue.Queue()

    def wait_for(self, kind: type[Any], fits: Callable[[Any], bool] = lambda _: True) -> Any:
        deadline = time.monotonic() + START_S
        while True:
            action = self.actions.get(timeout=max(deadline - time.monotonic(), 0.01))
            if isinstance(action, kind) and fits(action):
                return action


@pytest.fixture
def listener() -> Listener:
    return Listener()


@pytest.fixture
def runner(tmp_path: Path, listener: Listener) -> Iterator[JobRunner]:
    runner = JobRunner(tmp_path, listener.actions.put)
    yield runner
    runner.stop()


def run(runner: JobRunner, listener: Listener, task: Any, **keywords: Any) -> JobEnded:
    runner.start("The job", task, **keywords)
    ended = listener.wait_for(JobEnded)
    assert isinstance(ended, JobEnded)
    return ended


def test_progress_and_result_arrive(runner: JobRunner, listener: Listener, tmp_path: Path):
    runner.start("The job", job_tasks.succeed, alignment="abc")
    progressed = listener.wait_for(JobProgressed)
    assert (progressed.fraction, progressed.text, progressed.remaining) == (1.0, "almost", "")
    assert listener.wait_for(JobEnded) == JobEnded(Level.WARNING, f"Done in {tmp_path.name}.", "abc", True)


def test_one_worker_does_job_after_job(runner: JobRunner, listener: Listener):
    first, second = (run(runner, listener, job_tasks.say_pid) for _ in range(2))
    assert first.text == second.text != str(os.getpid())


def test_bad_input_ends_with_its_own_sentence(runner: JobRunner, listener: Listener, tmp_path: Path):
    ended = run(runner, listener, job_tasks.name_bad_input)
    assert ended == JobEnded(Level.ERROR, f"{tmp_path / 'scan.obj'}: the file is empty; export it again.")


def test_a_fault_of_ours_is_named_and_the_worker_lives_on(runner: JobRunner, listener: Listener):
    before = run(runner, listener, job_tasks.say_pid).text
    ended = run(runner, listener, job_tasks.stumble)
    assert ended.level is Level.ERROR
    assert "ZeroDivisionError: a fault of ours" in ended.text
    assert run(runner, listener, job_tasks.say_pid).text == before


def test_a_worker_that_dies_is_said_and_the_next_job_works(runner: JobRunner, listener: Listener):
    before = run(runner, listener, job_tasks.say_pid).text
    ended = run(runner, listener, job_tasks.die)
    assert ended.level is Level.ERROR
    assert "“The job” ended without an answer" in ended.text
    assert run(runner, listener, job_tasks.say_pid).text != before


def test_a_job_that_cannot_be_sent_to_the_worker_ends_and_the_next_one_works(runner: JobRunner, listener: Listener):
    ended = run(runner, listener, lambda folder, report: None)
    assert ended.level is Level.ERROR
    assert "A fault in GazeLoc stopped this" in ended.text
    assert run(runner, listener, job_tasks.say_pid).level is Level.INFO


def test_a_worker_killed_between_jobs_is_replaced(runner: JobRunner, listener: Listener):
    before = int(run(runner, listener, job_tasks.say_pid).text)
    os.kill(before, signal.SIGKILL)
    while any(child.pid == before for child in multiprocessing.active_children()):
        time.sleep(0.01)
    assert int(run(runner, listener, job_tasks.say_pid).text) != before


def test_cancel_is_answered_at_the_next_progress(runner: JobRunner, listener: Listener, tmp_path: Path):
    before = run(runner, listener, job_tasks.say_pid).text
    runner.start("The job", job_tasks.step)
    listener.wait_for(JobProgressed, lambda action: action.text == "step 0")
    asked = time.monotonic()
    runner.cancel()
    ended = listener.wait_for(JobEnded)
    assert ended.level is Level.INFO
    assert "was cancelled" in ended.text
    assert time.monotonic() - asked < jobs.PATIENCE_S
    assert run(runner, listener, job_tasks.say_pid).text == before, "nobody had to be ended"


def test_a_task_that_does_not_listen_is_ended(
    runner: JobRunner, listener: Listener, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(jobs, "PATIENCE_S", 0.3)
    runner.start("The job", job_tasks.be_deaf)
    listener.wait_for(JobProgressed)
    asked = time.monotonic()
    runner.cancel()
    ended = listener.wait_for(JobEnded)
    assert 0.3 <= time.monotonic() - asked < 10
    assert ended == JobEnded(Level.INFO, "“The job” was ended; what was there before is unchanged.")
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "deaf.pid").read_text()), 0)
    assert run(runner, listener, job_tasks.say_pid).level is Level.INFO


def test_cancel_without_a_job_says_nothing_and_spares_the_next(runner: JobRunner, listener: Listener):
    runner.cancel()
    assert listener.actions.empty()
    assert run(runner, listener, job_tasks.succeed, alignment="abc").alignment == "abc"


def test_there_is_one_job_at_a_time(runner: JobRunner, listener: Listener):
    runner.start("The job", job_tasks.step)
    with pytest.raises(RuntimeError):
        runner.start("Another", job_tasks.say_pid)
    listener.wait_for(JobProgressed)  # a worker that is still starting on a busy machine does not hear
    runner.cancel()
    assert "was cancelled" in listener.wait_for(JobEnded).text


def test_stopping_the_app_ends_the_worker(runner: JobRunner, listener: Listener):
    worker = int(run(runner, listener, job_tasks.say_pid).text)
    runner.stop()
    with pytest.raises(ProcessLookupError):
        os.kill(worker, 0)


def test_the_log_holds_what_the_job_reported_and_how_it_ended(runner: JobRunner, listener: Listener, tmp_path: Path):
    run(runner, listener, job_tasks.succeed, alignment="abc")
    run(runner, listener, job_tasks.die)
    first, second = sorted((tmp_path / "logs").glob("*.log"))
    lines = [line.split("  ", 1)[1] for line in first.read_text().splitlines()]
    assert lines == ["The job begins.", "100 %  almost", f"warning: Done in {tmp_path.name}."]
    assert "ended without an answer" in second.read_text()


def test_logs_do_not_pile_up_and_a_folder_that_cannot_be_written_harms_nothing(tmp_path: Path):
    for number in range(job_log.KEPT + 5):
        JobLog(tmp_path, f"../job {number}").add("line")
    names = [path.name for path in sorted((tmp_path / "logs").iterdir())]
    assert len(names) == job_log.KEPT
    assert names[-1].endswith(f"-job-{job_log.KEPT + 4}.log")
    (tmp_path / "file").write_text("")
    log = JobLog(tmp_path / "file", "job")
    assert "line" in (log.add("line") or "")
    assert log.add("line") is None


@pytest.mark.parametrize(
    ("steps", "words"),
    [
        ([(1, 0.5)], ""),  # too early
        ([(10, 0.05)], ""),  # too little
        ([(s, s / 100) for s in range(0, 51, 5)], "about 50 s left"),
        ([(s, s / 1000) for s in range(0, 501, 10)], "about 8 min left"),
        ([(90, 0.49), (100, 0.5), (110, 0.51), (130, 0.52)], "2 to 11 min left"),  # slower now than at first
        ([(20, 0.5), (40, 0.52), (200, 0.52)], ""),  # stands still
        ([(20, 1.0)], ""),
    ],
)
def test_the_remaining_time_is_said_as_well_as_it_is_known(steps: list[tuple[float, float]], words: str):
    remaining = Remaining(0.0)
    assert [remaining.after(second, fraction) for second, fraction in steps][-1] == words
