"""Token of the clients of a server."""

from __future__ import annotations

import hmac
import os
import re
import secrets

from digiclay.core.base.errors import OutputError

#: Environment variable with the token.
VARIABLE = "DIGICLAY_SERVE_TOKEN"
#: What stands in an address and in a header without quotes.
ALLOWED = re.compile(r"[A-Za-z0-9._~-]{8,128}")


def choose_token(given: str | None) -> tuple[str, bool]:
    """Return the token, and whether it was made just now: from the option, the environment, or at random.

    Raises OutputError when a given one is none.
    """
    token, source = (given, "--token") if given is not None else (os.environ.get(VARIABLE), VARIABLE)
    if token is None:
        return secrets.token_urlsafe(18), True
    if not ALLOWED.fullmatch(token):
        # The token itself is not shown: messages are kept in logs.
        rule = "must have 8 to 128 letters, digits or . _ ~ -"
        raise OutputError(f"{source} {rule} (got {len(token)} characters).")
    return token, False


def is_token(given: object, token: str) -> bool:
    """Return whether a client's token is the right one, in a time that does not depend on where it differs.

    `given`: from the client; `token`: the server's.
    """
    return isinstance(given, str) and hmac.compare_digest(given.encode("utf-8", "replace"), token.encode())
