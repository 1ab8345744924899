"""The terminal of a typed teleop answers each status request once."""

from hypothesis import given
from hypothesis import strategies as st

from deploy.stack.keyboard import REQUEST, requests_in

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
