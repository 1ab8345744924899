"""The marks of the system tests, for every folder whose tests import parts of them. pyproject.toml has those of all tests."""

import pytest

SMOKE = "smoke: the tests of a theme that a mistake breaks first; `make test` runs only these, `make system` all that need no idle machine"


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", SMOKE)
