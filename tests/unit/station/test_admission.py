"""Requests that name another server, or come from another page, are refused."""

import pytest

from station.admission import RESPONSE_HEADERS, Address

HERE = Address("http", ("127.0.0.1", "localhost"), 8470)
OPEN = Address("https", ("robot7", "192.168.1.7", "[fe80::1]"), 8470)


def headers(host: str | None, origin: str | None = None) -> list[tuple[bytes, bytes]]:
    named = [] if host is None else [(b"host", host.encode())]
    return [(b"accept", b"*/*"), *named, *([] if origin is None else [(b"origin", origin.encode())])]


@pytest.mark.parametrize("host", ["127.0.0.1:8470", "localhost:8470", "LOCALHOST:8470"])
def test_a_request_to_this_server_is_admitted(host: str) -> None:
    assert HERE.admits(headers(host), needs_origin=False)
    assert HERE.admits(headers(host, f"http://{host}"), needs_origin=True)


@pytest.mark.parametrize(
    "host", [None, "", "evil.example", "evil.example:8470", "127.0.0.1", "127.0.0.1:8471", "localhost.:8470"]
)
def test_a_request_that_names_another_server_is_refused(host: str | None) -> None:
    assert not HERE.admits(headers(host), needs_origin=False)
    assert not HERE.admits(headers(host, "http://127.0.0.1:8470"), needs_origin=True)


@pytest.mark.parametrize(
    "origin",
    [
        "null",
        "http://evil.example",
        "https://127.0.0.1:8470",
        "http://127.0.0.1",
        "http://127.0.0.1:8470/",
        "http://127.0.0.1:8470.evil.example",
    ],
)
def test_a_request_of_another_page_is_refused(origin: str) -> None:
    assert not HERE.admits(headers("127.0.0.1:8470", origin), needs_origin=False)
    assert not HERE.admits(headers("127.0.0.1:8470", origin), needs_origin=True)


def test_a_websocket_without_an_origin_is_refused() -> None:
    assert not HERE.admits(headers("127.0.0.1:8470"), needs_origin=True)


def test_a_header_that_comes_twice_is_refused() -> None:
    once = headers("127.0.0.1:8470", "http://127.0.0.1:8470")
    assert not HERE.admits([*once, (b"host", b"127.0.0.1:8470")], needs_origin=True)
    assert not HERE.admits([*once, (b"origin", b"http://127.0.0.1:8470")], needs_origin=True)


def test_the_open_page_is_reached_by_the_hosts_of_its_certificate() -> None:
    for host in OPEN.hosts:
        assert OPEN.admits(headers(f"{host}:8470", f"https://{host}:8470"), needs_origin=True)
    assert not OPEN.admits(headers("127.0.0.1:8470"), needs_origin=False)


def test_the_code_is_in_the_fragment_of_the_printed_address() -> None:
    assert OPEN.url("secret") == "https://robot7:8470/#secret"


def test_a_response_permits_only_scripts_styles_and_connections_of_this_server() -> None:
    policy = dict(part.split(" ", 1) for part in RESPONSE_HEADERS["content-security-policy"].split("; "))
    assert policy == {
        "default-src": "'none'",
        "script-src": "'self'",
        "style-src": "'self'",
        "connect-src": "'self'",
        "base-uri": "'none'",
        "form-action": "'none'",
        "frame-ancestors": "'none'",
    }
