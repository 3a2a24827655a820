"""Values of parameters: evaluated in the order of their dependencies, overridden by name or element."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.compiler.model.interpret import Value, evaluate, over
from sysdyn.compiler.model.tables import evaluate as evaluate_table
from sysdyn.dsl.model.dependence import in_order
from sysdyn.dsl.model.expression import Node, const, topological
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.model.network import ElementSetting, Loop, Network, Parameter, Shape
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Place

Extents = tuple[tuple[int, int], ...]  # (first, last) of each index
LARGEST = 2**27  # elements of an array: 1 GiB
Override = str | tuple[Any, ...]


def extents(box: Extents) -> tuple[int, ...]:
    """Number of values of each index."""
    return tuple(max(last - first + 1, 0) for first, last in box)


def positions(box: Extents, at: Sequence[NDArray[np.int64]]) -> NDArray[np.int64]:
    """Row-major positions of indices in a box."""
    result = np.zeros(np.broadcast(*at).shape if len(at) > 1 else np.shape(at[0]), dtype=np.int64)
    for (first, last), values in zip(box, at, strict=True):
        result = result * (last - first + 1) + (values - first)
    return result


class Parameters:
    """All parameter values of a network under overrides; `lookup` serves `interpret`."""

    def __init__(self, network: Network, overrides: Mapping[Override, Any]) -> None:
        self.values: dict[str, Any] = {}
        self.boxes: dict[str, Extents] = {}
        self.hidden: dict[str, float] = {}  # numbers that the compiler itself asks for
        self.start = 0.0
        self._network = network
        self._tables = {t.name: t for t in network.tables}
        self._known = {p.name: p for p in network.parameters}
        self._settings: dict[str, list[ElementSetting]] = {}
        for setting in network.elements:
            self._settings.setdefault(setting.name, []).append(setting)
        self._given = {key if isinstance(key, str) else key[0] for key in overrides} | self._settings.keys()
        self._check(overrides)
        for parameter in self._dependency_order(overrides):
            self._bind(parameter, overrides)
        if network.scene is not None and network.scene.start is not None:
            self.start = float(evaluate([network.scene.start], self.lookup)[0])

    def _check(self, overrides: Mapping[Override, Any]) -> None:
        for name in overrides:
            plain = name if isinstance(name, str) else name[0]
            if plain not in self._known:
                raise ModelError([Diagnostic("E405", f"there is no parameter '{plain}'", None)])

    def _dependency_order(self, overrides: Mapping[Override, Any]) -> list[Parameter]:
        """Parameters after those that their values and shapes use."""
        known = self._known
        order, circles = in_order(known, lambda name: self._uses(known[name], name in overrides))
        if circles:
            name = circles[0][0]
            raise ModelError([Diagnostic("E807", f"parameter '{name}' depends on itself", known[name].place)])
        return [known[name] for name in order]

    def _uses(self, parameter: Parameter, overridden: bool) -> list[str]:
        if parameter.name not in self._given and _number(parameter) is not None:
            return []
        roots = [] if overridden else list(parameter.values)
        roots += [node for pair in parameter.shape for node in pair]
        roots += [node for e in self._settings.get(parameter.name, ()) for node in (*e.at, e.value)]
        nodes = topological(roots) if any(r.args for r in roots) else roots
        return [n for n in dict.fromkeys(n.data for n in nodes if n.op == "param") if n in self._known]

    def _bind(self, parameter: Parameter, overrides: Mapping[Override, Any]) -> None:
        """Bind a parameter: overrides before its formula, then elements that the scene or the caller sets; E805 of
        wrong shapes.
        """
        name, place = parameter.name, parameter.place
        # most parameters are a number that nothing sets
        if name not in self._given and (number := _number(parameter)) is not None:
            self.values[name] = number
            return
        box = self.extents(parameter.shape, place)
        if math.prod(extents(box)) > LARGEST:
            text = f"'{name}' has {math.prod(extents(box))} elements, more than {LARGEST}"
            raise ModelError([Diagnostic("E805", text, place)])
        if parameter.shape:
            self.boxes[name] = box
        # a number for all elements, or an array of the shape
        if name in overrides:
            values = np.asarray(overrides[name], dtype=float)
            if values.shape not in ((), extents(box)):
                text = f"'{name}' has shape {list(extents(box))}, not {list(values.shape)}"
                raise ModelError([Diagnostic("E805", text, place)])
            values = np.broadcast_to(values, extents(box)).copy()
        else:
            values = self._formula(parameter, box)
        # elements of the scene, by their indices
        for setting in () if name in overrides else self._settings.get(name, ()):
            *at, value = evaluate((*setting.at, setting.value), self.lookup_at_place(setting.place))
            values[self._element(name, box, tuple(at), setting.place)] = value
        # elements of the caller come last
        for key, value in overrides.items():
            if not isinstance(key, str) and key[0] == name:
                values[self._element(name, box, key[1:], place)] = value
        if parameter.whole and np.any(values != np.rint(values)):
            raise ModelError(
                [Diagnostic("E805", f"'{name}' = {float(np.ravel(values)[0]):g} is no whole number", place)]
            )
        self.values[name] = values if parameter.shape else float(values)

    def _formula(self, parameter: Parameter, box: Extents) -> NDArray[np.float64]:
        """The values as the text gives them."""
        lookup = self.lookup_at_place(parameter.place)
        shape = extents(box)
        # `m[i] = 2*i`: the formula at each index
        if parameter.indices:
            pairs = zip(parameter.indices, box, strict=False)  # indices that follow hold a list, or one value for all
            nest = tuple(Loop(name, const(first), const(last)) for name, (first, last) in pairs)
            columns = np.stack(over(nest, parameter.values, lookup), axis=-1)
            rest = int(np.prod(shape[len(parameter.indices) :]))
            values = np.broadcast_to(columns, (columns.shape[0], rest)).flatten()
        else:
            # a list, or one number for all elements
            values = np.asarray([float(v) for v in evaluate(parameter.values, lookup)])
            if len(values) != int(np.prod(shape)):
                if len(values) != 1:
                    text = f"'{parameter.name}' has {int(np.prod(shape))} elements, {len(values)} are given"
                    raise ModelError([Diagnostic("E805", text, parameter.place)])
                values = np.repeat(values, int(np.prod(shape)))
        # `inf` written in the text is E324; an overflow is told by what calculates
        said = (n.data for n in topological(parameter.values) if n.op == "const")
        if np.any(np.isinf(values)) and any(map(math.isinf, said)):
            text = f"parameter '{parameter.name}' is inf, which no parameter can be: a run calculates with it"
            raise ModelError([Diagnostic("E324", text, parameter.place, "a finite number beyond what is met: 1e9")])
        self.finite(values, parameter.place, f"parameter '{parameter.name}'")
        return values.reshape(shape)

    def _element(self, name: str, box: Extents, at: tuple[Any, ...], place: Place) -> tuple[int, ...]:
        if len(at) != len(box):
            raise ModelError([Diagnostic("E805", f"'{name}' has {len(box)} indices, not {len(at)}", place)])
        for k, (first, last) in zip(at, box, strict=True):
            if not first <= k <= last:
                raise ModelError([Diagnostic("E805", f"'{name}': index {k:g} outside {first}..{last}", place)])
        return tuple(int(k) - first for k, (first, _) in zip(at, box, strict=True))

    def extents(self, shape: Shape, place: Place | None = None) -> Extents:
        """A shape in numbers."""
        return tuple((whole_number(self, a, place), whole_number(self, b, place)) for a, b in shape)

    def lookup(self, node: Node, args: list[Value]) -> Value:
        """The value of a leaf that parameters determine."""
        if node.op == "param":
            if node.data in self.hidden:
                return self.hidden[node.data]
            values = self.values[node.data]
            return values if not node.args else self._gather(node.data, values, args)
        if node.op == "table":
            orders = node.data[1] if isinstance(node.data[1], tuple) else (node.data[1],) * len(args)
            return evaluate_table(self._tables[node.data[0]], args, orders)
        if node.op == "time":
            return self.start
        raise ModelError([Diagnostic("E807", f"{to_text(node)} is not known before the start", None)])

    def table_size(self, node: Node) -> float:
        """What rounding of a table node's value is relative to: the largest of its pieces' terms, which cancel at the
        right ends.
        """
        table, orders = self._tables[node.data[0]], node.data[1]
        size = float(np.abs(table.values).max(initial=0.0))
        for points, order in zip(table.points, orders if isinstance(orders, tuple) else (orders,), strict=False):
            size /= float(np.diff(points).min(initial=np.inf)) ** order
        return size

    def _gather(self, name: str, values: NDArray[np.float64], args: list[Value]) -> Value:
        """Elements of an array; an index outside is E805."""
        at = []
        for k, (first, last) in zip(args, self.boxes[name], strict=True):
            rounded = np.rint(k).astype(np.int64)
            outside = (rounded < first) | (rounded > last) | (rounded != k)
            if np.any(outside):
                bad = np.ravel(k)[np.argmax(np.ravel(outside))]
                raise ModelError([Diagnostic("E805", f"{name}: index {bad:g} outside {first}..{last}", None)])
            at.append(rounded - first)
        return values[tuple(at)]

    def lookup_at_place(self, place: Place) -> Callable[[Node, list[Value]], Value]:
        """`lookup` with the place added to what it finds wrong."""

        def look(node: Node, args: list[Value]) -> Value:
            try:
                return self.lookup(node, args)
            except ModelError as error:
                raise ModelError([_add_place(d, place) for d in error.diagnostics]) from None

        return look

    def finite(self, values: NDArray[np.float64], place: Place, what: str) -> None:
        """ModelError E324 where a value came out infinite or undefined."""
        if not np.all(np.isfinite(values)):
            text = f"division by zero, or a number too large, in {what} with the values bound"
            raise ModelError([Diagnostic("E324", text, place, "a finite number, and no zero below a division")])


def _number(parameter: Parameter) -> float | None:
    """A finite number that stands by itself: a netlist has tens of thousands of them."""
    if parameter.shape or parameter.indices or parameter.whole or len(parameter.values) != 1:
        return None
    node = parameter.values[0]
    return node.data if node.op == "const" and math.isfinite(node.data) else None


def _add_place(found: Diagnostic, place: Place) -> Diagnostic:
    return Diagnostic(found.code, found.message, found.place or place, found.help, found.related, found.label)


def whole_number(parameters: Parameters, node: Node, place: Place | None = None) -> int:
    """The value of a whole-number expression; E805 where it is none."""
    value = float(evaluate([node], parameters.lookup)[0])
    if not np.isfinite(value) or value != np.rint(value) or abs(value) >= 2**31:
        raise ModelError([Diagnostic("E805", f"{to_text(node)} = {value:g} is no whole number", place)])
    return int(value)
