"""`lifeline keys`: an authority, and the certificates that it signs.

certificates.py    keys and certificates in PEM (pure but for its random keys); the only file that imports cryptography
register.py    which certificates were issued and which names are revoked, with the rules (pure)
folder.py      the files: authority, bundles and register, with their modes
commands.py    the commands and what they print
"""
