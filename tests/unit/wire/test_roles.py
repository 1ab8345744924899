"""Common names of certificates: the role and the robot."""

import pytest

from wire.roles import ANY, Role, common_name, role_of


@pytest.mark.parametrize("role", Role)
@pytest.mark.parametrize("namespace", ["robot", "r7", ANY])
def test_a_common_name_has_the_role_and_the_namespace(role: Role, namespace: str) -> None:
    name = common_name(role, namespace)
    assert name == f"{role.value}@{namespace}"
    assert role_of(name) == (role, namespace)


@pytest.mark.parametrize("name", ["", "operator", "operator@", "@robot", "root@robot", "Operator@robot"])
def test_any_other_common_name_has_no_role(name: str) -> None:
    assert role_of(name) is None


def test_the_longest_common_name_fits_into_a_certificate() -> None:
    """X.509 permits 64 characters, and a namespace has at most 32 (wire/host/config.py)."""
    assert max(len(common_name(role, "n" * 32)) for role in Role) <= 64
