"""JSON and TOML that others wrote: values within bounds, or one kind of error."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from wire import foreign
from wire.foreign import MAX_DEPTH, ForeignError, from_json, from_toml, read_text

NESTED = ("[" * MAX_DEPTH + "]" * MAX_DEPTH, "[" * (MAX_DEPTH + 1) + "]" * (MAX_DEPTH + 1))


def test_json_and_toml_are_read() -> None:
    assert from_json(f'{{"a": [null, true, -1.5e3, {2**64 - 1}, {-(2**63)}, "x"]}}') == {
        "a": [None, True, -1500.0, 2**64 - 1, -(2**63), "x"]
    }
    assert from_toml('[bus]\nnamespace = "r"\n') == {"bus": {"namespace": "r"}}


@pytest.mark.parametrize(
    "number",
    ["NaN", "Infinity", "-Infinity", "1e999", "-1e999", "1" + "0" * 20, "1" + "0" * 400, "9" * 5000],
)
def test_a_number_that_is_not_finite_or_beyond_64_bits_is_refused(number: str) -> None:
    with pytest.raises(ForeignError):
        from_json(f'{{"a": {number}}}')


def _toml_list(text: str) -> object:
    return from_toml(f"a = {text}")


def test_an_integer_of_thousands_of_digits_is_refused_in_toml() -> None:
    with pytest.raises(ForeignError):
        from_toml(f"a = {'9' * 5000}")


@pytest.mark.parametrize("parse", [from_json, _toml_list], ids=["json", "toml"])
def test_nesting_has_a_limit(parse: Callable[[str], object]) -> None:
    parse(NESTED[0] if parse is from_json else NESTED[0][1:-1])
    with pytest.raises(ForeignError, match="nested too deeply"):
        parse(NESTED[1])
    with pytest.raises(ForeignError):
        parse("[" * 100_000)


def test_a_file_is_text_of_a_limited_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(foreign, "MAX_BYTES", 1 << 20)
    path = tmp_path / "file"
    path.write_bytes(b"\xef\xbb\xbfa = 1")
    assert read_text(path) == "a = 1"
    path.write_bytes(b"a = \xff")
    with pytest.raises(ForeignError, match="is not text"):
        read_text(path)
    path.write_bytes(bytes(1 << 20))
    assert len(read_text(path)) == 1 << 20
    path.write_bytes(bytes((1 << 20) + 1))
    with pytest.raises(ForeignError, match="larger than 1 MiB"):
        read_text(path)


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    pipe = tmp_path / "robot.toml"
    os.mkfifo(pipe)
    with pytest.raises(ForeignError, match="it is a pipe"):
        read_text(pipe)
