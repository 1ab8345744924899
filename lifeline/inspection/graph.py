"""`lifeline graph`: which nodes communicate, measured from the sessions at the hub."""

import json
from pathlib import Path
from typing import NoReturn

from deploy.stack.errors import DeployError
from deploy.stack.formatting import number
from deploy.stack.launch import Launch
from lifeline.inspection.listening import Robot, inspect
from lifeline.inspection.wiring import Wire, dot_of, svg_of, text_of, wires_of
from wire.host.extras import require

SUFFIXES = (".svg", ".png", ".dot")


def show_graph(launch: Launch, out: Path | None, seconds: float, *, as_json: bool) -> NoReturn:
    """Print the graph, or write it to a file.

    Raises:
        DeployError: the file's type is not supported.
    """
    if out is not None and out.suffix not in SUFFIXES:
        raise DeployError(f"cannot draw {out}: choose a file that ends with {', '.join(SUFFIXES)}")
    if out is not None and out.suffix == ".png":
        require("sim")  # Pillow

    async def body(robot: Robot) -> int:
        traffic, nodes = await robot.traffic(seconds), await robot.nodes()
        names = [node.name for node in nodes]
        wires = wires_of(nodes, traffic, robot.namespace)
        if out is not None:
            _write(out, names, wires, f"{robot.namespace} at {launch.bus.endpoint}")
        if as_json:
            print(json.dumps(_to_json(names, wires), indent=2))
        elif out is None:
            print(text_of(names, wires))
        else:
            print(f"lifeline: {out}: {len(names)} nodes, {len(wires)} topics")
        return 0

    inspect(launch, body)


def _to_json(names: list[str], wires: list[Wire]) -> list[dict[str, object]]:
    return [
        {
            "key": wire.key,
            "writer": None if wire.writer is None else names[wire.writer],
            "readers": [names[n] for n in wire.readers],
            "rate_hz": number(wire.rate_hz),
        }
        for wire in wires
    ]


def _write(out: Path, names: list[str], wires: list[Wire], title: str) -> None:
    try:
        if out.suffix == ".png":
            from lifeline.inspection.graph_picture import png_of  # noqa: PLC0415 - Pillow is in an extra

            out.write_bytes(png_of(names, wires))
        else:
            out.write_text(dot_of(names, wires) if out.suffix == ".dot" else svg_of(names, wires, title))
    except OSError as error:
        raise DeployError(f"cannot write {out} ({error.strerror}): choose another file") from error
