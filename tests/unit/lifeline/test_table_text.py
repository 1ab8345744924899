"""Each table uses the helper that makes foreign text printable: found in the syntax trees of all programs."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
HELPER = "deploy/stack/table.py"
PRINTABLE = {"printable", "printable_lines"}
WRAPPERS = {"runnable"}
"""Functions that return their argument with other commands in it."""
FILES = sorted(
    path.relative_to(ROOT)
    for package in ROOT.glob("*/__init__.py")
    if package.parent.name != "tests"
    for path in package.parent.rglob("*.py")
)


def raw_texts(source: str) -> list[str]:
    """Return what a module with tables shows without making it printable."""
    if "table import" not in source:  # most modules, whose parsing takes a second of processor time
        return []
    tree = ast.parse(source)
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    raw = [f"line {node.lineno}: a table of rich" for node in imports if node.module == "rich.table"]
    has_table = any(node.module in {"rich.table", "deploy.stack.table"} for node in imports)
    return raw + (list(_raw_cells(tree)) if has_table else [])


def _raw_cells(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and node.args:
            of_text = isinstance(node.func, ast.Name) and node.func.id == "Text"
            of_markup = isinstance(node.func, ast.Attribute) and node.func.attr == "from_markup"
            if of_markup or (of_text and not _is_printable(node.args[0])):
                yield f"line {node.lineno}: {ast.unparse(node)}"


def _is_printable(value: ast.expr) -> bool:
    if isinstance(value, ast.Constant):
        return True
    if isinstance(value, ast.JoinedStr):
        fields = [one for one in value.values if isinstance(one, ast.FormattedValue)]
        return all(field.format_spec is not None for field in fields)  # numbers
    if isinstance(value, ast.Subscript):
        value = value.value
    if isinstance(value, ast.IfExp):
        return _is_printable(value.body) and _is_printable(value.orelse)
    if isinstance(value, ast.Call) and isinstance(value.func, ast.Name):
        return value.func.id in PRINTABLE or (value.func.id in WRAPPERS and _is_printable(value.args[0]))
    # A constant of the module, such as UNKNOWN or MARKS[verdict].
    return isinstance(value, ast.Name) and value.id.isupper()


def test_no_table_shows_foreign_text_raw() -> None:
    found = {str(path): raw_texts((ROOT / path).read_text()) for path in FILES if str(path) != HELPER}
    assert len(found) > 100
    assert {path: raw for path, raw in found.items() if raw} == {}


@pytest.mark.parametrize(
    "source",
    [
        "from rich.table import Table",
        "from deploy.stack.table import Table\nText(name)",
        "from deploy.stack.table import Table\nText(f'{name}: 1', style='red')",
        "from deploy.stack.table import Table\nText(printable(name) if name else other)",
        "from deploy.stack.table import Table\nText(', '.join(map(printable, names)))",
        "from deploy.stack.table import Table\nText.from_markup(name)",
    ],
)
def test_a_raw_text_is_found(source: str) -> None:
    assert len(raw_texts(source)) == 1
