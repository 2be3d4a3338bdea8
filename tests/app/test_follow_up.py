"""A run that ended well is followed by scoring; one that failed or was cancelled is not."""

import pytest
from gazeloc_app.actions.jobs import CancelJob, JobEnded, StartJob
from gazeloc_app.state import AppState, Level
from gazeloc_app.work import tasks
from gazeloc_app.work.follow_up import ScoreAfterRun

RUN = StartJob("Run everything", tasks.run_all, (("recording", "walk"),))
ALIGN = StartJob("Align", tasks.align, (("recording", "walk"),))


@pytest.mark.parametrize(
    ("actions", "is_followed"),
    [
        ((RUN, JobEnded(Level.INFO, "done")), True),
        ((RUN, JobEnded(Level.ERROR, "no")), False),
        ((RUN, CancelJob(1), JobEnded(Level.INFO, "was cancelled")), False),
        ((ALIGN, JobEnded(Level.INFO, "done")), False),
        ((RUN,), False),
    ],
)
def test_only_a_run_that_ended_well_is_followed(actions, is_followed):
    asked, state = [], AppState(("walk",), "walk")
    effect = ScoreAfterRun(asked.append)
    for action in actions:
        before, state = state, action.apply(state)
        effect(before, state)
    effect(state, state)
    expected = [StartJob("Score the frames", tasks.score_frames, (("recording", "walk"),))] if is_followed else []
    assert asked == expected
