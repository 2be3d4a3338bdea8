"""The door: every hostile visitor of the tests, run now, a row for each kind; and what a flood costs an honest page."""

from __future__ import annotations

import asyncio
import statistics
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from collections import defaultdict
from pathlib import Path

import msgspec

Row = tuple[str, str, bool]
APP_TESTS = Path(__file__).resolve().parents[1] / "app"
ROUNDS = 60


def bench_door(work: Path) -> list[Row]:
    """A row per kind of attack: how many of its variants were refused, everybody else unaffected."""
    return [*_attacks(work), *_flood()]


def _attacks(work: Path) -> list[Row]:
    report = work / "door.xml"
    files = [str(path) for path in sorted(APP_TESTS.glob("test_door_*.py"))]
    command = [sys.executable, "-m", "pytest", "-q", f"--junitxml={report}", *files]
    subprocess.run(command, check=False, stdout=subprocess.DEVNULL, cwd=APP_TESTS.parents[1])
    refused: dict[str, list[bool]] = defaultdict(list)
    for case in ElementTree.parse(report).iter("testcase"):
        if case.find("skipped") is None:
            held = case.find("failure") is None and case.find("error") is None
            refused[case.attrib["name"].partition("[")[0]].append(held)
    return [
        (f"door: {name.removeprefix('test_').replace('_', ' ')[:78]}", f"{sum(held)} of {len(held)}", all(held))
        for name, held in refused.items()
    ]


def _flood() -> list[Row]:
    """Round trips of an honest page's slider to another page, alone and while a third sends as fast as it can."""
    from gazeloc_app.routes import Routes
    from gazeloc_app.server import make_server
    from visitor import CAMERA, page

    server = make_server(0, Routes())
    slider = server.gui.add_slider("slider", 0, 10**6, 1, 0)

    async def measure() -> tuple[float, float]:
        async with page(server.get_port()) as honest, page(server.get_port()) as hostile:
            await honest.send(CAMERA)
            alone = await _median_ms(honest, slider)
            flood = asyncio.create_task(_send_all(hostile, slider))
            beside = await _median_ms(honest, slider)
            flood.cancel()
            return alone, beside

    try:
        alone, beside = asyncio.run(measure())
    finally:
        server.stop()
    row = f"{beside:.1f} ms, alone {alone:.1f} ms"
    return [
        ("door: slider to server beside a flood of another page (median; <= 20 ms more)", row, beside <= alone + 20)
    ]


async def _median_ms(honest, slider) -> float:  # type: ignore[no-untyped-def]
    times = []
    for _ in range(ROUNDS):
        value = slider.value + 1
        begun = time.perf_counter()
        await honest.send({"type": "GuiUpdateMessage", "uuid": slider._impl.uuid, "updates": {"value": value}})
        while slider.value != value:
            await asyncio.sleep(0.0005)
        times.append(1000 * (time.perf_counter() - begun))
    return statistics.median(times)


async def _send_all(hostile, slider) -> None:  # type: ignore[no-untyped-def]
    message = {"type": "GuiUpdateMessage", "uuid": slider._impl.uuid, "updates": {"value": -1}}
    raw = msgspec.msgpack.encode(message)
    while True:
        await hostile.connection.send(raw)
