"""What of an index form follows from its structure alone: sizes, kinds, groups and names of unknowns and rows.

Made once a description, kept with it, and let go of where room counts.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Description, Floats, Ints
from sysdyn.runtime.model.failures import RowLabel
from sysdyn.runtime.model.forms import Form, unknown_name
from sysdyn.runtime.model.held_rows import LeftOut
from sysdyn.runtime.model.patterns import read_only

Mask = NDArray[np.bool_]
Found = TypeVar("Found")
KEPT = 1000
"""Unknowns up to which what is as long as they are, and quickly made, is kept."""
DEAR = ("order", "sets")
"""Names of what is long to find and short to keep."""


class Facts:
    """description: of the model; form: its index form; left_out: multipliers of constraints that do not count."""

    description: Description
    form: Form
    left_out: LeftOut

    # --- what is made once ----------------------------------------------------------------------------------

    def once(self, name: Hashable, make: Callable[[], Found]) -> Found:
        """What follows from the structure of this form alone: made once for all runs of a text with these sizes."""
        # kept by the description, so that all systems of these sizes share it
        key = "once", name, self.form.name, self.left_out
        if key not in self.description.layouts:
            self.description.layouts[key] = make()
        return self.description.layouts[key]  # type: ignore[no-any-return]

    def once_if_small(self, name: Hashable, make: Callable[[], Found]) -> Found:
        """What `make` returns, kept where that costs no room to speak of; else made anew."""
        return self.once(name, make) if self.unknowns <= KEPT else make()

    def forget(self) -> None:
        """Lets go of what follows from this form's structure, where no other run has it: found again if asked."""
        # kept for no other run
        if self.description.systems is None:
            layouts = self.description.layouts
            for key in [k for k in layouts if isinstance(k, tuple) and self.form.name in (k[0], k[1], *k[2:3])]:
                del layouts[key]

    def spare(self) -> None:
        """Lets go of all that was made once for any form but orders of elimination, where no other run has it: what is
        in use stays with those who use it, the rest is found again if asked.
        """
        if self.description.systems is None:
            layouts = self.description.layouts
            made = [k for k in layouts if isinstance(k, tuple) and k[0] == "once"]
            # orders of elimination are dear: they stay
            for key in [k for k in made if k[1] not in DEAR and k[1][0] not in DEAR]:
                del layouts[key]

    def forget_once(self, name: Hashable) -> None:
        """Lets go of one thing that was made once, where no other run has it."""
        if self.description.systems is None:
            self.description.layouts.pop(("once", name, self.form.name, self.left_out), None)

    # --- unknowns and rows ----------------------------------------------------------------------------------

    @property
    def unknowns(self) -> int:
        """Length of y."""
        return self.form.unknowns

    @property
    def rows(self) -> int:
        """Length of r."""
        return self.form.rows

    @cached_property
    def unknown_names(self) -> tuple[str, ...]:
        """Name of each unknown."""
        return tuple(unknown_name(self.description, self.form, k) for k in range(self.unknowns))

    def name(self, place: int) -> str:
        """Name of one unknown."""
        return unknown_name(self.description, self.form, place)

    def row_label(self, row: int) -> RowLabel:
        """Label of one row."""
        return self.form.row_label(self.description, row)

    @property
    def kinds(self) -> NDArray[np.str_]:
        """Kind of each unknown: q f p s e kappa mu nu; read-only."""
        return self.once("kinds", lambda: read_only(self._kinds()))

    def _kinds(self) -> NDArray[np.str_]:
        kinds, numbers = zip(*self.form.kind, strict=True) if self.form.kind else ((), ())
        return np.repeat(np.array(kinds, dtype="<U5"), np.array(numbers, dtype=np.int64))

    def are(self, *kinds: str) -> Mask:
        """Unknowns of these kinds [unknowns]; read-only."""
        return self.once(("are", kinds), lambda: read_only(self._are(kinds)))

    def _are(self, kinds: tuple[str, ...]) -> Mask:
        mask = np.zeros(self.unknowns, dtype=bool)
        for family, first in zip(self.description.families, self.form.at, strict=True):
            # -1: not in this form
            if family.kind in kinds and 0 <= first < self.unknowns and family.kind != "audit":
                mask[first : first + family.size] = True
        if self.form.name != "start":
            mask[self.form.written :] = "nu" in kinds
        return mask

    def of_groups(self, *names: str) -> Mask:
        """Rows of these groups [rows]; read-only."""
        return self.once(("groups", names), lambda: read_only(self._of_groups(names)))

    def _of_groups(self, names: tuple[str, ...]) -> Mask:
        mask = np.zeros(self.rows, dtype=bool)
        for group, family, first in self.form.groups:
            # rows of a group, family by family
            if group in names:
                mask[first : first + self.description.rows[family].size] = True
        return mask

    @property
    def family_of(self) -> Ints:
        """Number of the family of each unknown (nu: -1); read-only."""
        return self.once_if_small("family_of", self._family_of)

    def _family_of(self) -> Ints:
        found = np.full(self.unknowns, -1, dtype=np.int32)
        for k, family in enumerate(self.description.families):
            # audits are no unknowns
            if self.form.at[k] >= 0 and family.kind != "audit":
                found[self.form.at[k] : self.form.at[k] + family.size] = k
        return read_only(found)

    @property
    def begins(self) -> tuple[Ints, Ints]:
        """Where families begin among the unknowns as written, in their order, and which; those without any left out."""
        return self.once("begins", self._begins)

    def _begins(self) -> tuple[Ints, Ints]:
        families = enumerate(zip(self.description.families, self.form.at, strict=True))
        written = [(first, k) for k, (f, first) in families if 0 <= first < self.form.written and f.size]
        first, number = np.array(sorted(written), dtype=np.int32).reshape(-1, 2).T
        return first, number

    def families_in(self, mask: Mask) -> frozenset[int]:
        """Families of which some unknown is in a mask [unknowns as written]."""
        first, number = self.begins
        return frozenset(number[np.logical_or.reduceat(mask, first)].tolist()) if first.size else frozenset()

    @property
    def nominal(self) -> Floats:
        """Nominal magnitudes from the manifest; 0 where it names none; read-only."""
        return self.once_if_small("nominal", self._nominal)

    @property
    def named(self) -> Floats | None:
        """Nominal value of each unknown [unknowns]; None where the manifest names none."""
        return self.nominal if any(family.nominal is not None for family in self.description.families) else None

    def _nominal(self) -> Floats:
        values = [0.0 if family.nominal is None else family.nominal for family in self.description.families]
        return read_only(np.append(np.array(values, dtype=np.float64), 0.0)[self.family_of])
