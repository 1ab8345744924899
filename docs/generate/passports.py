"""The stored passports of docs/passports: for each robot a page with the signed record, and the certificate of the authority.

Nothing here needs a private key: a page is made again from the record that was signed.
"""

from pathlib import Path

from deploy.keys.signatures import envelope_of, payload_of, verify
from docs.generate import sections
from passport.page import inside_of, page
from passport.record import Passport
from passport.statement import record_in

FOLDER = sections.ROOT / "docs/passports"
DEMO, ROS2 = "demo", "ros2"


def page_of(robot: str) -> Path:
    return FOLDER / f"{robot}.html"


def certificate_of(robot: str) -> Path:
    return FOLDER / f"{robot}.pem"


def read(robot: str) -> tuple[Passport, str]:
    """Return the record of a robot, and its page as this version of Lifeline makes it.

    Raises:
        SignatureError: the record was not signed by a certificate of this authority.
    """
    inside = inside_of(page_of(robot).read_text())
    envelope = None if inside is None else envelope_of(inside)
    assert envelope is not None, "measure_passport.py signs each page"
    signer = verify(envelope, certificate_of(robot).read_bytes())
    record = record_in(payload_of(envelope))
    return record, page(record, envelope.model_dump_json(), f"{signer.name} ({signer.common_name})")
