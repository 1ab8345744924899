"""`lifeline keys`: a certificate authority, and the certificates that it signs. Only `certificates.py` and `signatures.py` import cryptography."""
