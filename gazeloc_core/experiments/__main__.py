"""Run the experiments and write their findings.

    python -m gazeloc_core.experiments [NAME ...] [--output FOLDER] [--cache FOLDER] [--small] [--again]
                                       [--project PROJECT] [--arkitscenes FOLDER ...]

Scenes, projects and findings that are there and fresh are kept: it goes on where it was stopped.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from gazeloc_core import __version__
from gazeloc_core.errors import GazelocError, InputError
from gazeloc_core.experiments.finding import Provenance, inputs_of, write_finding, write_report
from gazeloc_core.experiments.registry import EXPERIMENTS
from gazeloc_core.experiments.workspace import Workspace
from gazeloc_core.progress import Report
from gazeloc_core.storage.hashing import hash_of_value


@dataclass(frozen=True)
class Arguments:
    """Which experiments run, on what, and where their findings go."""

    names: tyro.conf.Positional[tuple[str, ...]] = ()
    """Experiments by name; by default all."""
    output: Path = Path("static/experiments")
    """Where CSVs, pictures and the report go."""
    cache: Path = Path.home() / ".cache" / "gazeloc" / "experiments"
    """Where scenes and projects are kept between runs."""
    small: bool = False
    """The sample scene alone, and fewer draws: minutes, not hours."""
    again: bool = False
    """Run also what is there already."""
    project: Path | None = None
    """A project of yours instead of our scenes; what needs a truth needs one there."""
    arkitscenes: tuple[Path, ...] = ()
    """ARKitScenes folders for Table I."""


def run(arguments: Arguments) -> int:
    """Run and write them; the number of those that failed, each with its sentence."""
    unknown = [name for name in arguments.names if name not in EXPERIMENTS]
    if unknown:
        raise InputError(f"There is no experiment {unknown[0]!r}; there are: {', '.join(EXPERIMENTS)}.")
    workspace = Workspace(
        cache=arguments.cache,
        size="small" if arguments.small else "full",
        project_folder=arguments.project,
        arkitscenes=arguments.arkitscenes,
    )
    failed = 0
    for name in arguments.names or tuple(EXPERIMENTS):
        experiment = EXPERIMENTS[name]
        provenance = Provenance(
            commit=_commit(), version=__version__, size=workspace.size, inputs=_inputs(name, workspace)
        )
        if not arguments.again and inputs_of(arguments.output, name) == provenance.inputs:
            print(f"{name}: there already")
            continue
        started = time.monotonic()
        try:
            finding = experiment.run(workspace, _shown(name))
        except GazelocError as error:
            failed += 1
            print(f"\n{name}: {error}", file=sys.stderr)
            continue
        write_finding(arguments.output, name, experiment.title, finding, provenance)
        print(f"\r{name}: {time.monotonic() - started:.0f} s: {finding.text}", flush=True)
    write_report(arguments.output, tuple(EXPERIMENTS))
    return failed


def _inputs(name: str, workspace: Workspace) -> str:
    """What makes an experiment's finding another one, beside the code: the scenes and the size."""
    return hash_of_value([name, workspace.describe()])


def _commit() -> str:
    """The commit that is checked out, with a mark where files differ from it; "unknown" outside of a checkout."""
    here = Path(__file__).parent

    def git(*words: str) -> str:
        done = subprocess.run(["git", "-C", str(here), *words], capture_output=True, text=True, check=True)
        return done.stdout.strip()

    try:
        return git("rev-parse", "--short", "HEAD") + ("+" if git("status", "--porcelain", "--", "*.py") else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def _shown(name: str) -> Report:
    def report(fraction: float, text: str = "", /) -> None:
        if sys.stderr.isatty():
            sys.stderr.write(f"\r{name}: {100 * fraction:3.0f} % {text[:80]:<80}")

    return report


def main(words: Sequence[str] | None = None) -> int:
    """The command; its exit code."""
    try:
        return 1 if run(tyro.cli(Arguments, args=words, description=__doc__)) else 0
    except GazelocError as error:
        print(f"experiments: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
