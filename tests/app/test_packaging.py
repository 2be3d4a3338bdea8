"""Wheel, sdist and editable install: what is in them, and that they work where the checkout is not."""

import os
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
from data import CHECKOUT

from gazeloc_core import __version__

pytestmark = pytest.mark.slow
MOST_WHEEL_BYTES = 12 * 2**20 + 2 * 2**20
"""The sample scene's 12 MB and the rest."""
ON_SHOW = {"tour", "experiments"}
"""Folders of static/ with the README's pictures and reports, which nothing loads."""
FIND = (
    "import gazeloc_core, gazeloc_app\n"
    "from gazeloc_core.resources import sample_scene, static_file\n"
    "print(gazeloc_core.__file__, gazeloc_app.__file__, sep='\\n')\n"
    "print(static_file('comparison.html'), sample_scene('studio'), sep='\\n')"
)


def call(*command: object, cwd: Path | None = None) -> str:
    """Run a command that must succeed, without this checkout on the path; what it printed."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    done = subprocess.run(list(map(str, command)), cwd=cwd, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def checkout(tmp_path_factory) -> Path:
    """The files that git knows or would know, somewhere else: builds leave nothing behind here."""
    if not (CHECKOUT / "sample_scenes" / "studio").is_dir():
        pytest.skip("sample_scenes/studio is not written; make scenes")
    folder = tmp_path_factory.mktemp("source") / "gazeloc"
    listed = call("git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", cwd=CHECKOUT).split("\0")
    for name in filter(None, listed):
        if (CHECKOUT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes((CHECKOUT / name).read_bytes())
    return folder


def build(source: Path, output: Path, kind: str) -> Path:
    call(sys.executable, "-m", "build", "--no-isolation", f"--{kind}", "--outdir", output, source)
    (built,) = output.iterdir()
    return built


@pytest.fixture(scope="module")
def wheel(checkout: Path, tmp_path_factory) -> Path:
    return build(checkout, tmp_path_factory.mktemp("wheel"), "wheel")


@pytest.fixture(scope="module")
def sdist(checkout: Path, tmp_path_factory) -> Path:
    return build(checkout, tmp_path_factory.mktemp("sdist"), "sdist")


def names_in(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as file:
        return {name for name in file.namelist() if not name.endswith("/RECORD")}


def below(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_the_wheel_holds_both_packages_and_the_shipped_files(wheel: Path, checkout: Path):
    names = names_in(wheel)
    shipped = {name.removeprefix("gazeloc_core/shipped/") for name in names if "/shipped/" in name}
    expected = {f"static/{name}" for name in below(checkout / "static") if name.split("/")[0] not in ON_SHOW}
    expected |= {f"sample_scenes/studio/{name}" for name in below(checkout / "sample_scenes" / "studio")}
    assert shipped == expected
    for package, folder in (("gazeloc_core", checkout), ("gazeloc_app", checkout / "app")):
        modules = {f"{package}/{name}" for name in below(folder / package)}
        assert modules <= names
        assert f"{package}/py.typed" in names
    assert {name.split("/")[0] for name in names} == {"gazeloc_app", "gazeloc_core", f"gazeloc-{__version__}.dist-info"}
    assert wheel.stat().st_size <= MOST_WHEEL_BYTES


def test_the_sdist_builds_the_same_wheel(sdist: Path, wheel: Path, tmp_path: Path):
    with tarfile.open(sdist) as file:
        file.extractall(tmp_path, filter="data")
    (source,) = tmp_path.iterdir()
    assert {"tests", "Makefile", "README.md", "LICENSE", "constraints.txt", ".ci"} <= {p.name for p in source.iterdir()}
    again = build(source, tmp_path / "wheel", "wheel")
    with zipfile.ZipFile(wheel) as one, zipfile.ZipFile(again) as other:
        assert {i.filename: i.CRC for i in one.infolist()} == {i.filename: i.CRC for i in other.infolist()}


def environment(folder: Path, *, with_ours: bool) -> Path:
    """A virtual environment; `with_ours` lends it the packages of this one (not gazeloc). Its python."""
    call(sys.executable, "-m", "venv", folder)
    if with_ours:
        (packages,) = folder.glob("lib/python*/site-packages")
        ours = [path for path in map(Path, sys.path) if path.name == "site-packages"]
        (packages / "zz_ours.pth").write_text("\n".join(map(str, ours)) + "\n")
    return folder / "bin" / "python"


def test_an_editable_install_uses_the_files_of_the_checkout(checkout: Path, tmp_path: Path):
    python = environment(tmp_path / "venv", with_ours=True)
    call(python, "-m", "pip", "install", "--no-deps", "--no-build-isolation", "--editable", checkout)
    core, app, static, scene = call(python, "-c", FIND, cwd=tmp_path).splitlines()
    assert Path(core) == checkout / "gazeloc_core" / "__init__.py"
    assert Path(app) == checkout / "app" / "gazeloc_app" / "__init__.py"
    assert Path(static) == checkout / "static" / "comparison.html"
    assert Path(scene) == checkout / "sample_scenes" / "studio"
    assert call(python.with_name("gazeloc"), "--version", cwd=tmp_path) == f"gazeloc {__version__}\n"


def test_the_wheel_works_in_an_empty_environment(wheel: Path, home: Path, tmp_path: Path):
    python = environment(tmp_path / "venv", with_ours=False)
    call(python, "-m", "pip", "install", "--quiet", "--constraint", CHECKOUT / "constraints.txt", wheel)
    found = [Path(line) for line in call(python, "-c", FIND, cwd=tmp_path).splitlines()]
    assert all(path.is_relative_to(tmp_path / "venv") and path.exists() for path in found)
    gazeloc = python.with_name("gazeloc")
    assert "evaluate" in call(gazeloc, "--help", cwd=tmp_path)
    assert "Reconstruct the keyframes" in call(gazeloc, "status", home / "project", cwd=tmp_path)
    assert '"registered": 2' in call(gazeloc, "evaluate", home / "aligned", "--json", cwd=tmp_path)
    call(gazeloc, "export", home / "aligned", "--format", "colmap", "--output", tmp_path / "out", cwd=tmp_path)
    call(python, "-c", "import gazeloc_app.app, gazeloc_app.drawing.render_worker", cwd=tmp_path)


def test_every_requirement_is_pinned():
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["dev"]]
    names = {text.split(";")[0].split(">")[0].split("=")[0].strip() for text in wanted}
    lines = (CHECKOUT / "constraints.txt").read_text().splitlines()
    pinned = {line.split("==")[0] for line in lines if "==" in line}
    assert names - pinned <= {"open3d"}, "open3d stands in for open3d-cpu elsewhere"
