"""The operator's link with real sockets. Both of its ends send numbered lines."""

import asyncio
import sys
from pathlib import Path

import pytest

from passport.child import Child
from passport.injection import CUTS

LIMIT_S = 30.0
SILENT_S = 0.3
"""A line that does not arrive for so long does not arrive; an order has an effect much earlier."""


class End:
    """One end of the link."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer

    def say(self, number: int) -> None:
        self._writer.write(f"{number}\n".encode())

    async def hear(self, limit_s: float = LIMIT_S) -> bytes | None:
        """Return the next line, empty at the end of the connection; None if none arrives."""
        try:
            return await asyncio.wait_for(self._reader.readline(), limit_s)
        except TimeoutError:
            return None

    def close(self) -> None:
        self._writer.transport.abort()


@pytest.mark.parametrize("order", CUTS.values())
async def test_a_direction_that_is_cut_carries_nothing_more_and_the_other_one_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, order: str
) -> None:
    monkeypatch.chdir(tmp_path)  # the path of a socket is short
    accepted: asyncio.Queue[End] = asyncio.Queue()

    async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        accepted.put_nowait(End(reader, writer))

    hub = await asyncio.start_unix_server(accept, "hub")
    link = Child([sys.executable, "-m", "passport.link", "hub"])
    ends: list[End] = []
    try:
        operator = End(*await asyncio.open_connection("127.0.0.1", int(await link.first_line())))
        ends.append(operator)
        robot = await asyncio.wait_for(accepted.get(), LIMIT_S)
        ends.append(robot)
        hears = {"up": robot, "down": operator}
        cut = [end for name, end in hears.items() if name in order.split()]
        carried = [end for end in hears.values() if end not in cut]

        for end in ends:
            end.say(0)
        assert [await end.hear() for end in ends] == [b"0\n", b"0\n"]
        link.order(order)
        number, found, clock = 0, list[bytes | None]([b""]), asyncio.get_running_loop().time
        end_s = clock() + LIMIT_S
        while (
            any(line is not None for line in found) and clock() < end_s
        ):  # it carries until it takes the order
            number += 1
            for end in ends:
                end.say(number)
            line = f"{number}\n".encode()
            assert [await end.hear() for end in carried] == [line] * len(carried)
            found = [await end.hear(SILENT_S) for end in cut]
            assert set(found) <= {line, None}
        assert found == [None] * len(cut)
        await link.end()
        assert {await end.hear() for end in ends} == {b""}  # what waited is lost
    finally:
        await link.end()
        for end in ends:
            end.close()
        hub.close()
