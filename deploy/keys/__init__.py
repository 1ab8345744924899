"""`lifeline keys`: a certificate authority, and the certificates that it signs. Only `certificates.py` imports cryptography."""
