"""All tools of a browser, in the order of the menu and of the key P."""

from __future__ import annotations

from gazeloc_app.state import AppState
from gazeloc_app.tools.camera import CameraTool
from gazeloc_app.tools.cloud_point import CloudPointTool
from gazeloc_app.tools.frame_point import FramePointTool
from gazeloc_app.tools.scan_point import ScanPointTool
from gazeloc_app.tools.tape import TapeTool
from gazeloc_app.tools.tool import Bench, Tool

TOOLS: tuple[type[Tool], ...] = (CameraTool, ScanPointTool, CloudPointTool, FramePointTool, TapeTool)
WITHOUT_RECORDING: tuple[type[Tool], ...] = (CameraTool, TapeTool)


def kinds_for(state: AppState) -> tuple[type[Tool], ...]:
    """The tools that the project has a use for; those that set points need a recording."""
    return TOOLS if state.recordings else WITHOUT_RECORDING


def tools_of(bench: Bench) -> dict[str, Tool]:
    """One browser's tools by name; the first is in hand when the page opens."""
    return {kind.name: kind(bench) for kind in kinds_for(bench.state())}


def shifted(tool: Tool, tools: dict[str, Tool]) -> Tool:
    """What a click with the shift key uses: always a tool that sets a point, so that no mode has to be left for it."""
    if not isinstance(tool, CameraTool | TapeTool) or ScanPointTool.name not in tools:
        return tool
    return tools[ScanPointTool.name if tool.bench.looking.pictured is None else FramePointTool.name]
