"""Shipped files: the package's own folder first, then the checkout; never outside of them."""

import pytest

from gazeloc_core import resources
from gazeloc_core.errors import InputError


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """An installation: site-packages/gazeloc_core with shipped files, and a stray static/ beside the package."""
    package = tmp_path / "site-packages" / "gazeloc_core"
    for folder in (package / "shipped", package.parent):
        (folder / "static").mkdir(parents=True)
        (folder / "static" / "page.css").write_text(str(folder))
    (package / "shipped" / "sample_scenes" / "studio").mkdir(parents=True)
    (package.parent / "static" / "only_beside.css").write_text("")
    (package.parent / "secret.txt").write_text("")
    monkeypatch.setattr(resources, "_PACKAGE", package)
    return package


def test_the_packages_own_folder_comes_first(installed):
    assert resources.static_file("page.css") == installed / "shipped" / "static" / "page.css"


def test_a_checkout_has_its_files_beside_the_package(installed):
    assert resources.static_file("only_beside.css") == installed.parent / "static" / "only_beside.css"


def test_sample_scenes_are_found_by_name(installed):
    assert resources.sample_scene("studio") == installed / "shipped" / "sample_scenes" / "studio"
    assert resources.sample_scenes() == ["studio"]
    with pytest.raises(InputError, match="it has: studio"):
        resources.sample_scene("palace")


def test_a_missing_file_is_named(installed):
    with pytest.raises(InputError, match=r"static/none\.css"):
        resources.static_file("none.css")


@pytest.mark.parametrize("name", ["../secret.txt", "/etc/hostname", "", "a/../../secret.txt"])
def test_no_name_leads_out_of_the_folder(installed, name):
    with pytest.raises(InputError, match="not the name of a file"):
        resources.static_file(name)
