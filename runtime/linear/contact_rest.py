"""States of rest of models with constraints that hold at times (inequalities, guards, dry friction) and samples.

Complementarity over the equations of rest (see rest.py): of those that hold no multiplier pulls, of those that do not
no value is below zero, and dry friction sticks wherever its bound allows; principal pivoting as at a start
(events/pivoting.py).

Where a sampled action would change something a state is none of rest.

Receives a System, what of it is tangible, and its plan.  Hands on states of rest with what holds there.
"""

from __future__ import annotations

from collections.abc import Set as AbstractSet
from dataclasses import replace

import numpy as np
from sysdyn.runtime.events.contacts import Contacts
from sysdyn.runtime.events.observer import Observer
from sysdyn.runtime.events.pivoting import NoActiveSetError, Pivoting
from sysdyn.runtime.events.plan import Plan, Sampled
from sysdyn.runtime.linear.rest import SAME, SHARE, Rest, RestEquations, Resting
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.gauss_newton import Problem

Point = tuple[Floats, Floats, Floats]


class ContactRest:
    """The equations of rest of a model whose active set is found with them; as Resting."""

    def __init__(self, system: System, tangible: AbstractSet[str], t: float, first: Floats, plan: Plan) -> None:
        self.system, self.tangible, self.t, self.first = system, tangible, t, first
        self.contacts = Contacts(plan, system, Observer(system), system.description.p, starting=True)
        self.contacts.take(system.description.switches.active)
        self._frictions = [k for k, c in enumerate(plan.contacts) if c.kind in ("friction", "planar")]
        self._of: dict[tuple[bool, ...], Resting] = {}
        self.share = SHARE
        # the state that a run was left in, and the one in which frictions stick
        started = self.contacts.state()
        self._stick()
        self._begins = dict.fromkeys((self.contacts.state(), started))  # what rubs on a belt slips at rest
        self.contacts.size(self.problem(first).scale, 1.0)
        self._last: Rest | None = None

    # the sense of a friction that sticks is none
    def _stick(self) -> None:
        for k in self._frictions:
            self.contacts.active[k] = True
            self.contacts.p[self.contacts.contacts[k].sense] = 0.0
        self.contacts.apply()

    def _resting(self) -> Resting:
        """The equations with what holds now."""
        # equations are made once for each active set
        key = tuple(self.contacts.active.tolist())
        if key not in self._of:
            self._of[key] = Resting(self.system, self.tangible, self.t, self.first)
        self._of[key].share = self.share
        return self._of[key]

    @property
    def turns(self) -> np.ndarray:
        """Displacements that are angles [unknowns]."""
        return self._resting().turns

    def problem(self, guess: Floats) -> Problem:
        """Rest nearest to a guess, with what holds now."""
        return self._resting().problem(guess)

    def _settle(self, _: float, y: Floats, __: Floats, near: Floats | None = None) -> Point | None:
        self._last = self._resting().found(y, near)
        return None if self._last is None else (self._last.state.y, self._last.state.yd, np.zeros_like(y))

    def found(self, guess: Floats) -> Rest | None:
        """The state of rest that is come to from a guess, its contacts those that fit."""
        return next((rest for begin in self._begins if (rest := self._fitting(guess, begin)) is not None), None)

    def _fitting(self, guess: Floats, begin: tuple[float, ...]) -> Rest | None:
        """The state of rest from a guess and a state of the contacts; None where no active set fits."""
        self.contacts.become(begin)
        self.contacts.through.clear()
        pivoting = Pivoting(self.contacts, lambda *_: False)
        try:
            pivoting.fit(self.t, guess, np.zeros_like(guess), self._settle)
        except NoActiveSetError:
            return None
        assert self._last is not None
        kept, state = self._last, self.contacts.state()
        if not all(self.contacts.active[k] for k in self._frictions):  # at its bound, and at rest: it sticks
            loaded = self._load_frictions(kept.state.y, kept.state.yd)
            self._stick()
            sticking = self._settle(self.t, loaded, kept.state.yd, loaded)
            # sticking counts only where it fits too
            if sticking is not None and self.contacts.fits(self.t, loaded, sticking):
                kept, state = self._last, self.contacts.state()
            # the words of the report are those of the state that was found
            self.contacts.become(state)
        switches = self.system.description.switches
        words = {c.name: self.contacts.word(k) for k, c in enumerate(self.contacts.contacts) if c.kind != "follows"}
        return replace(kept, standing=(self.contacts.p.copy(), switches.active.copy()), holding=words)

    def _load_frictions(self, y: Floats, yd: Floats) -> Floats:
        """A point at which frictions slip, with what they give as what they would take if they stuck."""
        contacts, y = self.contacts, y.copy()
        values = contacts.observer(self.t, y, yd)
        for k in self._frictions:
            contact, place = contacts.contacts[k], contacts.multiplier[k]
            # a friction that sticks, or has no multiplier, carries what the rows say
            if contacts.active[k] or place < 0:
                continue
            # along a line: its bound, with the sense of its slip
            if contact.kind == "friction":
                y[place] = contacts.p[contact.sense] * values[contact.bound]
            # in a plane: its bound along the direction of its slip
            else:
                along = contacts.p[list(contact.direction)]
                y[[place, contacts.multiplier[k + 1]]] = values[contact.upper] * along / np.hypot(*along)
        return y

    def alike(self, point: Floats) -> bool:
        """Nothing is certain: the contacts decide where a point leads."""
        return False

    def is_apart(self, one: Rest, other: Rest) -> bool:
        """Whether two states differ by more than what the first leaves open."""
        one.stand(self.system)
        self.contacts.take(self.system.description.switches.active)
        return self._resting().is_apart(one, other)


class SampledRest:
    """Those of other equations that no sampled action changes; changes: what one would change, where it would."""

    def __init__(self, equations: RestEquations, system: System, sampled: tuple[Sampled, ...]) -> None:
        self.equations, self.system, self.sampled = equations, system, sampled
        self.first, self.problem, self.is_apart = equations.first, equations.problem, equations.is_apart
        self.alike = equations.alike
        self.observer = Observer(system)
        self.changes: dict[str, None] = {}

    @property
    def share(self) -> float:
        """Of the work of one search."""
        return self.equations.share

    @share.setter
    def share(self, share: float) -> None:
        self.equations.share = share

    @property
    def turns(self) -> np.ndarray:
        """Displacements that are angles [unknowns]."""
        return self.equations.turns

    def found(self, guess: Floats) -> Rest | None:
        """The state of rest that is come to from a guess; None where a sample would change something there."""
        rest = self.equations.found(guess)
        # no rest from this guess
        if rest is None:
            return None
        state, p = rest.state, self.system.description.p
        values, changed = self.observer(state.t, state.y, state.yd), dict[str, None]()
        # what each sample would set, against what stands
        for event in self.sampled:
            for a in event.assignments:
                now = float(p[a.place] if a.kind == "discrete" else state.y[a.place])
                size = SAME * max(abs(now), abs(values[a.row])) + self.observer.zero(a.row)
                # a change beyond round-off: the next sample would leave the rest
                if not abs(values[a.row] - now) <= size:
                    changed[f"'{event.name}' sets {a.name} from {now:.6g} to {values[a.row]:.6g}"] = None
        self.changes |= changed
        return None if changed else rest
