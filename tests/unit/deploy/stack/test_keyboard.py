"""The terminal of a typed teleop answers each status request once, and its last output is read."""

import os
import pty

from hypothesis import given
from hypothesis import strategies as st

from deploy.stack.keyboard import REQUEST, SCREEN_BYTES, Screen, requests_in

PIECES = st.sampled_from([REQUEST, b"\x1b[5", b"\x1b[5;1H", b"n", b"picture", b"\x1b"])


@given(pieces=st.lists(PIECES, max_size=12), sizes=st.lists(st.integers(1, 9), min_size=1))
def test_each_status_request_is_found_once_however_the_output_is_divided(
    pieces: list[bytes], sizes: list[int]
) -> None:
    output, found, unread, at = b"".join(pieces), 0, b"", 0
    for number in range(len(output)):
        size = sizes[number % len(sizes)]
        requests, unread = requests_in(unread + output[at : at + size])
        found, at = found + requests, at + size
    assert found == output.count(REQUEST)


async def test_what_a_program_printed_last_is_read_even_if_the_event_loop_has_not_run_since() -> None:
    terminal, program_side = pty.openpty()
    screen = Screen(terminal, lambda _: None)
    os.write(program_side, b"x" * (SCREEN_BYTES - 1) + b"\nno keyboard\n")
    assert screen.last_lines.endswith(" | no keyboard")
    screen.close()
    os.close(program_side)
    assert screen.last_lines.endswith(" | no keyboard")
