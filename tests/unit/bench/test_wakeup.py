"""The time breakdown of a wake-up: the summary of a section, and a short run of all sections."""

import pytest

from bench.wakeup import REFERENCE, Section, measure_wakeup, summarize


def test_a_section_has_the_medians_of_its_times() -> None:
    assert summarize("one", 50.0, [1.0, 2.0, 90.0], [4.0, 80.0, 6.0]) == Section("one", 50.0, 2.0, 6.0)


def test_a_section_has_its_share_of_a_core_at_its_rate() -> None:
    section = Section("one", 50.0, hot_us=100.0, cold_us=400.0)
    assert section.cold_to_hot == pytest.approx(4.0)
    assert section.hot_percent == pytest.approx(0.5)
    assert section.cold_percent == pytest.approx(2.0)


def test_all_sections_run() -> None:
    sections = measure_wakeup(rounds=1, cold_sleep_s=0.001)
    assert sections[0].section == REFERENCE
    assert len({section.section for section in sections}) == len(sections)
    assert all(section.hot_us > 0.0 and section.cold_us > 0.0 for section in sections)
