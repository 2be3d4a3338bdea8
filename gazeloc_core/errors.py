"""The exceptions of GazeLoc.

Every expected failure is one of these; its text is one sentence with the file, the value and what to do. The command
line prints it and exits with 2, the app shows it and lives on. Anything else that is raised is a bug of ours.

    GazelocError
    ├── InputError        a file or value of the user's that cannot be used
    ├── GeometryError     keypoints, poses or points that do not determine what was asked
    ├── ReconstructionError  structure from motion found no usable model
    ├── RenderError       no way to draw on this machine
    ├── ProjectError      a project folder that is damaged, of another version, or lacks an earlier stage
    │   └── ProjectLockedError  another process is writing to it
    └── Cancelled         the user asked to stop; nothing is wrong
"""

from __future__ import annotations

from pathlib import Path


class GazelocError(Exception):
    """Base of all expected failures; `str(error)` is the sentence for the user."""


class InputError(GazelocError):
    """A file or value of the user's cannot be used; names it and says what to do."""

    @classmethod
    def of(cls, path: Path | str, problem: str, remedy: str) -> InputError:
        """The error about one file: `<path>: <problem>; <remedy>.`"""
        return cls(f"{path}: {problem}; {remedy}.")


class GeometryError(GazelocError):
    """Keypoints, poses or points do not determine what was asked of them."""


class ReconstructionError(GazelocError):
    """Structure from motion found no usable model."""


class RenderError(GazelocError):
    """This machine offers no way to draw the scan."""


class ProjectError(GazelocError):
    """A project folder is damaged, of another version, or lacks an earlier stage."""


class ProjectLockedError(ProjectError):
    """Another process is writing to the project."""


class Cancelled(GazelocError):
    """The user asked a running stage to stop."""
