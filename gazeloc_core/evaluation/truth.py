"""True poses from TUM files: `timestamp tx ty tz qx qy qz qw`, seconds and metres, `scan_from_camera`.

The format is that of the TUM RGB-D benchmark (Sturm et al., IROS 2012). RTAB-Map appends an id, which is ignored.
"""

from __future__ import annotations

from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Ints, frozen
from gazeloc_core.errors import InputError
from gazeloc_core.storage.user_files import read_text
from gazeloc_core.transforms import rigid_from_wxyz

REMEDY = "write lines of `timestamp tx ty tz qx qy qz qw`, in seconds and metres"
UNIT_LENGTH_TOLERANCE = 0.01


def read_tum(path: Path) -> tuple[Ints, RigidTransform]:
    """The times (N,) in nanoseconds and the poses (N,) `scan_from_camera` of a TUM file.

    Seconds are taken as written, digit by digit: as a float, a Unix time would lose 200 ns.

    Raises:
        InputError: with the line, if one has another number of values, something that is not a finite number, a
            quaternion that is not of unit length, or a time that is not above the last; if there is no line at all.
    """
    times: list[int] = []
    rows: list[list[float]] = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        content = line.split("#", 1)[0].replace(",", " ").split()
        if not content:
            continue
        time_ns, row = _parse_line(path, number, content)
        if times and time_ns <= times[-1]:
            raise InputError.of(path, f"line {number}: the time {content[0]} s does not rise", "sort the lines by time")
        times.append(time_ns)
        rows.append(row)
    if not rows:
        raise InputError.of(path, "the file holds no poses", REMEDY)
    values = np.array(rows)
    poses = rigid_from_wxyz(values[:, [6, 3, 4, 5]], values[:, :3], what=str(path))
    return frozen(times, np.int64), poses


def _parse_line(path: Path, number: int, content: list[str]) -> tuple[int, list[float]]:
    if len(content) not in (8, 9):
        raise InputError.of(path, f"line {number} has {len(content)} values, expected 8", REMEDY)
    try:
        seconds = Decimal(content[0])
        row = [float(text) for text in content[1:8]]
    except (InvalidOperation, ValueError) as error:
        raise InputError.of(path, f"line {number} holds something that is not a number", REMEDY) from error
    if not seconds.is_finite() or not np.isfinite(row).all():
        raise InputError.of(path, f"line {number} holds a value that is not finite", "remove the line")
    if abs(seconds) > Decimal(2**63 // 10**9):
        raise InputError.of(path, f"line {number}: the time {content[0]} s is too large", "write times in seconds")
    length = float(np.linalg.norm(row[3:]))
    if abs(length - 1) > UNIT_LENGTH_TOLERANCE:
        problem = f"line {number} has a quaternion of length {length:.4g}; a rotation needs length 1"
        raise InputError.of(path, problem, REMEDY)
    return round(seconds.scaleb(9)), row
