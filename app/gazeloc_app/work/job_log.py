"""What a job reported, line by line with the time, in PROJECT/logs/: one file per job, the last ones are kept."""

from __future__ import annotations

import re
from datetime import datetime
from pathlib import Path

KEPT = 40


class JobLog:
    """The log of one job. What cannot be written is not: a job does not fail for want of its log."""

    def __init__(self, folder: Path, name: str):
        slug = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-").lower()[:40] or "job"
        self.path = folder / "logs" / f"{datetime.now():%Y%m%d-%H%M%S-%f}-{slug}.log"
        self._last = ""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            for old in sorted(self.path.parent.glob("*.log"))[: -KEPT + 1]:
                old.unlink(missing_ok=True)
        except OSError:
            pass

    def add(self, text: str, fraction: float | None = None) -> str | None:
        """Write a line where the text differs from the last one; returns it, None where it does not."""
        sentence = " ".join(text.split())[:400]
        if not sentence or sentence == self._last:
            return None
        self._last = sentence
        share = "" if fraction is None else f"{100 * fraction:3.0f} %  "
        line = f"{datetime.now():%H:%M:%S}  {share}{sentence}"
        try:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(line + "\n")
        except OSError:
            pass
        return line
