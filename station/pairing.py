"""Who may hold the lease: a code pairs one page, once, and the session that it gets may connect again (pure).

Nothing is stored: after a restart of the server, each page needs a new code.
"""

import hmac
from dataclasses import dataclass

CODE_LIFETIME_S = 60.0
MAX_WRONG_CODES = 5
"""After this many wrong codes, the present code is withdrawn."""
SESSION_LIFETIME_S = 12 * 3600.0
MAX_CONNECTIONS = 1000
"""Of one session, the first one included."""
MAX_SESSIONS = 8
"""A further one ends the oldest."""


@dataclass(eq=False, slots=True)
class Session:
    """A paired page; it is compared by identity."""

    token: str
    ends_s: float
    connections_left: int = MAX_CONNECTIONS - 1


class Pairing:
    """The present code and the sessions. All times are of one monotonic clock."""

    def __init__(self) -> None:
        self._code, self._code_ends_s, self._wrong_codes = "", 0.0, 0
        self._sessions: list[Session] = []

    def offer(self, code: str, now_s: float) -> None:
        """Accept this random code from now on, in the place of any earlier one."""
        self._code, self._code_ends_s, self._wrong_codes = code, now_s + CODE_LIFETIME_S, 0

    def has_code(self, now_s: float) -> bool:
        """Return whether a code would be accepted."""
        return self._code != "" and now_s <= self._code_ends_s

    def pair(self, code: str, token: str, now_s: float) -> Session | None:
        """Exchange the code for a session.

        Args:
            code: what the page sent.
            token: a new random token, for the session.
            now_s: the present time.

        Returns:
            the session; None if the code is wrong, was used, has expired or was withdrawn.
        """
        if not self.has_code(now_s):
            return None
        if not _equal(code, self._code):
            self._wrong_codes += 1
            if self._wrong_codes >= MAX_WRONG_CODES:
                self._code = ""
            return None
        self._code = ""
        session = Session(token, now_s + SESSION_LIFETIME_S)
        self._sessions = [*self._sessions, session][-MAX_SESSIONS:]
        return session

    def resume(self, token: str, now_s: float) -> Session | None:
        """Return the session of a page that connects again; None if it has ended or never existed."""
        for session in [one for one in self._sessions if _equal(token, one.token)]:
            session.connections_left -= 1
            if session.connections_left >= 0 and now_s <= session.ends_s:
                return session
            self._sessions.remove(session)
        return None


def _equal(given: str, wanted: str) -> bool:
    """Compare in constant time; a text of JSON may contain what no UTF-8 has."""
    return hmac.compare_digest(given.encode(errors="surrogatepass"), wanted.encode())
