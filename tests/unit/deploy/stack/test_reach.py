"""Endpoints on this machine and on others."""

import asyncio
from typing import NoReturn

import pytest

from deploy.stack import reach
from deploy.stack.errors import DeployError
from deploy.stack.reach import NotRunningError, silence_of
from wire.bus_config import BusConfig

NOT_HERE = "198.51.100.1"
"""An address for documentation (RFC 5737), which no machine has."""


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "0.0.0.0", "[::1]"])
def test_of_an_endpoint_on_this_machine_nothing_is_said(host: str) -> None:
    assert silence_of(f"tcp/{host}:7447") is None


@pytest.mark.parametrize("name", ["robot7.invalid", f"{'a' * 64}.invalid"])
def test_a_name_that_cannot_be_resolved_is_named(name: str) -> None:
    assert silence_of(f"quic/{name}:7447") == f"the name {name} of the endpoint cannot be resolved"


def test_an_address_of_another_machine_is_recognised() -> None:
    endpoint = f"quic/{NOT_HERE}:7447?mixed_rel=1"
    assert silence_of(endpoint) == f"nothing answers at {endpoint}, which is on another machine"


@pytest.mark.parametrize(
    ("refused", "kind"), [("a certificate is refused", DeployError), (None, NotRunningError)]
)
async def test_where_nobody_answers_in_time_a_refused_certificate_is_named_first(
    monkeypatch: pytest.MonkeyPatch, refused: str | None, kind: type[DeployError]
) -> None:
    async def never(*_: object, **__: object) -> NoReturn:
        await asyncio.Event().wait()
        raise AssertionError

    async def refusal(_: BusConfig) -> str | None:
        return refused

    monkeypatch.setattr(reach, "CONNECT_LIMIT_S", 0.0)
    monkeypatch.setattr(reach, "open_bus", never)
    monkeypatch.setattr(reach, "refusal", refusal)
    with pytest.raises(DeployError, match=refused or "no supervisor answers") as caught:
        await reach.reach(BusConfig(), asyncio.Event())
    assert type(caught.value) is kind
