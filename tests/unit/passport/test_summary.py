"""Rows and the sentence of a passport."""

from passport.summary import not_shown, rows, sentence
from tests.unit.passport.records import UNCERTAINTY_M, UNCERTAINTY_RAD, UNCERTAINTY_S, cell, record, run

KILLED, SILENT, TURN = "operator's program killed", "supervisor killed", "plain zero in a turn"


def test_a_row_has_the_limits_with_the_uncertainty_of_the_instrument() -> None:
    (row,) = rows(record(cell(KILLED, run(0.3), run(0.2, stop_s=0.7))))
    assert row.distance_m is not None
    assert row.stopping_s is not None
    assert row.reaction_s is not None
    assert row.distance_m.value == 0.3 + UNCERTAINTY_M
    assert row.stopping_s.value == 0.7 + UNCERTAINTY_S
    assert row.reaction_s.value == 0.1 + UNCERTAINTY_S
    assert (row.runs, row.not_stopped, row.least_m_s2, row.slips) == (2, 0, 1.8, 0)


def test_a_row_of_a_fault_that_takes_the_recorder_has_only_a_distance() -> None:
    (row,) = rows(record(cell(SILENT, run(0.3, stop_s=None))))
    assert row.distance_m is not None
    assert (row.stopping_s, row.reaction_s, row.least_m_s2) == (None, None, None)


def test_the_sentence_speaks_of_the_highest_speed_alone() -> None:
    found = sentence(record(cell("plain zero", run(0.9, v0_m_s=0.3), speed_m_s=0.3), cell(KILLED, run(0.3))))
    assert found == (
        "After the one fault tested, at 0.8 m/s with 0 % load, this robot stood within 0.31 m and within 0.52 s: one run each."
    )


def test_the_sentence_states_for_which_faults_the_time_is_known() -> None:
    found = sentence(
        record(cell(KILLED, run(), run()), cell(SILENT, run(0.4, stop_s=None), run(stop_s=None)))
    )
    assert "any of the 2 faults tested" in found
    assert found.endswith(
        "within 0.41 m and, after the one cell whose time was recorded, within 0.52 s: the largest of 2 runs each."
    )
    three = sentence(record(cell(KILLED, run()), cell("e-stop", run()), cell(SILENT, run(stop_s=None))))
    assert "and, after the 2 cells whose time was recorded, within 0.52 s" in three


def test_a_run_that_does_not_show_a_time_counts_as_longer_than_any_other() -> None:
    lost = run().model_copy(update={"t3_s": None})
    (row,) = rows(record(cell(KILLED, *[run()] * 59, lost)))
    assert row.stopping_s is None
    assert row.distance_m is not None
    assert row.reaction_s is not None
    assert "and within" not in sentence(record(cell(KILLED, *[run()] * 59, lost)))
    (second,) = rows(record(cell(KILLED, *[run()] * 92, lost)))
    assert second.stopping_s is not None
    assert second.stopping_s.runs == 93
    (most,) = rows(record(cell(KILLED, *[run()] * 91, lost, lost)))
    assert most.stopping_s is None


def test_a_turn_is_in_rad_and_in_the_sentence_only_if_nothing_else_was_measured() -> None:
    turn = cell(TURN, run(0.4, v0_m_s=2.0), speed_m_s=2.0, turn=True)
    for cells in ((turn, cell(KILLED, run(0.3))), (cell(KILLED, run(0.3)), turn)):
        assert "at 0.8 m/s with 0 % load, this robot stood within 0.31 m and" in sentence(record(*cells))
    (row,) = rows(record(turn))
    assert row.distance_m is not None
    assert row.distance_m.value == 0.4 + UNCERTAINTY_RAD
    assert sentence(record(turn)) == (
        "After the one fault tested, at 2 rad/s with 0 % load, this robot stood within 0.43 rad and within 0.52 s: one run each."
    )
    refused = cell(TURN, speed_m_s=2.0, refused="it needs a turn", turn=True)
    assert "plain zero in a turn at 2 rad/s, load 0 %: it needs a turn" in not_shown(record(refused))


def test_the_sentence_without_any_time_has_a_distance_only() -> None:
    found = sentence(record(cell(SILENT, run(0.4, stop_s=None))))
    assert found.endswith("this robot stood within 0.41 m: one run each.")


def test_the_sentence_names_the_fewest_runs_of_a_cell() -> None:
    assert sentence(record(cell(KILLED, run(), run()), cell("e-stop", run()))).endswith(
        "the largest of at least 1 run each."
    )


def test_a_run_without_a_stop_is_the_sentence() -> None:
    found = sentence(record(cell(KILLED, run(), run(stopped=False)), cell("e-stop", run())))
    assert found == (
        "This robot DID NOT STOP by itself after: operator's program killed at 0.8 m/s with 0 % load (1 of 2 runs)."
    )


def test_a_turn_or_a_slow_run_without_a_stop_is_the_sentence_too() -> None:
    turn = cell(TURN, run(stopped=False), speed_m_s=2.0, turn=True)
    failed = record(cell(KILLED, run()), cell(KILLED, run(stopped=False), speed_m_s=0.3), turn)
    assert sentence(failed).endswith(
        "after: operator's program killed at 0.3 m/s with 0 % load (1 of 1 runs), "
        "plain zero in a turn at 2 rad/s with 0 % load (1 of 1 runs)."
    )
    assert not any("how often" in one for one in not_shown(failed))


def test_a_run_without_a_stop_and_without_lifeline_is_named_so() -> None:
    alone = cell(KILLED, run(stopped=False), with_lifeline=False)
    assert sentence(record(alone)).startswith("Without Lifeline, this robot DID NOT STOP")


def test_enough_runs_prove_the_sentence() -> None:
    found = sentence(record(cell(KILLED, *[run()] * 59)))
    assert found.endswith(
        "95 % of all stops, with 95 % confidence for all of these cells together, distance and time each by itself."
    )


def test_a_sentence_that_is_proven_for_some_cells_only_is_no_proof_and_no_largest_of_all() -> None:
    """The limit of the many runs is the second largest, so it is not true that no run was longer."""
    many = cell(KILLED, *[run()] * 199, run(0.9))
    assert sentence(record(many, cell("e-stop", *[run()] * 10))).endswith(
        "within 0.31 m and within 0.52 s: some limits are only the largest of 10 runs."
    )
    assert sentence(record(many, cell("e-stop", run()))).endswith(
        "some limits are only the largest of 1 run."
    )


def test_a_record_without_runs_shows_nothing() -> None:
    assert sentence(record(cell(KILLED, refused="the wall is too near"))) == "Nothing was measured."
    assert sentence(record()) == "Nothing was measured."


def test_a_measurement_without_lifeline_is_named() -> None:
    without = cell(KILLED, run(), with_lifeline=False)
    assert "After the one fault tested without Lifeline" in sentence(record(without))


def test_the_sentence_does_not_mix_runs_with_and_without_lifeline() -> None:
    without = cell(KILLED, run(0.9), with_lifeline=False)
    for cells in ((without, cell(KILLED, run(0.3))), (cell(KILLED, run(0.3)), without)):
        found = sentence(record(*cells))
        assert found.startswith("After the one fault tested, at")
        assert "within 0.31 m" in found


def test_what_was_refused_or_never_tested_is_listed() -> None:
    found = list(
        not_shown(record(cell(KILLED, refused="the wall is too near"), cell("e-stop", *[run()] * 59)))
    )
    assert "without Lifeline" in found
    assert "operator's program killed at 0.8 m/s, load 0 %: the wall is too near" in found
    assert found[-1] == "how often a fault has no stop: none in 59 runs means at most 5.0 % (95 %)"
    assert not any("how often" in one for one in not_shown(record()))
    assert list(not_shown(record(cell("e-stop", run()))))[-1].endswith(
        "none in 1 run means at most 95.0 % (95 %)"
    )


def test_a_robot_that_does_not_stop_without_lifeline_changes_nothing_of_what_is_said_with_it() -> None:
    alone = cell(KILLED, run(stopped=False), with_lifeline=False, refused="ended in run 1")
    found = list(not_shown(record(cell(KILLED, *[run()] * 59), alone)))
    assert f"{KILLED}, without Lifeline at 0.8 m/s, load 0 %: ended in run 1" in found
    assert found[-1] == "how often a fault has no stop: none in 59 runs means at most 5.0 % (95 %)"


def test_no_limit_of_the_sentence_is_rounded_down() -> None:
    found = sentence(record(cell(KILLED, run(0.3301, stop_s=0.4904))))
    assert "within 0.35 m and within 0.52 s" in found


def test_a_robot_that_did_not_stop_has_no_rate_of_no_failures() -> None:
    failed = record(cell(KILLED, run(), run(stopped=False)), cell("e-stop", run()))
    assert not any("how often" in one for one in not_shown(failed))
