"""Lines of Zenoh 1.10.2 about refused links, and their sentences. The system tests provoke them."""

import pytest

from wire.zenoh.link_trouble import Repeats, at_a_client, at_the_hub

CLIENT = "WARN zenoh::net::runtime::orchestrator: Unable to connect to "
TLS_HUB = "WARN acc-0 zenoh_link_tls::unicast: "
QUIC_HUB = "WARN acc-0 zenoh_link_commons::quic::unicast: QUIC acceptor failed: "
HINT = ". Hint: increase the system open file limit."
EXPIRED = "invalid peer certificate: certificate expired: verification time 1795573313 (UNIX), but certificate is not valid after 17955"
NOT_YET = "invalid peer certificate: certificate not valid yet: verification time 1795573312 (UNIX), but certificate is not valid before"
NAME = 'invalid peer certificate: certificate not valid for name "127.0.0.2"; certificate is only valid for DnsName("localhost")'
PURPOSE = "invalid peer certificate: certificate does not allow extended key usage for server authentication"


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (
            "tls/h:1! Can not create a new TLS link bound to h: invalid peer certificate: UnknownIssuer",
            "another authority",
        ),
        (
            "quic/h:1! the cryptographic handshake failed: error 51: invalid peer certificate: BadSignature",
            "another authority",
        ),
        (f"quic/h:1! the cryptographic handshake failed: error 45: {EXPIRED}", "certificate has expired"),
        (f"tls/h:1! Can not create a new TLS link: {NOT_YET}", "check the clocks"),
        (f"quic/h:1! Can not create a new QUIC link: {NAME}", "not for this host"),
        (f"tls/h:1! Can not create a new TLS link: {PURPOSE}", "not a supervisor"),
        ("tls/h:1! invalid peer certificate: UnknownRevocationStatus", "cannot be used"),
        ("tls/h:1! received fatal alert: CertificateExpired", "as expired or not valid yet"),
        ("tls/h:1! received fatal alert: DecryptError", "refuses this computer's certificate"),
        ("tls/h:1! received fatal alert: CertificateRequired", "refuses this computer's certificate"),
        ("quic/h:1! Read error on QUIC link 0.0.0.0:3 => h:1: connection lost", "its log has the reason"),
        ("quic/h:1! Write error on QUIC link 0.0.0.0:3 => h:1: Connection closed", "its log has the reason"),
        (
            "quic/h:1! handshake failed: error 120: peer doesn't support any known protocol",
            "mixed reliability",
        ),
        ("tls/h:1! Can not create a new TLS link bound to h: tls handshake eof", "does not accept TLS"),
    ],
)
def test_a_client_learns_why_it_is_refused(line: str, says: str) -> None:
    assert says in str(at_a_client(CLIENT + line))


@pytest.mark.parametrize(
    "line",
    [
        "quic/h:1! deadline has elapsed at zenoh-transport/src/unicast/manager.rs:901",
        "tls/h:1! Can not create a new TLS link bound to h: [h:1: Connection refused (os error 111)]",
        "any of [Single(tls/h:1)]!",
        "tls/h:1! failed to lookup address information: Name or service not known",
    ],
)
def test_a_supervisor_that_does_not_run_is_no_refusal(line: str) -> None:
    assert at_a_client(CLIENT + line) is None


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (
            f"{TLS_HUB}invalid peer certificate: UnknownIssuer{HINT}",
            "refused: its certificate is from another authority",
        ),
        (
            f'{QUIC_HUB}TransportError(Error {{ reason: "invalid peer certificate: BadSignature" }})',
            "another authority",
        ),
        (f"{TLS_HUB}{EXPIRED}{HINT}", "refused: its certificate has expired"),
        (
            f'{QUIC_HUB}TransportError(Error {{ code: Code::crypto(2d), reason: "{EXPIRED}" }})',
            "refused: its certificate has exp",
        ),
        (f"{TLS_HUB}{NOT_YET}{HINT}", "refused: its certificate is not valid yet"),
        (f"{TLS_HUB}invalid peer certificate: BadEncoding{HINT}", "refused: its certificate cannot be used"),
        (f"{TLS_HUB}peer sent no certificates{HINT}", "refused: it has no certificate"),
        (
            f'{QUIC_HUB}TransportError(Error {{ reason: "peer sent no certificates" }})',
            "refused: it has no certificate",
        ),
        (
            f"{TLS_HUB}received corrupt message of type InvalidContentType{HINT}",
            "refused: it does not use TLS",
        ),
        (
            f'{QUIC_HUB}TransportError(Error {{ reason: "peer doesn\'t support any known protocol" }})',
            "mixed reliability",
        ),
        (
            f"{TLS_HUB}received fatal alert: UnknownCA{HINT}",
            "does not accept the supervisor's certificate: its bundle",
        ),
        (
            f'{QUIC_HUB}ConnectionClosed(ConnectionClose {{ reason: b"invalid peer certificate: UnknownIssuer" }})',
            "its bundle",
        ),
        (f"{TLS_HUB}received fatal alert: CertificateExpired{HINT}", "by the client's clock"),
        (f'{QUIC_HUB}ConnectionClosed(ConnectionClose {{ reason: b"{EXPIRED}" }})', "by the client's clock"),
        (f"{TLS_HUB}received fatal alert: BadCertificate{HINT}", "not for the host"),
        (f"{QUIC_HUB}ConnectionClosed(ConnectionClose {{ reason: b'{NAME}' }})", "not for the host"),
        (
            f"{TLS_HUB}received fatal alert: UnsupportedCertificate{HINT}",
            "does not accept the supervisor's certificate",
        ),
        (
            "WARN zenoh_link_commons: Closing TLS link a => b : remote certificate chain expired",
            "its link is closed",
        ),
    ],
)
def test_the_supervisor_says_why_a_client_is_refused(line: str, says: str) -> None:
    assert says in str(at_the_hub(line))


def test_other_lines_are_about_something_else() -> None:
    assert (
        at_the_hub("WARN zenoh::net::routing::hat::peer: Gossip is disabled: cannot de-duplicate data")
        is None
    )
    assert at_the_hub("Can not accept TLS connections: Too many open files") is None


def test_a_sentence_passes_once_in_a_period() -> None:
    repeats = Repeats(30.0)
    assert repeats.is_new("a", 100.0)
    assert not repeats.is_new("a", 129.9)
    assert repeats.is_new("b", 129.9)
    assert repeats.is_new("a", 130.0)
    assert not repeats.is_new("a", 159.9)
