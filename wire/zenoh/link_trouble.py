"""Zenoh's log lines about refused certificates, as sentences (pure).

Zenoh reports why a link was refused only there: neither the error of `zenoh.open` nor an event has the reason. The phrases
are those of rustls and quinn. A line without one of them is about something else, such as a supervisor that does not run.
"""

import re
from collections.abc import Sequence

LOG_FILTER = "off,zenoh_link_tls=warn,zenoh_link_commons=warn,zenoh::net::runtime=warn"
"""The parts of Zenoh's log that have these lines, in the notation of RUST_LOG."""

ISSUE = "`lifeline keys issue NAME`"
OTHER_AUTHORITY = "invalid peer certificate: (UnknownIssuer|BadSignature)"
EXPIRED = "invalid peer certificate: (certificate expired|Expired)"
NOT_YET = "invalid peer certificate: (certificate not valid yet|NotValidYet)"
OTHER_NAME = "invalid peer certificate: (certificate not valid for name|NotValidForName)"
OTHER_PURPOSE = "invalid peer certificate: (.*extended key usage|InvalidPurpose)"

AT_A_CLIENT = (
    (
        OTHER_AUTHORITY,
        "the supervisor's certificate is from another authority: copy a bundle of its authority to this computer",
    ),
    (
        EXPIRED,
        f"the supervisor's certificate has expired: issue a new one with {ISSUE} and restart the supervisor",
    ),
    (NOT_YET, "the supervisor's certificate is not valid yet: check the clocks of both computers"),
    (
        OTHER_NAME,
        "the supervisor's certificate is not for this host: issue it with `lifeline keys issue NAME --host HOST` and restart the supervisor",
    ),
    (OTHER_PURPOSE, "the other side is not a supervisor: its certificate has another role"),
    (
        "invalid peer certificate",
        f"the supervisor's certificate cannot be used: issue a new one with {ISSUE}",
    ),
    (
        "fatal alert: CertificateExpired",
        "the supervisor refuses this computer's certificate as expired or not valid yet: check the clocks of both computers",
    ),
    (
        "fatal alert: (UnknownCA|DecryptError|BadCertificate|CertificateUnknown|UnsupportedCertificate|CertificateRequired)",
        "the supervisor refuses this computer's certificate: copy a bundle of its authority to this computer",
    ),
    # Over QUIC, the reason of a refusal by the supervisor does not reach the client.
    (
        "on QUIC link .*(connection lost|Connection closed)",
        "the supervisor refuses the link: its log has the reason, such as a certificate of another authority",
    ),
    ("known protocol", "what listens there does not accept Zenoh over QUIC with mixed reliability"),
    (
        "InvalidContentType|fatal alert|handshake eof",
        "what listens there does not accept TLS with these certificates",
    ),
)
CLIENT_REFUSES = "(fatal alert: |ConnectionClosed.*)"
AT_THE_HUB = (
    ("remote certificate chain expired", "the certificate of a client has expired: its link is closed"),
    (
        f"{CLIENT_REFUSES}(UnknownCA|DecryptError|UnknownIssuer|BadSignature)",
        "a client does not accept the supervisor's certificate: its bundle is from another authority",
    ),
    (
        f"{CLIENT_REFUSES}(CertificateExpired|expired|not valid yet)",
        "a client does not accept the supervisor's certificate: by the client's clock, it has expired or is not valid yet",
    ),
    (
        f"{CLIENT_REFUSES}(BadCertificate|not valid for name)",
        "a client does not accept the supervisor's certificate: it is not for the host to which the client connects",
    ),
    ("fatal alert|ConnectionClosed", "a client does not accept the supervisor's certificate"),
    (OTHER_AUTHORITY, "a client was refused: its certificate is from another authority"),
    (EXPIRED, "a client was refused: its certificate has expired"),
    (NOT_YET, "a client was refused: its certificate is not valid yet; check the clocks of both computers"),
    ("invalid peer certificate", "a client was refused: its certificate cannot be used"),
    ("peer sent no certificates", "a client was refused: it has no certificate"),
    ("InvalidContentType", "a client was refused: it does not use TLS"),
    ("known protocol", "a client was refused: it does not use Zenoh over QUIC with mixed reliability"),
)


def at_a_client(line: str) -> str | None:
    """Return why a client cannot connect; None if the line is about something else."""
    return _sentence(line, AT_A_CLIENT)


def at_the_hub(line: str) -> str | None:
    """Return why a link was refused or closed at the hub; None if the line is about something else."""
    return _sentence(line, AT_THE_HUB)


def _sentence(line: str, table: Sequence[tuple[str, str]]) -> str | None:
    return next((sentence for phrase, sentence in table if re.search(phrase, line)), None)


class Repeats:
    """Lets each sentence pass once in a period: a refused client tries again every 0.1 s."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._said_s: dict[str, float] = {}

    def is_new(self, sentence: str, now_s: float) -> bool:
        """Return whether the sentence has not passed within the last period."""
        last_s = self._said_s.get(sentence)
        if last_s is not None and now_s - last_s < self._period_s:
            return False
        self._said_s[sentence] = now_s
        return True
