"""Which reduction of a linearisation is believed: by rows that hold or by the pencil, in double precision or beyond.

The pencil's determinant (`witness.py`) says of linear equations how many modes there are and what their product is; a
reduction that it contradicts is made anew with states chosen in many digits, and refused where that is of no use.

Receives a `Given` and the pencil of the form as written.  Hands on a `Reduced`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from sysdyn.runtime.linear import precise
from sysdyn.runtime.linear.modes import modes
from sysdyn.runtime.linear.pencil import Descriptor, motions, surely_parted, widely_parted
from sysdyn.runtime.linear.precise import Values
from sysdyn.runtime.linear.states import candidates_of, chosen_states
from sysdyn.runtime.linear.tangent import Given, NoLinearisation, Reduced, describe_lost, reduce, widely_reduced
from sysdyn.runtime.linear.witness import CONTRAST, Witness, agrees, spread, witness

COUNTED = 200
"""Unknowns up to which the states are counted twice."""


def reduce_witnessed(given: Given, pencil: Descriptor | None, *, fixed: bool) -> Reduced:
    """The reduction; of linear equations (fixed) one that the pencil's determinant does not contradict; pencil: of the
    form as written, where it holds too (at rest, or fixed).  NoLinearisation.
    """
    small, why = None, None
    try:
        small = _reduce(given, pencil)
    except NoLinearisation as error:
        why = error
    seen = witness(pencil.e, pencil.a) if fixed and pencil is not None else None
    # the determinant contradicts, or there is nothing yet
    if seen is not None and pencil is not None and (small is None or seen.contradicts(_values(small))):
        # certain: so many states in many digits
        if seen.certain:
            small = _in_many_digits(given, pencil, seen.states)
            lasting = small is not None and not seen.contradicts(_values(small))
        # uncertain: whichever reduction agrees with the determinant
        else:
            other = _chosen_in_many_digits(given)
            held = [part for part in (small, other) if part is not None and agrees(pencil.e, pencil.a, _values(part))]
            # entries of like sizes leave no doubt of the first one
            doubtful = spread(pencil.e, pencil.a) > CONTRAST or not _singular(pencil)
            small, lasting = held[0] if held else small, bool(held) or not doubtful
        if not lasting:
            raise why or _describe_contradiction(seen)
    # no reduction held: why it failed
    if small is None:
        assert why is not None
        raise why
    return small


def _reduce(given: Given, pencil: Descriptor | None) -> Reduced:
    """The reduction by the rows that hold, or by the pencil where that holds too and knows more.  NoLinearisation."""
    small = None
    try:
        # rows that hold, constraints differentiated
        small = reduce(given)
    except NoLinearisation:
        if pencil is None:
            raise
    # constraints hidden deeper, or other states: by the pencil
    if pencil is not None and (small is None or _fewer(given, small)):
        small = _of_pencil(given, pencil)
    assert small is not None
    if small.unsure is not None and pencil is not None:  # the pencil may know it better
        small = _surer(small, given, pencil)
    # modes that double precision does not hold are refused
    if small.unsure is not None:
        precise.refuse_lost(precise.eigenvalues(small.a), precise.eigenvalues(small.unsure), describe_lost)
    return small


def _chosen_in_many_digits(given: Given) -> Reduced | None:
    """The reduction by the rows that hold, its states chosen in many digits; None where there is none."""
    try:
        return widely_reduced(given)
    except NoLinearisation:
        return None


def _in_many_digits(given: Given, form: Descriptor, states: int) -> Reduced | None:
    """The reduction of the pencil with its states chosen in many digits; None where it is too large for that."""
    system, n, loose = given.system, given.system.form.written, given.loose
    known = candidates_of(system, given.state, n)
    shown = system.kinds[known] == "q"
    # displacements first, then what moves beside them, what is loose last
    groups = (known[shown & ~loose[known]], known[~shown & ~loose[known]], known[loose[known]])
    matrices = (form.e, form.a, form.b, form.c, form.cd, form.d)
    try:
        small = widely_parted(matrices, (*groups, np.arange(n, len(form.states))), states)
    except NoLinearisation:
        return None
    # too large, or singular
    if small is None:
        return None
    names = tuple(form.states[int(k)] for k in small.places)
    # integrals of inputs stand behind the unknowns: no places of the model
    return replace(small, names=names, places=np.where(small.places < n, small.places, -1))


def _of_pencil(given: Given, form: Descriptor) -> Reduced:
    """The reduction where constraints are hidden deeper than rows are differentiated: by the pencil itself."""
    system = given.system
    spaces = motions(form.e, form.a)
    n = system.form.written
    # states of the form, and integrals of inputs behind them
    known = candidates_of(system, given.state, n)
    extra = np.arange(n, len(form.states))
    chosen = np.concatenate([chosen_states(system, spaces[0], spaces[2], known, given.loose), extra])
    chosen = chosen[: spaces[0].shape[1]]
    names = tuple(form.states[int(k)] for k in chosen)
    matrices = (form.e, form.a, form.b, form.c, form.cd, form.d)
    small = surely_parted(matrices, chosen, spaces, names)
    return replace(small, places=np.where(small.places < n, small.places, -1))


def _surer(small: Reduced, given: Given, form: Descriptor) -> Reduced:
    """The reduction of the pencil, where it is one in many digits with as many states."""
    try:
        other = _of_pencil(given, form)
    except NoLinearisation:
        return small
    # in many digits and of as many states
    return other if other.wide is not None and other.places.size == small.places.size else small


def _fewer(given: Given, small: Reduced) -> bool:
    """Whether the pencil, in the unit of time in which its ranks are plainest, has another number of states."""
    y, yd = given.state.for_form(given.system)
    jy, jyd = given.system.jacobian(given.state.t, y, yd)
    # of a large model the pencil is not asked
    if given.system.unknowns > COUNTED:
        return False
    try:
        space = motions(given.system.dense(jyd), -given.system.dense(jy))[0]
    except NoLinearisation:
        return False
    return int(space.shape[1]) != int((small.places >= 0).sum())


def _singular(form: Descriptor) -> bool:
    """Whether the pencil leaves unknowns open, in double precision."""
    try:
        motions(form.e, form.a)
    except NoLinearisation:
        return True
    return False


def _values(small: Reduced) -> Values:
    return np.array([mode.eigenvalue for mode in modes(small.a, small.decomposed)], dtype=np.complex128)


def _describe_contradiction(seen: Witness) -> NoLinearisation:
    """What is said where the modes found are not those of the equations."""
    cause = "the modes found are not those of the equations"
    # round-off of the entries themselves decides
    if not seen.certain:
        cause = "the entries of the equations, rounded, do not hold all modes"
    return NoLinearisation(
        f"{cause}: sizes of elements are too many decades apart; another --formulation may hold them, "
        "or leave out the elements whose time constants are farthest from the rest"
    )
