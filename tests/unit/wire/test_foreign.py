"""JSON and TOML that others wrote: values within bounds, or one kind of error."""

import os
import time
import tomllib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from wire import foreign
from wire.foreign import MAX_DEPTH, MAX_KEY_PARTS, ForeignError, from_json, from_toml, read_text

ROOT = Path(__file__).resolve().parents[3]
LONGEST = ".".join("a" * MAX_KEY_PARTS)
DOTS = f"{LONGEST}.{LONGEST}"
VALID = (
    "",
    f"{LONGEST} = 1",
    f'a = "{DOTS}" # {DOTS} " \' """',
    f"a = '{DOTS}\\'\nb = ''",
    f"a = '''\n'{DOTS}'''''\nb = ''''''",
    f'a = """\\"\\\n""{DOTS}"""""\nb = """"""',
    f"\"{DOTS}\" = 1\n[x.'{DOTS}']",
    'a = [1.5, 07:32:00.999, "\\\\", "\\"", "", \'\', {b.c = 1}]',
    *(path.read_text() for path in sorted((ROOT / "deploy").glob("*.toml"))),
    *(path.read_text() for path in sorted((ROOT / "examples").glob("**/*.toml"))),
)
"""Texts of TOML."""
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


def test_a_pipe_or_a_device_is_not_waited_for(tmp_path: Path) -> None:
    pipe = tmp_path / "robot.toml"
    os.mkfifo(pipe)
    for path in (pipe, Path("/dev/zero"), Path("/dev/null")):
        with pytest.raises(OSError, match="it is a pipe or a device, not a file"):
            read_text(path)
    with pytest.raises(IsADirectoryError):
        read_text(tmp_path)


def test_an_integer_that_cannot_be_printed_is_refused_in_toml() -> None:
    assert from_toml(f"a = {2**64 - 1}") == {"a": 2**64 - 1}
    with pytest.raises(ForeignError, match="more than 20 digits"):
        from_toml(f"a = 0x{'f' * 6000}")


@pytest.mark.parametrize("before", ["", "x = 1\n", "[", "x = {"], ids=["first", "later", "table", "inline"])
@pytest.mark.parametrize(
    "key",
    [f"{LONGEST}.a", f"a . {LONGEST}", f'{LONGEST}."b.c"', f"'a'\t.{LONGEST}", ".".join("a" * 20_000)],
    ids=["bare", "spaces", "basic", "literal", "huge"],
)
@pytest.mark.parametrize("after", ["", " = 1", " ! 1"])
def test_a_key_of_too_many_parts_is_refused_before_it_is_parsed(
    monkeypatch: pytest.MonkeyPatch, before: str, key: str, after: str
) -> None:
    def parse(_: str) -> None:
        pytest.fail("it is parsed")

    monkeypatch.setattr(tomllib, "loads", parse)
    line = 1 + before.count("\n")
    with pytest.raises(ForeignError, match=f"a key in line {line} has more than {MAX_KEY_PARTS} parts"):
        from_toml(f"{before}{key}{after}")


@pytest.mark.parametrize("text", VALID)
def test_a_key_of_too_many_parts_is_found_after_any_text_and_nowhere_else(text: str) -> None:
    from_toml(text)
    with pytest.raises(ForeignError, match="has more than"):
        from_toml(f"{text}\n{LONGEST}.a = 1")


@pytest.mark.parametrize(
    "part", ["a.a=1\n", '"a"', "''", '"\\"', "#\n", ".", '."', "'.'", 'a""."".', '"""', "a ."]
)
def test_the_search_for_keys_of_too_many_parts_takes_linear_time(part: str) -> None:
    def seconds(length: int) -> float:
        text = part * (length // len(part))
        began_s = time.process_time()
        foreign.refuse_long_keys(text)
        return time.process_time() - began_s

    with suppress(ForeignError):
        assert min(seconds(400_000) for _ in range(3)) < 0.02 + 20 * min(seconds(40_000) for _ in range(3))


@pytest.mark.parametrize("escape", ["\\u0000", "\\U00000000"])
def test_the_character_nul_is_refused_in_toml(escape: str) -> None:
    with pytest.raises(ForeignError, match="the character NUL"):
        from_toml(f'keys = "a{escape}b"')
