"""The house: which way imports may point, and where each heavy library lives."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from data import CHECKOUT

CORE = sorted((CHECKOUT / "gazeloc_core").rglob("*.py"))
APP = sorted((CHECKOUT / "app" / "gazeloc_app").rglob("*.py"))

HOMES = {
    "pycolmap": {"camera", "sfm", "synthesis", "localize.frame_pose", "experiments.hardness"},
    "open3d": {"surfaces", "synthesis"},
    "pyrender": {"surfaces.render"},
    "pyapriltags": {"tags"},
    "trimesh": {"readers.mesh_file", "surfaces.render"},
    "viser": set(),
    "evo": set(),
}
ORDER = ["errors", "progress", "arrays", "transforms", "camera", "scan", "recording", "readers", "stages", "pipeline"]


def imports_of(path: Path) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(CHECKOUT / "gazeloc_core").with_suffix("").parts)


def lives_in(path: Path, homes: set[str]) -> bool:
    """Whether a module, or the package around it, is one of `homes`."""
    module = module_of(path)
    return module in homes or module.split(".")[0] in homes


@pytest.mark.parametrize("path", CORE, ids=module_of)
def test_the_core_never_imports_the_app_or_a_viewer(path: Path):
    roots = {name.split(".")[0] for name in imports_of(path)}
    assert not roots & {"gazeloc_app", "viser", "evo", "playwright"}


@pytest.mark.parametrize("library", [name for name in HOMES if HOMES[name]])
def test_each_heavy_library_has_few_homes(library: str):
    users = [path for path in CORE if library in {name.split(".")[0] for name in imports_of(path)}]
    assert [module_of(path) for path in users if not lives_in(path, HOMES[library])] == []


def test_packages_of_the_core_import_each_other_one_way_round():
    imports: dict[str, set[str]] = {}
    for path in CORE:
        names = {name.split(".")[1] for name in imports_of(path) if name.startswith("gazeloc_core.")}
        imports.setdefault(module_of(path).split(".")[0], set()).update(names)
    imports = {here: (names & imports.keys()) - {here, "__init__"} for here, names in imports.items()}
    tuple(TopologicalSorter(imports).static_order())  # a CycleError names a circle


@pytest.mark.parametrize("path", CORE, ids=module_of)
def test_imports_of_the_core_point_one_way(path: Path):
    here = module_of(path).split(".")[0]
    if here not in ORDER:
        return
    later = set(ORDER[ORDER.index(here) + 1 :])
    modules = {name.split(".")[1] for name in imports_of(path) if name.startswith("gazeloc_core.")}
    assert not modules & later


def test_the_app_computes_nothing_with_heavy_libraries_itself():
    for path in APP:
        roots = {name.split(".")[0] for name in imports_of(path)}
        assert not roots & {"pycolmap", "open3d", "pyrender", "pyapriltags", "trimesh"}, path


def test_files_stay_small():
    lengths = {path: len(path.read_text().splitlines()) for path in [*CORE, *APP]}
    assert max(lengths.values()) <= 400, max(lengths, key=lengths.__getitem__)
    assert sorted(lengths.values())[len(lengths) // 2] <= 150


def test_functions_fit_a_screen():
    for path in [*CORE, *APP]:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.end_lineno:
                assert node.end_lineno - node.lineno < 75, f"{path.name}: {node.name}"
