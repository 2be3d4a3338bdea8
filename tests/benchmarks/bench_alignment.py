"""How well alignment and ICP do, against the targets. Prints a table; exit code 1 where a target is missed.

    python tests/benchmarks/bench_alignment.py                         the box room of the tests
    python tests/benchmarks/bench_alignment.py --scene sample_scenes/studio    and a scene with files and truth

Noise is normal, per axis. Errors are means over the cameras of the reconstruction's images, against the truth.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from box_room import make_room, perturbed
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.state import AppState

from gazeloc_core.alignment.alignment import Alignment, align, judge
from gazeloc_core.alignment.correspondences import Correspondences, gather
from gazeloc_core.alignment.refine import Refinement, refine
from gazeloc_core.arrays import Floats
from gazeloc_core.evaluation.evaluate import match_times
from gazeloc_core.evaluation.truth import read_tum
from gazeloc_core.project import Project
from gazeloc_core.stages import registration
from gazeloc_core.stages.case import Case
from gazeloc_core.surfaces.raycast import Raycaster

CM = 0.01


def box_room() -> Case:
    """The room of the tests: 4000 points with 1 cm noise, a mesh with 5 mm noise."""
    room = make_room(point_noise_m=0.01, mesh_noise_m=0.005)
    return Case("box room", room.model, Raycaster(room.mesh), np.arange(len(room.model)), room.scan_from_camera)


def bench_keypoints(bench: Case, draws: int = 100) -> list[tuple[str, str, bool]]:
    """Six pairs clicked by the app's own actions, 1 cm of noise on both sides: mean over draws <= 2 cm, <= 0.35°."""
    alignments = [align(_through_the_app(bench.clicked(6, CM, seed))) for seed in range(draws)]
    position, rotation = np.mean([bench.errors(alignment.scan_from_sfm) for alignment in alignments], axis=0)
    dropped = sum(not point.is_inlier for alignment in alignments for point in alignment.evidence.keypoints)
    text = f"{position * 100:.2f} cm  {rotation:.3f}°  ({dropped} of {6 * draws} pairs dropped as wrong)"
    return [
        (
            "6 pairs clicked by the app's actions, 1 cm noise on both sides (<= 2 cm, <= 0.35°)",
            text,
            position <= 0.02 and rotation <= 0.35,
        )
    ]


def _through_the_app(noisy: Correspondences) -> Correspondences:
    """The pairs as the stage gets them after a person clicked them."""
    state = AppState(("glasses",), "glasses")
    for on_scan, in_sfm in zip(noisy.scan.tolist(), noisy.sfm.tolist(), strict=True):
        state = PickPoint(Side.SCAN, tuple(on_scan)).apply(state)
        state = PickPoint(Side.SFM, tuple(in_sfm)).apply(state)
    return gather(None, None, state.annotation.keypoints)


def bench_icp(bench: Case, draws: int = 20, evidence: Correspondences | None = None) -> list[tuple[str, str, bool]]:
    """ICP from starts off by 5 cm and 1 degree, and from an exact start, judged by 8 clicked pairs or by `evidence`."""
    centre = bench.raycaster.mesh.bounds.mean(axis=0)
    rows = []
    refinements: list[Refinement] = []
    for seed in range(draws):
        pairs = bench.clicked(8, CM, 1000 + seed) if evidence is None else evidence
        start = judge(perturbed(bench.best, 0.05, 1.0, seed, centre), pairs, model=bench.model)
        refinements.append(refine(start, bench.model, bench.raycaster, pairs))
    ends = np.array([bench.errors(r.chosen.scan_from_sfm) for r in refinements])
    accepted = sum(r.accepted for r in refinements)
    text = f"{_cm_deg(ends.max(axis=0))} worst, {_cm_deg(ends.mean(axis=0))} mean, {accepted}/{draws} accepted"
    ok = bool((ends.max(axis=0) <= (0.02, 0.3)).all()) and accepted == draws
    rows.append(("ICP from 5 cm and 1° off", text, ok))
    exact = judge(bench.best, bench.clicked(8, CM, 2000), model=bench.model)
    return [*rows, *_from_exact(bench, exact, draws if evidence is None else 1, evidence)]


def _from_exact(
    bench: Case, exact: Alignment, draws: int, evidence: Correspondences | None
) -> list[tuple[str, str, bool]]:
    rows: list[tuple[str, str, bool]] = [("exact start", _cm_deg(bench.errors(exact.scan_from_sfm)), True)]
    ends = []
    accepted = 0
    for seed in range(draws):
        pairs = bench.clicked(8, CM, 3000 + seed) if evidence is None else evidence
        refinement = refine(judge(bench.best, pairs, model=bench.model), bench.model, bench.raycaster, pairs)
        ends.append(bench.errors(refinement.chosen.scan_from_sfm))
        accepted += refinement.accepted
    for candidate in refinement.candidates:
        found = candidate.alignment
        rows.append((f"  {found.method.value} from it", _cm_deg(bench.errors(found.scan_from_sfm)), True))
    worst = np.max(ends, axis=0)
    rows.append(("ICP from the exact start", f"{_cm_deg(worst)} worst, {accepted}/{draws} accepted", worst[0] <= 0.012))
    return rows


def _cm_deg(errors: Floats | tuple[float, float]) -> str:
    return f"{errors[0] * 100:.2f} cm {errors[1]:.3f}°"


def scene(folder: Path) -> Case:
    """A scene of synthetic.py: its scan, recording, COLMAP model, and the truth of the recording's frames."""
    from gazeloc_core.frames.undistort import undistorted_camera
    from gazeloc_core.readers import open_recording, open_scan
    from gazeloc_core.sfm.colmap_io import read_model
    from gazeloc_core.sfm.colmap_join import join_to_recording

    recording = open_recording(folder / "recording")
    model = read_model(folder / "colmap")
    frames = join_to_recording(model, recording, undistorted_camera(recording.camera))
    times, poses = read_tum(folder / "truth" / "glasses.tum")
    truth = poses[match_times(recording.timestamp_ns[frames], times)]
    return Case(folder.name, model, Raycaster(open_scan(folder / "scan").mesh), np.arange(len(model)), truth)


def of_project(project: Project, recording: str) -> tuple[Case, Correspondences]:
    """A project whose stages have run: its own reconstruction, and its tags' corners as evidence."""
    return Case.of_project(project, recording), registration.correspondences(project, recording)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", type=Path, action="append", default=[])
    arguments = parser.parse_args()
    missed = 0
    for bench in (box_room(), *(scene(folder) for folder in arguments.scene)):
        print(f"\n{bench.name}: {len(bench.model)} images, {len(bench.model.points)} points")
        for what, text, ok in (*bench_keypoints(bench), *bench_icp(bench)):
            missed += not ok
            print(f"  {'ok    ' if ok else 'MISSED'}  {what:36}  {text}", flush=True)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
