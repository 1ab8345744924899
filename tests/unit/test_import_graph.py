"""The import graph of the whole project, computed from its files."""

import grimp
import pytest

PACKAGES = ("wire", "supervisor", "teleop", "sim", "deploy", "bench")


@pytest.fixture(scope="module")
def imports() -> dict[str, set[str]]:
    """The modules of this project that each module imports."""
    graph = grimp.build_graph(*PACKAGES, cache_dir=None)
    return {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}


def test_no_two_files_import_each_other_not_even_in_a_circle(imports: dict[str, set[str]]) -> None:
    assert len(imports) > 150
    open_ends = {module: set(imported) for module, imported in imports.items()}
    while leaves := [module for module, imported in open_ends.items() if not imported]:
        for leaf in leaves:
            del open_ends[leaf]
        for imported in open_ends.values():
            imported.difference_update(leaves)
    assert sorted(open_ends) == [], "a circle of imports is among these, or what imports it"
