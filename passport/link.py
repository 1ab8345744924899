"""`python -m passport.link SOCKET PID`: the operator's link to the hub, of which each direction can be cut.

It prints the port at which it listens on the loopback interface. A line of its stdin names the directions to cut: `up`, toward the hub, and `down`.
What is sent in a direction that is cut waits in buffers, as behind a cable that is pulled; not even the end of a connection passes. It ends with its stdin.
"""

import asyncio
import sys
from contextlib import suppress

from passport.child import die_with_parent

CHUNK_BYTES = 1 << 16


async def _main(hub: str) -> None:
    cut = set[str]()

    async def carry(direction: str, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):  # one side is gone
            while (data := await reader.read(CHUNK_BYTES)) and direction not in cut:
                writer.write(data)
                await writer.drain()
        if direction in cut:
            await asyncio.Event().wait()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            hub_reader, hub_writer = await asyncio.open_unix_connection(hub)
        except OSError:
            writer.close()
            return
        carrying = {
            asyncio.ensure_future(carry("up", reader, hub_writer)),
            asyncio.ensure_future(carry("down", hub_reader, writer)),
        }
        _, others = await asyncio.wait(carrying, return_when=asyncio.FIRST_COMPLETED)
        for side in (writer, hub_writer):
            side.transport.abort()
        for other in others:
            other.cancel()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    print(server.sockets[0].getsockname()[1], flush=True)
    while line := await asyncio.to_thread(sys.stdin.readline):
        cut.update(line.split())


if __name__ == "__main__":
    _, socket_path, pid = sys.argv
    die_with_parent(int(pid))
    asyncio.run(_main(socket_path))
