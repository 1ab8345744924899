"""MQTT with paho through the broker mosquitto, QoS 0. The will of a client shows its end."""
# pyright: basic, reportMissingImports=false

import threading
from collections.abc import Callable
from typing import Any

import paho.mqtt.client as mqtt

COMMAND, OUTPUT, WILL = "peers/command", "peers/output", "peers/gone"


def _open(
    address: str, hears: str | None = None, heard: Callable[[bytes], None] | None = None
) -> mqtt.Client:
    """Connect and subscribe; return when the broker has confirmed it.

    Args:
        address: `tcp/HOST:PORT` of the broker.
        hears: the topic to subscribe to.
        heard: called with each payload.
    """
    host, _, port = address.removeprefix("tcp/").rpartition(":")
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
    if heard is None:
        client.will_set(WILL, b"")

    ready = threading.Event()

    def on_connect(*_: Any) -> None:  # noqa: ANN401 - paho's arguments
        if hears is None:
            ready.set()
        else:
            client.subscribe(hears, qos=0)

    def on_subscribe(*_: Any) -> None:  # noqa: ANN401 - paho's arguments
        ready.set()

    def on_message(_client: mqtt.Client, _data: object, message: mqtt.MQTTMessage) -> None:
        if heard is not None:
            heard(message.payload)

    client.on_connect, client.on_subscribe, client.on_message = on_connect, on_subscribe, on_message
    client.connect(host, int(port))
    client.loop_start()
    ready.wait()
    return client


def connect(address: str, role: str, heard: Callable[[bytes], None]) -> Callable[[bytes], None]:
    hears, says = (COMMAND, OUTPUT) if role == "relay" else (OUTPUT, COMMAND)
    client = _open(address, hears, heard)
    return lambda payload: (client.publish(says, payload, qos=0), None)[1]


def hold(address: str) -> None:
    _open(address)


def watch(address: str, lost: Callable[[], None]) -> None:
    _open(address, WILL, lambda _: lost())
