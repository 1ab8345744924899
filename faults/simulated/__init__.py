"""The campaign in virtual time: equal seeds make equal trials."""
