"""These tests run on a virtual clock, like the component tests."""

from tests.component.conftest import pytest_asyncio_loop_factories

__all__ = ["pytest_asyncio_loop_factories"]
