"""The attachment: rmw_zenoh's layout, 33 bytes."""

import struct

from hypothesis import given
from hypothesis import strategies as st

from wire.stamp import Stamp, Stamper, parse_stamp


def test_it_is_33_bytes_in_rmw_zenohs_layout() -> None:
    stamp = Stamp(7, 1_000_000_007, bytes(range(16)))
    assert stamp.pack() == struct.pack("<qqB16s", 7, 1_000_000_007, 16, bytes(range(16)))
    assert len(stamp.pack()) == 33


@given(
    st.integers(-(2**63), 2**63 - 1), st.integers(-(2**63), 2**63 - 1), st.binary(min_size=16, max_size=16)
)
def test_it_comes_back_as_it_went(sequence: int, source_time_ns: int, gid: bytes) -> None:
    stamp = Stamp(sequence, source_time_ns, gid)
    assert parse_stamp(stamp.pack()) == stamp


@given(st.binary(max_size=80))
def test_other_attachments_are_no_stamp_and_raise_nothing(attachment: bytes) -> None:
    stamp = parse_stamp(attachment)
    assert stamp is None or stamp.pack() == attachment


def test_no_attachment_is_no_stamp() -> None:
    assert parse_stamp(None) is None


def test_a_run_counts_up_from_1_in_time_and_each_run_has_an_epoch_of_its_own() -> None:
    stamper = Stamper()
    first, second = stamper.next(), stamper.next()
    assert (first.sequence, second.sequence) == (1, 2)
    assert second.source_time_ns >= first.source_time_ns
    assert first.gid == second.gid != Stamper().next().gid


def test_what_was_true_a_moment_ago_is_stamped_with_then() -> None:
    stamper = Stamper()
    assert stamper.next(12.25).source_time_ns == 12_250_000_000
    assert stamper.next(12.25).sent().source_time_s == 12.25
