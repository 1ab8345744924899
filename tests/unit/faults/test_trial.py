"""The record of a trial: unchanged by writing and reading, and nothing else is accepted."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deploy.stack.errors import DeployError
from faults.trial import BrokenPromise, Injected, Sample, Trial, parse
from faults.trial_file import read_trials

numbers = st.floats(allow_nan=False, allow_infinity=False)
sentences = st.text(max_size=20)
injected = st.builds(
    Injected,
    fault=sentences,
    time_s=numbers,
    parameters=st.dictionaries(sentences, numbers | sentences, max_size=2),
    detector=st.none() | sentences,
    to_zero_s=st.none() | numbers,
)
broken = st.builds(BrokenPromise, promise=st.integers(1, 8), time_s=numbers, sentence=sentences)
samples = st.builds(
    Sample,
    time_s=numbers,
    commanded=st.tuples(numbers, numbers),
    permitted=st.tuples(numbers, numbers),
    true=st.tuples(numbers, numbers),
    clearance_m=numbers,
    reasons=st.lists(sentences, max_size=2).map(tuple),
)
trials = st.builds(
    Trial,
    mode=st.sampled_from(["virtual", "real"]),
    revision=sentences,
    seed=st.integers(0, 2**40),
    duration_s=numbers,
    faults=st.lists(injected, max_size=2).map(tuple),
    smallest_clearance_m=numbers,
    contacts=st.integers(0, 9),
    violations=st.lists(broken, max_size=2).map(tuple),
    timeline=st.lists(samples, max_size=2).map(tuple),
)


def trial(seed: int = 1) -> Trial:
    return Trial(
        mode="virtual",
        revision="r",
        seed=seed,
        duration_s=10.0,
        faults=(),
        smallest_clearance_m=0.5,
        contacts=0,
    )


@pytest.mark.long
@given(trials)
def test_a_trial_comes_back_from_its_line_as_it_was(one: Trial) -> None:
    line = one.line()
    assert "\n" not in line
    assert parse(Trial, line) == one


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("", "not a trial"),
        ("{}", "field required"),
        (trial().line().replace('"format":1', '"format":2'), "format"),
        (trial().line().replace('"seed":1', '"seed":"1"'), "seed"),
        (trial().line().replace('"seed":1', '"seed":1,"colour":"red"'), "colour"),
        (trial().line().replace("0.5", "NaN"), "smallest_clearance_m"),
    ],
)
def test_another_line_is_refused_in_a_sentence(line: str, complaint: str) -> None:
    with pytest.raises(DeployError, match=complaint):
        parse(Trial, line)


def test_a_last_line_without_its_end_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "trials.jsonl"
    path.write_text(f"{trial(1).line()}\n{trial(2).line()}\n{trial(3).line()[:20]}")
    assert [one.seed for one in read_trials(path)] == [1, 2]


def test_a_wrong_line_is_named_and_so_is_a_file_that_is_not_there(tmp_path: Path) -> None:
    path = tmp_path / "trials.jsonl"
    path.write_text(f"{trial(1).line()}\nnonsense\n")
    with pytest.raises(DeployError, match=r"trials\.jsonl:2"):
        list(read_trials(path))
    with pytest.raises(DeployError, match="cannot read"):
        list(read_trials(tmp_path / "none.jsonl"))
