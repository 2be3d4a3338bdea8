"""What commands of the command line take: kinds of arguments with their help, how a command waits for its run, and
what is said of arguments that are none.
"""

from __future__ import annotations

import contextlib
import functools
import io
import re
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from gazeloc_core.errors import InputError

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
Between = Annotated[
    Literal["track", "interpolate"] | None,
    tyro.conf.arg(
        help="What the method sfm does with the frames between keyframes: track (registers each, as from the start) or "
        "interpolate (quicker, not measured). The project keeps it.",
        help_behavior_hint="",
    ),
]
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


def parsed(arguments: list[str], commands: Mapping[str, Any], version: str) -> Command:
    """The one of the `commands` that the arguments name.

    Raises:
        InputError: if they are none, in one line instead of tyro's box.
    """
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            command: Command = tyro.extras.subcommand_cli_from_dict(
                dict(commands),
                prog="gazeloc",
                description="Where in the room did this person look? Registers eye-tracking glasses onto a room scan. "
                f"This is version {version}; `gazeloc COMMAND --help` explains a command.",
                args=arguments,
            )
    except SystemExit as stop:
        if stop.code:
            raise InputError(_in_one_line(said.getvalue(), arguments, commands)) from None
        raise
    return command


def _in_one_line(box: str, arguments: list[str], commands: Collection[str]) -> str:
    """What a box of tyro's says up to its first rule, and where there is help."""
    rows = [re.sub(r"\x1b\[[0-9;]*m", "", row).strip("│ ") for row in box.splitlines()]
    rows = [row for row in rows if row and row[0] not in "╭╰"]
    end = next((i for i, row in enumerate(rows) if row.startswith("──")), len(rows))
    text = " ".join(rows[:end]).replace("(required)", "").replace(". Expected 1 values", "").rstrip(" .")
    if found := re.match(r"Error parsing (--[a-z-]+)", text):  # paths and texts parse always, so it is a number
        text = f"{found[1]} {_value_of(found[1], arguments)}: this is not a number that it can take"
    named = next((word for word in arguments if word in commands), None)
    return f"{text}; see `gazeloc {named} --help`." if named else f"{text}; see `gazeloc --help`."


def _value_of(flag: str, arguments: list[str]) -> str:
    for position, word in enumerate(arguments[:-1]):
        if word == flag:
            return arguments[position + 1]
    return next((word.split("=", 1)[1] for word in arguments if word.startswith(f"{flag}=")), "")
