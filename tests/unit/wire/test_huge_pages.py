"""What of a process's memory is moved into huge pages, and that nothing is lost on the way."""

import random

from wire.huge_pages import HUGE_BYTES, Mapping, full_mappings, gather_memory


def _mapping(addresses: str, permissions: str, rss_kb: int, name: str = "") -> list[str]:
    """As the kernel writes it."""
    return [
        f"{addresses} {permissions} 00000000 00:00 0 {name}",
        "KernelPageSize:        4 kB",
        f"Rss:            {rss_kb:8d} kB",
        "VmFlags: rd wr mr mw me ac sd",
    ]


def test_the_heap_and_anonymous_memory_are_taken_and_files_and_stacks_are_not() -> None:
    smaps = [
        *_mapping("1000000-1400000", "rw-p", 4096, "[heap]"),
        *_mapping("7f0000000000-7f0000200000", "rw-p", 2048),
        *_mapping("7f1000000000-7f1000200000", "r-xp", 2048),
        *_mapping("7f2000000000-7f2000200000", "rw-p", 2048, "/usr/lib/libc.so.6"),
        *_mapping("7ffd00000000-7ffd00200000", "rw-p", 2048, "[stack]"),
    ]
    assert full_mappings(smaps) == [
        Mapping(0x1000000, 0x1400000),
        Mapping(0x7F0000000000, 0x7F0000200000),
    ]


def test_a_mapping_that_is_mostly_not_in_memory_is_left_alone() -> None:
    assert full_mappings(_mapping("7f0000000000-7f0000200000", "rw-p", 1535)) == []
    assert full_mappings(_mapping("7f0000000000-7f0000200000", "rw-p", 1536)) != []


def test_what_is_not_told_in_smaps_words_is_passed_over() -> None:
    assert full_mappings(["", "nothing of the kind", "Rss: 4 kB"]) == []


def test_memory_holds_after_the_move_what_it_held_before() -> None:
    held = bytearray(random.Random(1).randbytes(4 * HUGE_BYTES))
    before = bytes(held)
    assert gather_memory() % HUGE_BYTES == 0
    assert held == before
