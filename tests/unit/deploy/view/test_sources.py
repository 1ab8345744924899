"""Which file is meant, and the policy of the web viewer's page."""

from pathlib import Path

import pytest

from deploy.stack.errors import DeployError
from deploy.view.page import policy
from deploy.view.sources import found

FIRST, SECOND = "20260704T101530.123Z-OBSTACLE", "20260704T111530.123Z-ESTOP"


@pytest.fixture
def black_boxes(tmp_path: Path) -> Path:
    for name in (FIRST, f"{FIRST}-2", SECOND):
        (tmp_path / f"{name}.jsonl.gz").touch()
    return tmp_path


@pytest.mark.parametrize(
    ("what", "name"), [("20260704T11", SECOND), (FIRST, FIRST), (f"{FIRST}-", f"{FIRST}-2")]
)
def test_a_black_box_is_named_by_its_beginning(black_boxes: Path, what: str, name: str) -> None:
    assert found(what, black_boxes) == black_boxes / f"{name}.jsonl.gz"


@pytest.mark.parametrize("what", ["none.mcap", "none.jsonl.gz", "./none"])
def test_a_path_is_taken_as_it_is(black_boxes: Path, what: str) -> None:
    assert found(what, black_boxes) == Path(what)


def test_an_ambiguous_beginning_is_refused(black_boxes: Path) -> None:
    with pytest.raises(DeployError, match="beginning of 3 black boxes"):
        found("20260704", black_boxes)


def test_an_unknown_name_is_refused(black_boxes: Path) -> None:
    with pytest.raises(DeployError, match="no file and no black box '2027'"):
        found("2027", black_boxes)


def test_the_page_may_connect_to_its_data_and_nowhere_else() -> None:
    rules = dict(rule.split(" ", 1) for rule in policy(9091).split("; "))
    assert rules["connect-src"] == "'self' http://127.0.0.1:9091 http://localhost:9091"
    assert rules["default-src"] == "'none'"
    hosts = [place for rule in rules.values() for place in rule.split() if "//" in place]
    assert hosts == ["http://127.0.0.1:9091", "http://localhost:9091"]
