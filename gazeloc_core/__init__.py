"""GazeLoc's algorithms and files: registers eye-tracking frames onto a room scan. Knows no viewer.

A project is a folder that names a scan and its recordings, and keeps what is made of them:

    from pathlib import Path

    from gazeloc_core import pipeline
    from gazeloc_core.project import Project, RecordingEntry, ScanEntry, Settings, TagEntry

    project = Project.create(
        Path("study"),
        Settings(
            scan=ScanEntry(path=Path("room.obj"), unit="m", up_axis="y"),
            tags=TagEntry(family="tag36h11", size_m=0.16),
            recordings={"walk": RecordingEntry(path=Path("walk"))},
        ),
    )

Every stage that is missing or stale is run, as by `gazeloc run`; then the results are there as arrays:

    project = Project.open(Path("study"))
    with project.lock():
        pipeline.run(project)

    trajectory = pipeline.trajectory(project, "walk")
    trajectory.centers          # (N, 3) where each frame's camera was: metres, the scan's axes; NaN without a pose
    trajectory.status           # (N,) how each frame came by its pose, or that it has none
    trajectory.pose(0)          # a frame's `scan_from_camera` as SciPy's RigidTransform, or None

    gaze = pipeline.gaze(project, "walk")
    gaze.hit[gaze.is_hit]       # (K, 3) where the wearer looked

`pipeline` also evaluates, scores and exports. What is wrong with a file or a value is a `GazelocError` (`errors`) whose
text is a sentence. The algorithms need no project: `readers` opens scans and recordings, `localize`, `alignment` and
`gaze` take and give the value types of `camera`, `scan`, `recording`, `keypoints`, `sfm_model` and `trajectory`.
"""

# OpenCV before pycolmap, always: pycolmap's own libpng, loaded first, makes cv2 free foreign memory when it writes a
# PNG (seen with pycolmap 4.2.1 and OpenCV 5: "free(): invalid pointer").
import cv2 as _cv2  # noqa: F401

__version__ = "0.1.0"
