"""What the command line's commands do: check what the user named, call the pipeline, print."""

from __future__ import annotations

import json
import math
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from gazeloc_app.terminal import progress_bar, table
from gazeloc_core import pipeline
from gazeloc_core.errors import InputError, ProjectError
from gazeloc_core.evaluation.evaluate import StatusErrors
from gazeloc_core.evaluation.protocol import ProtocolOptions, make_protocol_project
from gazeloc_core.evaluation.trajectory_errors import RelativeError
from gazeloc_core.evaluation.truth import read_tum
from gazeloc_core.methods import method_named
from gazeloc_core.project import Project, RecordingEntry, ScanEntry, Settings, TagEntry
from gazeloc_core.readers import open_recording, open_scan
from gazeloc_core.stages.recording import own_frames_of_model
from gazeloc_core.stages.scan import check_tags_can_be_mapped
from gazeloc_core.tags.detection import FAMILIES
from gazeloc_core.tags.sheet import SheetOptions, parse_ids, size_note, write_sheet


def entry(path: Path, colmap: Path | None, colmap_times: Path | None, truth: Path | None) -> RecordingEntry:
    """A recording's entry, its paths made absolute."""
    return RecordingEntry(
        path=path.resolve(),
        colmap=colmap and colmap.resolve(),
        colmap_times=colmap_times and colmap_times.resolve(),
        truth=truth and truth.resolve(),
    )


def new(
    folder: Path,
    *,
    scan: Path,
    unit: str | None,
    up_axis: str | None,
    tag_family: str | None,
    tag_size_m: float | None,
    name: str | None,
    recording: RecordingEntry,
) -> Project:
    """Open everything once, so that what is wrong is said now, and make the project."""
    tags = _checked_tags(tag_family, tag_size_m)
    opened = open_scan(scan, unit=unit, up_axis=up_axis, colored=False)
    if tags is not None:
        check_tags_can_be_mapped(opened)
    notes = [*opened.notes, *_checked_recording(recording)]
    name = name or _name_of(recording.path)
    settings = Settings(
        scan=ScanEntry(path=scan.resolve(), unit=unit, up_axis=up_axis), tags=tags, recordings={name: recording}
    )
    project = Project.create(folder, settings)
    print("\n".join(notes))
    print(f"{folder}: a project with the recording {name!r}. Next: gazeloc run {_in_shell(folder)}")
    return project


def add(folder: Path, *, name: str | None, recording: RecordingEntry) -> None:
    """Open the recording once and add it to the project."""
    project = Project.open(folder)
    with project.lock():
        notes = _checked_recording(recording)
        name = name or _name_of(recording.path)
        project.add_recording(name, recording)
    print("\n".join(notes))
    print(f"{folder}: the recording {name!r} was added. Next: gazeloc run {_in_shell(folder)}")


def run(folder: Path, *, method: str, recording: str | None, between: str | None = None) -> None:
    """Run the stages with a progress bar, and say how long each took and what the alignment is worth."""
    project, how = Project.open(folder), method_named(method)
    with project.lock(), progress_bar() as report:
        if between is not None:
            project.choose_tracking(between == "track")
        times = pipeline.run(project, method=how, recording=recording, report=report)
    total = sum(time.seconds for time in times) or 1.0
    rows = [
        [time.recording or "scan", time.title, f"{time.seconds:.1f} s", f"{100 * time.seconds / total:.0f} %"]
        for time in times
        if time.ran
    ]
    print(table(["of", "stage", "time", "share"], rows))
    for name in [recording] if recording else project.settings.recordings:
        for level, text in pipeline.verdicts(project, name, how):
            print(f"{name}: {level}: {text}")


def status(folder: Path, *, as_json: bool) -> None:
    """Print how every stage stands."""
    project = Project.open(folder)
    found = pipeline.statuses(project)
    if as_json:
        print(json.dumps({"project": str(project.folder), "stages": [asdict(item) for item in found]}, indent=1))
        return
    rows = [[s.recording or "scan", s.method or "", s.title, s.state, s.reason] for s in found]
    print(table(["of", "method", "stage", "state", ""], rows))


def evaluate(folder: Path, *, truth: Path | None, recording: str | None, without_bad: bool, as_json: bool) -> None:
    """Print the errors against the truth, in centimetres and degrees or as JSON in metres and degrees."""
    project = Project.open(folder)
    found = pipeline.evaluate_project(project, truth=truth, recording=recording, without_bad=without_bad)
    if as_json:
        value = {name: {method: e.to_json() for method, e in methods.items()} for name, methods in found.items()}
        print(json.dumps(value, indent=1, allow_nan=False))
        return
    each = [(name, method, e) for name, methods in found.items() for method, e in methods.items()]
    head = ["recording", "method", "frames", "keyframes", "registered"]
    head += [f"{what} {unit}" for unit in ("cm", "°") for what in ("mean", "median", "p95", "max")]
    rows = [
        [
            *(name, method, str(e.frames), str(e.keyframes), str(e.registered)),
            *_cells(e.position_m, ("mean", "median", "p95", "max"), 100),
            *_cells(e.rotation_deg, ("mean", "median", "p95", "max")),
        ]
        for name, method, e in each
    ]
    print(table(head, rows))
    head = ["recording", "method", "outliers", "ATE cm", "after SE3", "after Sim3"]
    head += [f"RPE{what} {unit}" for what in ("", "/s") for unit in ("cm", "°")]
    rows = [
        [
            *(name, method, f"{e.outliers.count} of {e.outliers.frames}"),
            *_cells(e.ate_m, ("unaligned", "se3_aligned", "sim3_aligned"), 100, "–"),
            *_relative_cells(e.rpe_in_order),
            *_relative_cells(e.rpe_per_second),
        ]
        for name, method, e in each
    ]
    print(f"\n{table(head, rows)}")
    print(f"\n{_table_by_kind([(name, method, e.by_status) for name, method, e in each])}")
    if any(e.by_mark for *_, e in each):
        print(f"\n{_table_by_kind([(name, method, e.by_mark) for name, method, e in each])}")
    for name, method, e in each:
        if e.left_out:
            print(f"{name}, {method}: left out are {e.left_out} marked bad, but for the table of marks.")


def _table_by_kind(each: Sequence[tuple[str, str, Mapping[Any, StatusErrors]]]) -> str:
    """All frames, keyframes or not, by how they came by their pose or by their mark."""
    head = ["recording", "method", "all frames", "with truth"]
    head += [f"{what} {unit}" for unit in ("cm", "°") for what in ("mean", "p95", "max")]
    rows = [
        [
            *(name, method, kind.value.replace("_", " "), str(errors.frames)),
            *_cells(errors.position_m, ("mean", "p95", "max"), 100),
            *_cells(errors.rotation_deg, ("mean", "p95", "max")),
        ]
        for name, method, by_kind in each
        for kind, errors in by_kind.items()
    ]
    return table(head, rows)


def protocol(
    folder: Path,
    *,
    scan: Path,
    every: int,
    share: float | None,
    seed: int,
    tag_family: str | None,
    tag_size_m: float | None,
) -> Project:
    """Hold frames out of a scan and make the project that registers them, and say which they are."""
    tags = _checked_tags(tag_family, tag_size_m)
    options = ProtocolOptions(every=every, share=share, seed=seed)
    with progress_bar() as report:
        project = make_protocol_project(folder, scan, tags=tags, options=options, report=report)
    name, recording = next(iter(project.settings.recordings.items()))
    print("\n".join(open_recording(recording.path).notes))
    print(f"{folder}: a project with the recording {name!r}, frames held out of {scan}; its truth is their own poses.")
    print(f"Next: gazeloc run {_in_shell(folder)}; gazeloc evaluate {_in_shell(folder)}")
    return project


def export(folder: Path, *, format: str, output: Path, recording: str | None, method: str | None) -> list[Path]:
    """Write the poses and say which files there are now."""
    project, how = Project.open(folder), None if method is None else method_named(method)
    with progress_bar() as report:
        files = pipeline.export(project, format=format, output=output, recording=recording, method=how, report=report)
    for path in files:
        print(path)
    print("Exported frames show people: treat them as your recordings.")
    return files


def _cells(errors: object, names: Sequence[str], factor: float = 1.0, infinite: str = "inf") -> Sequence[str]:
    values = (getattr(errors, name) for name in names)
    return [f"{value * factor:.2f}" if math.isfinite(value) else infinite for value in values]


def _relative_cells(errors: RelativeError) -> Sequence[str]:
    return [*_cells(errors, ("position_rmse_m",), 100, "–"), *_cells(errors, ("rotation_rmse_deg",), 1, "–")]


def print_tags(ids: str, *, family: str, size_m: float, paper: str, output: Path) -> None:
    """Write the sheet and say what on it is as long as the tag size."""
    options = SheetOptions(ids=parse_ids(ids), size_m=size_m, family=family, paper=paper)
    pages = write_sheet(options, output)
    print(f"{output}: {len(options.ids)} tags on {pages} pages of {paper}. {size_note(family, size_m)}")
    print("Print at 100 % (actual size) and check the ruler on the page.")


def _checked_tags(family: str | None, size_m: float | None) -> TagEntry | None:
    if family is None:
        if size_m is not None:
            raise InputError(f"--tag-size {size_m:g} needs --tag-family too, e.g. --tag-family tag36h11.")
        return None
    if family not in FAMILIES:
        raise InputError(f"--tag-family {family}: no such family; choose one of {', '.join(FAMILIES)}.")
    if size_m is not None and not 0.005 <= size_m <= 5:
        raise InputError(f"--tag-size {size_m:g}: a tag is between 0.005 and 5 metres; give its size in metres.")
    return TagEntry(family=family, size_m=size_m)


def _checked_recording(recording: RecordingEntry) -> list[str]:
    if recording.truth is not None:
        read_tum(recording.truth)
    if recording.colmap is None and recording.colmap_times is not None:
        raise InputError(f"{recording.colmap_times}: --colmap-times needs --colmap too.")
    opened = open_recording(recording.path)
    if recording.colmap is not None:
        own_frames_of_model(opened, recording.colmap, recording.colmap_times)
    return list(opened.notes)


def _in_shell(folder: Path) -> str:
    """The folder as it is typed into a shell: names have spaces and quotes."""
    return shlex.quote(str(folder))


def _name_of(path: Path) -> str:
    name = re.sub(r"[^A-Za-z0-9._-]+", "-", path.resolve().name).strip("-._")[:60]
    if not name:
        raise ProjectError(f"{path}: no name for the recording can be made of this; give one with --name.")
    return name
