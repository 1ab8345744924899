"""Component tests run one service on a perfect network and a virtual clock: time jumps, nothing sleeps."""

import asyncio
from collections.abc import Callable, Mapping

import pytest

from virtual.loop import VirtualLoop


def pytest_asyncio_loop_factories(
    config: pytest.Config, item: pytest.Item
) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    """Give every test here a virtual clock."""
    return {"virtual": VirtualLoop}
