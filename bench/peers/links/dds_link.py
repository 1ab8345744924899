"""CycloneDDS, reliable and volatile, over loopback. The address is a domain."""
# pyright: basic, reportMissingImports=false

from collections.abc import Callable
from dataclasses import dataclass

from cyclonedds.core import Listener, Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, uint8
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from bench.peers.links import PAYLOAD_BYTES

CONFIG = """<CycloneDDS><Domain><General>
<Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces><AllowMulticast>false</AllowMulticast>
</General><Discovery><ParticipantIndex>auto</ParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>"""
_kept: list[object] = []
"""CycloneDDS ends what is no longer referenced."""


@dataclass
class Message(IdlStruct, typename="Message"):  # pyright: ignore[reportGeneralTypeIssues, reportCallIssue]
    """A payload."""

    data: array[uint8, PAYLOAD_BYTES]  # pyright: ignore[reportInvalidTypeForm]


class _Heard(Listener):
    def __init__(self, heard: Callable[[bytes], None]) -> None:
        super().__init__()
        self._heard = heard

    def on_data_available(self, reader: DataReader) -> None:
        for message in reader.take(N=16):
            if isinstance(message, Message):
                self._heard(bytes(message.data))


def _qos() -> Qos:
    return Qos(
        Policy.Reliability.Reliable(duration(milliseconds=100)),
        Policy.Durability.Volatile,
        Policy.History.KeepLast(1),
    )


def connect(address: str, role: str, heard: Callable[[bytes], None]) -> Callable[[bytes], None]:
    hears, says = ("command", "output") if role == "relay" else ("output", "command")
    _kept.append(Domain(int(address), CONFIG))
    participant = DomainParticipant(int(address))
    writer = DataWriter(participant, Topic(participant, says, Message), _qos())
    _kept.append(DataReader(participant, Topic(participant, hears, Message), _qos(), listener=_Heard(heard)))
    return lambda payload: writer.write(Message(data=list(payload)))
