"""Who may hold the lease: a code pairs one page, once, and the session that it gets may connect again (pure).

A wrong code has no effect: if some withdrew the present code, a stranger could keep every page away. A code of 59 bits that is
valid for a minute cannot be guessed.

Nothing is stored: after a restart of the server, each page needs a new code.
"""

import hmac
from collections.abc import Collection
from dataclasses import dataclass

CODE_LIFETIME_S = 60.0
SESSION_LIFETIME_S = 12 * 3600.0
MAX_SESSIONS = 8
"""More than pages may be connected. A further one ends the oldest whose page is not connected."""


@dataclass(eq=False, slots=True)
class Session:
    """A paired page; it is compared by identity."""

    token: str
    ends_s: float
    name: str = ""
    """The name of the person, as the page reports it; empty: unknown."""
    is_pressed: bool = False
    """Whether the press of this page is recorded and not released."""


class Pairing:
    """The present code and the sessions. All times are of one monotonic clock."""

    def __init__(self) -> None:
        self._code, self._code_ends_s = "", 0.0
        self._sessions: list[Session] = []

    def offer(self, code: str, now_s: float) -> None:
        """Accept this random code from now on, in the place of any earlier one."""
        self._code, self._code_ends_s = code, now_s + CODE_LIFETIME_S

    def pair(
        self, code: str, token: str, now_s: float, connected: Collection[Session] = ()
    ) -> Session | None:
        """Exchange the code for a session.

        Args:
            code: what the page sent.
            token: a new random token, for the session.
            now_s: the present time.
            connected: the sessions whose pages are connected, fewer than `MAX_SESSIONS`.

        Returns:
            the session; None if the code is wrong, was used or has expired.
        """
        if self._code == "" or now_s > self._code_ends_s or not _equal(code, self._code):
            return None
        self._code = ""
        if len(self._sessions) >= MAX_SESSIONS:
            self._sessions.remove(next(one for one in self._sessions if one not in connected))
        session = Session(token, now_s + SESSION_LIFETIME_S)
        self._sessions.append(session)
        return session

    def resume(self, token: str, now_s: float) -> Session | None:
        """Return the session of a page that connects again; None if it has ended or never existed."""
        for session in [one for one in self._sessions if _equal(token, one.token)]:
            if now_s <= session.ends_s:
                return session
            self._sessions.remove(session)
        return None


def _equal(given: str, wanted: str) -> bool:
    """Compare in constant time; a text of JSON may contain what no UTF-8 has."""
    return hmac.compare_digest(given.encode(errors="surrogatepass"), wanted.encode())
