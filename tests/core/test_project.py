"""The project folder: settings that survive a move, one writer, artifacts that know when they are stale."""

import json
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from gazeloc_core.errors import GazelocError, InputError, ProjectError, ProjectLockedError
from gazeloc_core.keypoints import KeypointPair, KeypointSet, Sighting
from gazeloc_core.methods import Method
from gazeloc_core.project import Chosen, Project, RecordingEntry, ScanEntry, Settings, TagEntry
from gazeloc_core.storage.artifacts import Artifact, State
from gazeloc_core.storage.files import folder_replaced_atomically
from gazeloc_core.storage.hashing import FileHasher, hash_of_value


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    for name in ("scan", "walk"):
        (tmp_path / "data" / name).mkdir(parents=True)
        (tmp_path / "data" / name / "file").write_text(name)
    return Settings(
        scan=ScanEntry(path=tmp_path / "data" / "scan", unit="cm", up_axis="z"),
        tags=TagEntry(family="tag36h11", size_m=0.16),
        recordings={"walk": RecordingEntry(path=tmp_path / "data" / "walk")},
    )


@pytest.fixture
def project(tmp_path: Path, settings: Settings) -> Project:
    return Project.create(tmp_path / "project", settings)


def test_settings_come_back_as_they_were(project: Project, settings: Settings):
    assert Project.open(project.folder).settings == settings


def test_project_and_data_can_be_moved_together(tmp_path: Path, project: Project):
    home = tmp_path.with_name(tmp_path.name + "-moved")
    tmp_path.rename(home)
    assert Project.open(home / "project").settings.scan.path == home / "data" / "scan"


def test_a_folder_with_anything_in_it_is_refused(tmp_path: Path, settings: Settings):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ProjectError, match="not empty"):
        Project.create(tmp_path, settings)
    assert (tmp_path / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("name", ["", "../up", "a/b", ".hidden", "x" * 100])
def test_names_that_cannot_be_folders_are_refused(project: Project, settings: Settings, name: str):
    with pytest.raises(ProjectError, match="cannot be used"):
        project.add_recording(name, settings.recordings["walk"])


@pytest.mark.parametrize(
    ("content", "fragment"),
    [
        ("{", "not valid JSON"),
        ('{"format": "gazeloc-project", "version": 99}', "version 99"),
        ('{"format": "gazeloc-project", "version": 1}', "damaged at 'scan'"),
        ("[]", "damaged"),
    ],
)
def test_damaged_settings_are_named(project: Project, content: str, fragment: str):
    (project.folder / "project.json").write_text(content)
    with pytest.raises(GazelocError, match=fragment):
        Project.open(project.folder)


def test_keypoints_survive_to_the_last_bit(project: Project):
    pair = KeypointPair("k1", "Lamp <b>", (0.1, 1 / 3, -2e-17), None, (Sighting(7, 1.5, 1 / 7),), enabled=False)
    on_scan = KeypointPair("k2", "Door", (1, 2, 3), scan_sightings=(Sighting(0, 1 / 3, 2.0),), scan_sigma=0.1 / 3)
    project.save_keypoints("walk", KeypointSet((pair, on_scan)))
    assert project.keypoints("walk") == KeypointSet((pair, on_scan))


def test_keypoints_of_before_the_phones_frames_could_be_clicked_are_read(project: Project):
    pair = KeypointPair("k1", "Lamp", (1, 2, 3), (4, 5, 6))
    (value,) = KeypointSet((pair,)).to_json()
    assert KeypointSet.from_json([{k: v for k, v in value.items() if not k.startswith("scan_")}]).pairs == (pair,)


def test_renaming_a_keypoint_leaves_the_alignment_fresh_and_moving_it_does_not(project: Project):
    pairs = KeypointSet((KeypointPair("k1", "a", (0, 0, 0), (1, 1, 1)),))
    project.save_keypoints("walk", pairs)
    before = project.hash_of_keypoints("walk")
    project.save_keypoints("walk", pairs.change("k1", name="b"))
    assert project.hash_of_keypoints("walk") == before
    project.save_keypoints("walk", pairs.change("k1", scan=(0, 0, 0.001)))
    assert project.hash_of_keypoints("walk") != before


def test_choices_of_alignments_are_kept(project: Project):
    project.choose("walk", Chosen(alignment="abc", by_person=True))
    assert Project.open(project.folder).settings.chosen["walk"] == Chosen(alignment="abc", by_person=True)
    project.choose("walk", None)
    assert project.settings.chosen == {}


def test_a_second_process_is_told_who_writes(project: Project):
    lock = str(project.folder / ".lock")
    code = f"from gazeloc_core.storage.lock import WriteLock; from pathlib import Path; WriteLock(Path({lock!r}))"
    with project.lock():
        second = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert second.returncode != 0
        assert "another process is writing" in second.stderr
        with pytest.raises(ProjectLockedError):
            project.lock()
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_a_killed_writer_leaves_no_lock(project: Project):
    code = (
        "import os; from gazeloc_core.storage.lock import WriteLock; from pathlib import Path; "
        f"lock = WriteLock(Path({str(project.folder / '.lock')!r})); os._exit(9)"
    )
    subprocess.run([sys.executable, "-c", code])
    project.lock().release()


def test_artifacts_are_fresh_until_an_input_changes(project: Project):
    artifact = project.artifact("walk", "keyframes")
    inputs = {"recording": "1"}
    assert artifact.state(inputs)[0] is State.MISSING
    artifact.write_arrays({"keyframes": np.arange(3)}, options={"rate": 3}, inputs=inputs, stats={"frames": 3})
    assert artifact.state(inputs) == (State.FRESH, "")
    assert artifact.read_arrays()["keyframes"].tolist() == [0, 1, 2]
    assert artifact.state({"recording": "2"}) == (State.STALE, "changed since: recording")


def test_the_same_content_has_the_same_hash(project: Project):
    hashes = []
    for stage in ("tags", "tags"):
        artifact = project.artifact("walk", stage)
        artifact.write_arrays({"x": np.linspace(0, 1, 1000)}, options={}, inputs={})
        hashes.append(artifact.header().content)
    assert hashes[0] == hashes[1]


def test_a_failure_is_remembered_for_its_inputs_and_forgotten_on_success(project: Project):
    artifact = project.artifact("walk", "tags")
    artifact.remember_failure(InputError("No tag was found."), {"recording": "1"})
    assert artifact.state({"recording": "1"}) == (State.FAILED, "No tag was found.")
    assert artifact.state({"recording": "2"})[0] is State.MISSING
    artifact.write_arrays({"x": np.zeros(1)}, options={}, inputs={"recording": "1"})
    assert artifact.state({"recording": "1"})[0] is State.FRESH


def test_a_write_that_fails_leaves_the_old_artifact(tmp_path: Path):
    artifact = Artifact(tmp_path / "stage")
    artifact.write_arrays({"x": np.ones(2)}, options={}, inputs={})

    def half(folder: Path) -> None:
        (folder / "arrays.npz").write_bytes(b"half")
        raise InputError("the disk is full")

    with pytest.raises(InputError):
        artifact.write(half, options={}, inputs={"a": "b"})
    assert artifact.read_arrays()["x"].tolist() == [1, 1]
    assert [path.name for path in tmp_path.iterdir()] == ["stage"]


@pytest.mark.parametrize("damage", ["{", "{}", '{"format": "other", "version": 1}'])
def test_a_damaged_header_makes_an_artifact_stale_not_a_traceback(tmp_path: Path, damage: str):
    artifact = Artifact(tmp_path / "stage")
    artifact.write_arrays({"x": np.ones(2)}, options={}, inputs={})
    (artifact.folder / "header.json").write_text(damage)
    assert artifact.state({})[0] is State.STALE
    with pytest.raises(GazelocError):
        artifact.read_arrays()


def test_truncated_arrays_are_named(tmp_path: Path):
    artifact = Artifact(tmp_path / "stage")
    artifact.write_arrays({"x": np.random.default_rng(0).normal(size=5000)}, options={}, inputs={})
    file = artifact.folder / "arrays.npz"
    file.write_bytes(file.read_bytes()[:1000])
    with pytest.raises(ProjectError, match="damaged"):
        artifact.read_arrays()


def test_folders_are_replaced_whole(tmp_path: Path):
    folder = tmp_path / "result"
    for word in ("first", "second"):
        with folder_replaced_atomically(folder) as part:
            (part / f"{word}.txt").write_text(word)
    assert [path.name for path in folder.iterdir()] == ["second.txt"]


def test_hashes_follow_content_names_and_not_hidden_files(tmp_path: Path):
    hasher = FileHasher(tmp_path / ".memory.json")
    folder = tmp_path / "scan"
    folder.mkdir()
    (folder / "a").write_text("1")
    first = hasher.hash_of(folder)
    (folder / ".DS_Store").write_text("noise")
    assert hasher.hash_of(folder) == first
    (folder / "b").write_text("2")
    assert hasher.hash_of(folder) != first
    hasher.remember()
    assert json.loads((tmp_path / ".memory.json").read_text())


def test_a_missing_input_is_named(tmp_path: Path):
    with pytest.raises(InputError, match="missing"):
        FileHasher(tmp_path / ".memory.json").hash_of(tmp_path / "gone")


def test_value_hashes_ignore_the_order_of_keys():
    assert hash_of_value({"a": 1, "b": [2.0]}) == hash_of_value({"b": [2.0], "a": 1})


def test_choices_made_at_the_same_time_are_all_kept(project: Project):
    """The app's loop and its worker process change different parts of one file."""
    names = [f"walk {number}" for number in range(6)]

    def choose(name: str) -> None:
        for turn in range(10):
            project.choose(name, Chosen(alignment=f"a{turn}", by_person=True))
            project.choose_method(name, Method.TAGS if turn % 2 else Method.SFM)

    threads = [threading.Thread(target=choose, args=(name,)) for name in names]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert {name: chosen.alignment for name, chosen in project.settings.chosen.items()} == dict.fromkeys(names, "a9")
    assert project.settings.methods == dict.fromkeys(names, Method.TAGS)
