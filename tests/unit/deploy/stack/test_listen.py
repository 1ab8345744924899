"""The address of `--listen`, and the sentences if no server can listen there."""

import errno

import pytest

from deploy.stack.errors import DeployError
from deploy.stack.listen import bracketed, cannot_listen, is_loopback, parse_listen


@pytest.mark.parametrize(
    ("text", "address"),
    [("127.0.0.1:9464", ("127.0.0.1", 9464)), ("[::1]:1", ("::1", 1)), ("localhost:0", ("localhost", 0))],
)
def test_an_address_has_a_host_and_a_port(text: str, address: tuple[str, int]) -> None:
    assert parse_listen(text) == address


@pytest.mark.parametrize(
    "text", ["", "9464", ":9464", "localhost", "a:65536", "a:-1", "a:x", "::1:80", "a b:1"]
)
def test_another_form_of_address_is_refused_in_one_sentence(text: str) -> None:
    with pytest.raises(DeployError, match=r"is not an address: use HOST:PORT"):
        parse_listen(text)


def test_the_sentence_names_another_port_if_the_port_is_in_use_and_another_address_otherwise() -> None:
    in_use = str(cannot_listen("[::1]:80", errno.EADDRINUSE, "in use"))
    assert in_use == (
        "port 80 on ::1 is in use by another program: choose another port with --listen [::1]:PORT"
    )
    unknown = str(cannot_listen("nobody:80", None, "name not known"))
    assert unknown == (
        "cannot listen on nobody:80 (name not known): choose an address of this machine with --listen HOST:PORT"
    )


@pytest.mark.parametrize(
    ("host", "expected"),
    [
        ("127.0.0.1", True),
        ("127.255.255.254", True),
        ("::1", True),
        ("localhost", True),
        ("0.0.0.0", False),
        ("::", False),
        ("128.0.0.1", False),
        ("localhost.example", False),
    ],
)
def test_only_loopback_addresses_are_closed_to_other_machines(host: str, *, expected: bool) -> None:
    assert is_loopback(host) is expected


def test_an_ipv6_address_is_in_brackets() -> None:
    assert (bracketed("::1"), bracketed("127.0.0.1")) == ("[::1]", "127.0.0.1")
