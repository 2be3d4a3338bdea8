"""What commands of the command line take: kinds of arguments with their help, and how a command waits for its run."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import tyro

TAG_SIZE_HELP = """Metres between the corners that the detector reports. For tag36h11 and its kin that is the outer \
edge of the black square, for the tagStandard and tagCircle families the *inner* square, not the printed edge \
(. is data):

tag36h11            tagStandard41h12
# # # # # # # #     . . . . . . . . .
# . . . . . . #     . # # # # # # # .
# . . . . . . #     . #           # .
# . . . . . . #     . #   . . .   # .
# . . . . . . #     . #   . . .   # .
# . . . . . . #     . #   . . .   # .
# . . . . . . #     . #           # .
# # # # # # # #     . # # # # # # # .
<---- size --->     . . . . . . . . .
                       <- size -->

"""

Command = Callable[[], None]
Project = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="PROJECT", help="The project folder.")]
OptionalPath = Annotated[Path | None, tyro.conf.arg(metavar="PATH")]
OptionalText = Annotated[str | None, tyro.conf.arg(metavar="TEXT")]
OptionalName = Annotated[str | None, tyro.conf.arg(metavar="NAME")]
TagSize = Annotated[float | None, tyro.conf.arg(metavar="METRES", help=TAG_SIZE_HELP)]
AllowedHosts = Annotated[
    tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="NAME", help_behavior_hint="")
]
Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff]


def deferred(command: Callable[..., None]) -> Callable[..., Command]:
    """The command with its arguments, to be run once parsing has ended."""

    @functools.wraps(command)
    def bind(*values: Any, **named: Any) -> Command:
        return functools.partial(command, *values, **named)

    return bind
