"""A file that holds /parameters alone, laid down at once: HDF5's first format, written as the specification says.

Through the library a scalar with its unit costs 40 us and 384 bytes, whatever its layout; a netlist written by hand has
tens of thousands.  Here they are a few arrays: 1 us and 190 bytes each.  The library opens the file and adds the rest.
Source: HDF5 File Format Specification 3.0, II.A (superblock, version 0), III.A.1 (B-trees, version 1), III.B and III.C
(symbol tables), III.D (local heaps), IV.A.1.a (object headers, version 1) and IV.A.2 (messages).
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from sysdyn.values import dataclass

LEAF, INTERNAL = 4, 16
"""Half of the symbols that a leaf holds, half of the children of a node of the tree: the library's own."""
UNDEFINED, NO_FREE = 2**64 - 1, 1
"""No such address; a heap without room."""
GROUP = 1
"""What an entry keeps of its object: where a group's tree and heap are."""
ENTRY = np.dtype([("name", "<u8"), ("header", "<u8"), ("kept", "<u4"), ("_", "<u4"), ("tree", "<u8"), ("heap", "<u8")])
SYMBOLS = np.dtype(
    [("signature", "S4"), ("version", "u1"), ("_", "u1"), ("used", "<u2"), ("entries", ENTRY, 2 * LEAF)]
)
NODE = np.dtype(
    [("signature", "S4"), ("kind", "u1"), ("level", "u1"), ("used", "<u2"), ("left", "<u8"), ("right", "<u8")]
    + [("keys_and_children", "<u8", 4 * INTERNAL + 1)]
)
SPACE, TYPE, FILL, LAYOUT, ATTRIBUTE, TABLE = 0x01, 0x03, 0x05, 0x08, 0x0C, 0x11
"""Messages of an object's header."""
CONSTANT = 1
"""Flag of a message that never changes."""
SCALAR = bytes((1, 0, 0, 0, 0, 0, 0, 0))
FLOAT64 = bytes.fromhex("11203f000800000000004000340b0034ff030000")
"""IEEE 754, little endian: sign at bit 63, exponent of 11 bits at 52 (bias 1023), mantissa of 52 bits."""
NO_FILL = bytes((2, 1, 2, 1, 0, 0, 0, 0))
"""Version 2, room at creation, written where one is set; of size zero."""
SUPERBLOCK, PREFIX = 96, 16
"""Bytes of a file's and of an object's first part."""


@dataclass(frozen=True, slots=True)
class Group:
    """Addresses of a group's header, tree and heap, and its bytes."""

    header: int
    tree: int
    heap: int
    parts: tuple[bytes, ...]


def begin(path: Path, names: Sequence[str], values: Sequence[float], units: Sequence[str]) -> None:
    """A new file with a scalar float64 `/parameters/<name>` each, attribute `units`; FileExistsError."""
    order = sorted(range(len(names)), key=lambda k: names[k].encode())
    addresses = np.empty(len(names), dtype=np.uint64)
    at, parts = SUPERBLOCK, list[bytes]()
    for unit in dict.fromkeys(units):
        own = [k for k in order if units[k] == unit]
        found = _scalars(np.array([values[k] for k in own], dtype="<f8"), unit)
        addresses[own] = at + found.shape[1] * np.arange(len(own), dtype=np.uint64)
        parts.append(found.tobytes())
        at += found.size
    inner = _group([names[k].encode() for k in order], _entries(addresses[order]), at)
    at += sum(map(len, inner.parts))
    root = _group([b"parameters"], _entries(np.array([inner.header], dtype=np.uint64), inner), at)
    at += sum(map(len, root.parts))
    with path.open("xb") as file:
        file.writelines((_superblock(root, at), *parts, *inner.parts, *root.parts))


def _scalars(values: NDArray[np.float64], unit: str) -> NDArray[np.uint8]:
    """Headers of data sets [values, bytes] that hold their number themselves (a compact layout)."""
    text = unit.encode() or b" "
    kind = struct.pack("<B3sI", 0x13, b"\x11\0\0", len(text))  # padded with null, UTF-8
    sizes = struct.pack("<BxHHH", 1, len(b"units\0"), len(kind), len(SCALAR))
    header = _header(
        _message(LAYOUT, struct.pack("<BBH8x", 3, 0, 8)),
        _message(SPACE, SCALAR),
        _message(TYPE, FLOAT64, CONSTANT),
        _message(FILL, NO_FILL, CONSTANT),
        _message(ATTRIBUTE, sizes + _padded(b"units\0") + kind + SCALAR + text),
    )
    found = np.tile(np.frombuffer(header, dtype=np.uint8), (values.size, 1))
    place = PREFIX + 8 + 4  # behind the heads of object, message and layout
    found[:, place : place + 8] = values.view(np.uint8).reshape(-1, 8)
    return found


def _entries(headers: NDArray[np.uint64], group: Group | None = None) -> NDArray[np.void]:
    """Entries of a symbol table [objects], of data sets, or of one group."""
    found = np.zeros(headers.size, dtype=ENTRY)
    found["header"] = headers
    if group is not None:
        found["kept"], found["tree"], found["heap"] = GROUP, group.tree, group.heap
    return found


def _group(names: Sequence[bytes], entries: NDArray[np.void], at: int) -> Group:
    """A group of objects in the order of their names, from an address on: header, heap, symbols, tree."""
    sizes = np.array([len(name) // 8 * 8 + 8 for name in names], dtype=np.uint64)
    ends = 8 + np.cumsum(sizes)  # the first name of a heap is empty
    entries["name"] = ends - sizes
    heap = at + len(_header(_message(TABLE, bytes(16))))
    text = bytes(8) + b"".join(_padded(name + b"\0") for name in names)
    head = struct.pack("<4sB3xQQQ", b"HEAP", 0, len(text), NO_FREE, heap + 32)
    symbols = _nodes_of_symbols(entries)
    first = heap + len(head) + len(text)
    places = first + SYMBOLS.itemsize * np.arange(symbols.size, dtype=np.uint64)
    last = np.append(entries["name"][2 * LEAF - 1 :: 2 * LEAF], entries["name"][-1:])[: symbols.size]
    tree, nodes = _tree(places, last, first + symbols.nbytes)
    header = _header(_message(TABLE, struct.pack("<QQ", tree, heap)))
    return Group(at, tree, heap, (header, head, text, symbols.tobytes(), *nodes))


def _nodes_of_symbols(entries: NDArray[np.void]) -> NDArray[np.void]:
    """The leaves of a group, full but for the last."""
    number = -(-entries.size // (2 * LEAF))
    found = np.zeros(number, dtype=SYMBOLS)
    found["signature"], found["version"], found["used"] = b"SNOD", 1, _shares(entries.size, number, 2 * LEAF)
    padded = np.zeros(number * 2 * LEAF, dtype=ENTRY)
    padded[: entries.size] = entries
    found["entries"] = padded.reshape(number, 2 * LEAF)
    return found


def _tree(children: NDArray[np.uint64], last: NDArray[np.uint64], at: int) -> tuple[int, list[bytes]]:
    """Nodes over leaves, from an address on, level by level up to one: its address, all their bytes.

    last: the heap's place of the largest name below each child, which is the key behind it.
    """
    parts, level = list[bytes](), 0
    while level == 0 or children.size > 1:
        number = -(-children.size // (2 * INTERNAL))
        nodes = np.zeros(number, dtype=NODE)
        nodes["signature"], nodes["level"] = b"TREE", level
        nodes["used"] = _shares(children.size, number, 2 * INTERNAL)
        own = at + NODE.itemsize * np.arange(number, dtype=np.uint64)
        nodes["left"], nodes["right"] = np.append(UNDEFINED, own[:-1]), np.append(own[1:], UNDEFINED)
        pairs = np.zeros((number * 2 * INTERNAL, 2), dtype=np.uint64)
        pairs[: last.size] = np.column_stack((children, last))
        pairs = pairs.reshape(number, -1)
        nodes["keys_and_children"][:, 1:] = pairs
        last = pairs[np.arange(number), 2 * nodes["used"].astype(int) - 1]
        nodes["keys_and_children"][1:, 0] = last[:-1]
        parts.append(nodes.tobytes())
        children, at, level = own, at + nodes.nbytes, level + 1
    return int(children[0]), parts


def _shares(objects: int, number: int, most: int) -> NDArray[np.intp]:
    """How many each of some nodes holds, the last what is left."""
    return np.minimum(objects - most * np.arange(number), most)


def _superblock(root: Group, end: int) -> bytes:
    """The first bytes of a file whose base is 0."""
    sizes = struct.pack("<8s4xxBBxHHI", b"\x89HDF\r\n\x1a\n", 8, 8, LEAF, INTERNAL, 0)
    entry = _entries(np.array([root.header], dtype=np.uint64), root)
    return sizes + struct.pack("<QQQQ", 0, UNDEFINED, end, UNDEFINED) + entry.tobytes()


def _header(*messages: bytes) -> bytes:
    """An object's header, to which one link leads."""
    body = b"".join(messages)
    return struct.pack("<BxHII4x", 1, len(messages), 1, len(body)) + body


def _message(kind: int, content: bytes, flags: int = 0) -> bytes:
    data = _padded(content)
    return struct.pack("<HHB3x", kind, len(data), flags) + data


def _padded(content: bytes) -> bytes:
    """To a multiple of eight bytes."""
    return content + bytes(-len(content) % 8)
