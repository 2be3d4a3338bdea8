"""The command line: `gazeloc new | add | run | view | status | evaluate | score | protocol | keypoints | export |
tags | advise | demo`.

Every command calls the same functions as the app. What a user can mend is one sentence on standard error and exit
code 2; a fault of ours is a traceback and exit code 1. Results go to standard output, progress to standard error.

Parsing comes first and imports nothing heavy, so that help and a mistyped flag are answered at once; only then is the
command imported and run.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from gazeloc_app.arguments import (
    AllowedHosts,
    Between,
    Flag,
    OptionalName,
    OptionalPath,
    OptionalText,
    Project,
    TagSize,
    deferred,
    parsed,
)
from gazeloc_app.door.address import check_address
from gazeloc_core import __version__
from gazeloc_core.errors import Cancelled, GazelocError


@deferred
def new(
    project: Project,
    *,
    scan: Path,
    recording: Path,
    colmap: OptionalPath = None,
    colmap_times: OptionalPath = None,
    truth: OptionalPath = None,
    tag_family: OptionalName = None,
    tag_size: TagSize = None,
    name: OptionalName = None,
    unit: OptionalText = None,
    up: OptionalText = None,
) -> None:
    """Make a project of a room scan and a first recording. Both stay where they are and are never written to.

    Args:
        project: The project folder, new or empty.
        scan: The room scan: a 3D Scanner App folder, an ARKitScenes video, or a mesh (PLY, OBJ, GLB).
        recording: The recording: a Pupil Cloud export, or a folder of images with a camera file.
        colmap: A COLMAP model of the recording's frames, used instead of our own reconstruction.
        colmap_times: CSV `name,timestamp_ns` that says which frame each image of that model is.
        truth: Ground truth, TUM lines of scan_from_camera; read by evaluations and views, by nothing else.
        tag_family: The family of the AprilTags in the room, e.g. tag36h11.
        tag_size: Size of the tags in metres.
        name: The recording's name; by default that of its folder.
        unit: The unit of a mesh whose file does not say: m, cm, mm, ft or in.
        up: The axis that points up in a mesh whose file does not say: x, y, z, -x, -y or -z.
    """
    from gazeloc_app import commands

    commands.new(
        project,
        scan=scan,
        unit=unit,
        up_axis=up,
        tag_family=tag_family,
        tag_size_m=tag_size,
        name=name,
        recording=commands.entry(recording, colmap, colmap_times, truth),
    )


@deferred
def add(
    project: Project,
    *,
    recording: Path,
    name: OptionalName = None,
    colmap: OptionalPath = None,
    colmap_times: OptionalPath = None,
    truth: OptionalPath = None,
) -> None:
    """Add another recording in the same room.

    Args:
        project: The project folder.
        recording: The recording.
        name: Its name; by default that of its folder.
        colmap: A COLMAP model of the recording's frames.
        colmap_times: CSV `name,timestamp_ns` that says which frame each image of that model is.
        truth: Ground truth, TUM lines of scan_from_camera.
    """
    from gazeloc_app import commands

    commands.add(project, name=name, recording=commands.entry(recording, colmap, colmap_times, truth))


@deferred
def run(project: Project, *, method: str = "sfm", recording: OptionalName = None, between: Between = None) -> None:
    """Run every stage that is missing or stale, from the files to gaze in the room.

    Args:
        method: How frames are localised: sfm, sfm-paper, tags, tags-paper or global.
        recording: Only this recording; by default all.
    """
    from gazeloc_app import commands

    commands.run(project, method=method, recording=recording, between=between)


@deferred
def view(
    project: Project,
    *,
    port: int = 8080,
    host: str = "127.0.0.1",
    allow_host: AllowedHosts = (),
    export_to: OptionalPath = None,
) -> None:
    """Open the project in the browser.

    On this machine nobody is asked for a token. On any other address everybody is: the link that is printed carries it.

    Args:
        project: The project folder.
        port: The port of the app; 0 takes a free one.
        host: The address to listen on: 127.0.0.1 for this machine only, 0.0.0.0 for every network that it is in.
        allow_host: A further name of the app, that of a reverse proxy for example; may be given again.
        export_to: The folder that the app's exports are made in, by default the project's `export`.
    """
    check_address(host)
    from gazeloc_app.app import serve

    serve(project, host=host, port=port, allow_hosts=allow_host, export_folder=export_to and export_to.resolve())


@deferred
def status(project: Project, *, json: Flag = False) -> None:
    """Say which stages are fresh, stale, missing or failed.

    Args:
        project: The project folder.
        json: Print one JSON object instead of a table.
    """
    from gazeloc_app import commands

    commands.status(project, as_json=json)


@deferred
def evaluate(
    project: Project,
    *,
    truth: OptionalPath = None,
    recording: OptionalName = None,
    without_bad: Flag = False,
    json: Flag = False,
) -> None:
    """Compare the estimated poses with the ground truth. Nothing is aligned to the truth first.

    Mean, median and max are of the registered keyframes, percentiles of all, where those without a pose are infinitely
    off. Outliers are off by more than 2 m or 90 degrees. Only the ATE "after" SE3 or Sim3 is aligned to the truth.

    Args:
        project: The project folder.
        truth: TUM lines of scan_from_camera with the recording's own timestamps; by default what the project names.
        recording: Only this recording; by default all that have a truth.
        without_bad: Leave out the frames that people marked bad.
        json: Print one JSON object instead of a table.
    """
    from gazeloc_app import commands

    commands.evaluate(project, truth=truth, recording=recording, without_bad=without_bad, as_json=json)


@deferred
def score(
    project: Project,
    *,
    method: OptionalName = None,
    recording: OptionalName = None,
    worst: int = 10,
    json: Flag = False,
) -> None:
    """Say how well each frame agrees with the scan seen from its pose, and which frames do so least. Needs no truth.

    Compares every frame that has a pose, a fraction of a second each. A run that was stopped goes on where it was.

    Args:
        project: The project folder.
        method: By whose poses; by default the method chosen in the app, else sfm.
        recording: Only this recording; by default all.
        worst: How many of the worst frames to list.
        json: Print one JSON object instead of tables.
    """
    from gazeloc_app.frames import score_command

    score_command.score(project, method=method, recording=recording, worst=worst, as_json=json)


@deferred
def protocol(
    project: Project,
    *,
    scan: Path,
    every: int = 2,
    share: Annotated[float | None, tyro.conf.arg(metavar="SHARE")] = None,
    seed: int = 0,
    tag_family: OptionalName = None,
    tag_size: TagSize = None,
) -> None:
    """Make a project that measures the methods on a scan alone: frames of the phone are held out as the recording.

    Their poses are the truth; the scan in the project is without them. Then `gazeloc run` and `gazeloc evaluate`.

    Args:
        project: The project folder, new or empty.
        scan: The room scan, one with posed frames: a 3D Scanner App folder or an ARKitScenes video.
        every: Hold out the first of every so many frames that have a picture.
        share: Hold out this share of them instead, between 0 and 1, chosen at random.
        seed: Chooses the random frames.
        tag_family: The family of the AprilTags in the room, e.g. tag36h11.
        tag_size: Size of the tags in metres.
    """
    from gazeloc_app import commands

    commands.protocol(
        project, scan=scan, every=every, share=share, seed=seed, tag_family=tag_family, tag_size_m=tag_size
    )


@deferred
def export(
    project: Project, *, format: str, output: Path, recording: OptionalName = None, method: OptionalName = None
) -> None:
    """Write the aligned poses (and with csv the gaze in 3D) for other programs.

    Args:
        project: The project folder.
        format: csv, tum, colmap or nerfstudio.
        output: The folder to write to; several recordings get a folder each.
        recording: Only this recording; by default all.
        method: Whose poses; by default the method chosen in the app, else sfm.
    """
    from gazeloc_app import commands

    commands.export(project, format=format, output=output, recording=recording, method=method)


@deferred
def keypoints(
    action: Annotated[Literal["import", "export"], tyro.conf.Positional],
    project: Project,
    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")],
    *,
    recording: OptionalName = None,
    side: Literal["scan", "sfm"] = "scan",
    format: OptionalName = None,
) -> None:
    """Bring clicked keypoints from or to a file: JSON, CSV, CloudCompare's picked points, Stray's keypoints.json.

    Args:
        action: What to do: import or export.
        project: The project folder.
        file: The file to read, or to write.
        recording: Whose keypoints; needed where there are several recordings.
        side: Which side a list of one side is of (import).
        format: json, csv, cloudcompare-scan, cloudcompare-sfm, stray-scan or stray-sfm (export); else by the ending.
    """
    from gazeloc_app.keypoints import keypoint_commands

    if action == "import":
        keypoint_commands.import_keypoints(project, file, recording=recording, side=side)
    else:
        keypoint_commands.export_keypoints(project, file, recording=recording, format=format)


@deferred
def tags(
    action: Annotated[Literal["print"], tyro.conf.Positional],
    *,
    ids: str,
    size: float,
    output: Path,
    family: str = "tag36h11",
    paper: str = "a4",
) -> None:
    """Make a PDF of AprilTags to print, at true size, with cut marks and a ruler to check the printer.

    Args:
        action: What to do: print.
        ids: Ids of the tags, e.g. 0-9 or 0-4,12.
        size: Metres between the corners that the detector reports; the page says which edge that is.
        output: The PDF file.
        family: The tag family.
        paper: The paper: a5, a4, a3, a2, letter or tabloid, upright.
    """
    from gazeloc_app import commands

    actions = {"print": commands.print_tags}
    actions[action](ids, family=family, size_m=size, paper=paper, output=output)


@deferred
def advise(
    *, width: float, length: float, focal_px: float = 766.0, view_deg: float = 82.0, quick: Flag = False
) -> None:
    """Say which tag size, and how many, a room needs so that a wearer mostly sees a tag in its safe range.

    Draws, searches and solves thousands of tags first, which takes some minutes; what came of it is kept.

    Args:
        width: One side of the room in metres.
        length: The other side.
        focal_px: Focal length of the glasses' camera in pixels; the default is Pupil Invisible's.
        view_deg: Its horizontal field of view in degrees.
        quick: A coarse answer in seconds.
    """
    from gazeloc_app.advice import advise as print_advice

    print_advice(width_m=width, length_m=length, focal_px=focal_px, view_deg=view_deg, quick=quick)


@deferred
def demo(*, port: int = 8080) -> None:
    """Open the app on the sample scene that GazeLoc brings along.

    Args:
        port: The port of the app; 0 takes a free one.
    """
    from gazeloc_app.demo import open_demo

    open_demo(port=port)


COMMANDS: dict[str, Any] = {
    "new": new,
    "add": add,
    "run": run,
    "view": view,
    "status": status,
    "evaluate": evaluate,
    "score": score,
    "protocol": protocol,
    "export": export,
    "keypoints": keypoints,
    "tags": tags,
    "advise": advise,
    "demo": demo,
}


def main(arguments: list[str] | None = None) -> None:
    """Run one command and exit."""
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        if arguments == ["--version"]:
            print(f"gazeloc {__version__}")
            return
        parsed(arguments, COMMANDS, __version__)()
        sys.stdout.flush()
    except Cancelled:
        sys.exit(130)
    except GazelocError as error:
        print(f"gazeloc: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("gazeloc: stopped; what was done stays.", file=sys.stderr)
        sys.exit(130)
    except BrokenPipeError:  # `gazeloc ... | head`: nobody reads on
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
