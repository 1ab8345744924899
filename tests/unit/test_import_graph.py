"""The import graph of the whole project, computed from its files."""

from collections import defaultdict
from graphlib import CycleError, TopologicalSorter

import grimp
import pytest

from tests.packages import PACKAGES

ROOTS = (*PACKAGES, "bench", "tests.fuzz", "tests.scenes")

Arrows = dict[str, set[str]]


@pytest.fixture(scope="module")
def files() -> Arrows:
    """The modules of this project that each module imports."""
    graph = grimp.build_graph(*ROOTS, cache_dir=None)
    return {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}


@pytest.fixture(scope="module")
def folders(files: Arrows) -> Arrows:
    """The folders that the modules of each folder import from."""
    packages = {module.rpartition(".")[0] for module in files}

    def folder_of(module: str) -> str:
        return module if module in packages else module.rpartition(".")[0]

    arrows: Arrows = defaultdict(set)
    for module, imported in files.items():
        arrows[folder_of(module)] |= {folder_of(one) for one in imported} - {folder_of(module)}
    return arrows


def cycle(arrows: Arrows) -> list[str]:
    try:
        TopologicalSorter(arrows).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_file_imports_have_no_cycle(files: Arrows) -> None:
    assert len(files) > 150
    assert cycle(files) == []


def test_folder_imports_have_no_cycle(folders: Arrows) -> None:
    assert {"wire", "deploy.stack", "faults"} <= folders["faults.real.rig"]
    assert cycle(folders) == []


def test_a_cycle_is_found() -> None:
    assert cycle({"one": {"two"}, "two": {"three"}, "three": {"one"}, "four": {"one"}}) != []
