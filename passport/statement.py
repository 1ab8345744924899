"""The statement that is signed: an in-toto statement whose predicate is the record. Pure."""

import hashlib
import json

from passport.record import Passport, from_json
from wire import foreign
from wire.foreign import ForeignError

TYPE = "https://in-toto.io/Statement/v1"
PREDICATE = "https://lifeline.invalid/stop-time-passport/v1"
"""Names the kind of the predicate; nothing is fetched from there."""


def digest(passport: Passport) -> str:
    """Return the SHA-256 of the record's JSON text: what the paper shows too."""
    return hashlib.sha256(passport.to_json().encode()).hexdigest()


def statement_of(passport: Passport) -> bytes:
    """Return the statement as JSON."""
    subject = {"name": passport.robot, "digest": {"sha256": digest(passport)}}
    statement = {
        "_type": TYPE,
        "subject": [subject],
        "predicateType": PREDICATE,
        "predicate": json.loads(passport.to_json()),
    }
    return json.dumps(statement).encode()


def record_in(statement: bytes) -> Passport:
    """Return the record of a statement.

    Raises:
        ForeignError: it is no such statement, or its digest is that of another record.
    """
    found = foreign.from_json(statement.decode("utf-8", "replace"))
    if not isinstance(found, dict) or found.get("_type") != TYPE or found.get("predicateType") != PREDICATE:
        raise ForeignError("it is not the statement of a passport")
    passport = from_json(json.dumps(found.get("predicate")))
    if found.get("subject") != [{"name": passport.robot, "digest": {"sha256": digest(passport)}}]:
        raise ForeignError("its digest is that of another record")
    return passport
