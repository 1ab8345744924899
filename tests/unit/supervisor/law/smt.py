"""Statements over all real numbers in SMT-LIB, decided by z3."""

import z3


def decided(statement: str) -> str:
    """Return z3's answer to a statement: sat, unsat or unknown."""
    solver = z3.Solver()
    solver.from_string(statement)
    return str(solver.check())


def reals(names: str) -> str:
    """Declare real numbers; their names are separated by spaces."""
    return "".join(f"(declare-const {name} Real)" for name in names.split())
