"""The cache of compiled models: what lies there is trusted only as far as its seal."""

import ctypes
import errno
import os
import shutil
import stat
import subprocess
import sys

import pytest
from sysdyn.compiler.program import cache
from sysdyn.compiler.program.build import NoCompilerError, build, compiler

TEXT = "int sd_answer(void) { return %d; }"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SYSDYN_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def answer(path):
    """In a process of its own: a broken library may take it along."""
    code = f"import ctypes; print(ctypes.CDLL({str(path)!r}).sd_answer())"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    return run.stdout.strip()


def flip(at):
    def damage(entry, other):
        content = bytearray(entry.read_bytes())
        content[at if at >= 0 else len(content) + at] ^= 0x10
        entry.write_bytes(content)

    return damage


def cut(keep):
    def damage(entry, other):
        content = entry.read_bytes()
        entry.write_bytes(content[: int(keep * len(content)) if keep < 1 else int(keep)])

    return damage


def replaced(make):
    def damage(entry, other):
        entry.unlink()
        make(entry, other)

    return damage


def _made_folder(entry, other):
    entry.mkdir()
    (entry / "inside").write_text("x")


DAMAGE = {
    "empty": lambda entry, other: entry.write_bytes(b""),
    "one byte": cut(1),
    "the head alone": cut(64),
    "half": cut(0.5),
    "all but one byte": lambda entry, other: entry.write_bytes(entry.read_bytes()[:-1]),
    "without its seal": lambda entry, other: entry.write_bytes(entry.read_bytes()[: -cache.SEAL]),
    "a byte more": lambda entry, other: entry.write_bytes(entry.read_bytes() + b"\0"),
    "flipped in the magic": flip(0),
    "flipped in the head": flip(24),
    "flipped in the code": flip(0x1000),
    "flipped in the symbols": flip(0x300),
    "flipped in the seal": flip(-1),
    "flipped in the seal's magic": flip(-cache.SEAL),
    "zeros": lambda entry, other: entry.write_bytes(bytes(entry.stat().st_size)),
    "text": lambda entry, other: entry.write_text("INPUT(libm.so)"),
    "another sound entry": lambda entry, other: shutil.copyfile(other, entry),
    "a link to another sound entry": replaced(lambda entry, other: entry.symlink_to(other)),
    "a link to nowhere": replaced(lambda entry, other: entry.symlink_to("nowhere")),
    "a link to a device": replaced(lambda entry, other: entry.symlink_to("/dev/zero")),
    "a folder": replaced(_made_folder),
    "a pipe": replaced(lambda entry, other: os.mkfifo(entry)),
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE.keys())
@pytest.mark.one_in(9)
def test_a_damaged_entry_is_built_again(folder, damage):
    entry, other = build(TEXT % 42), build(TEXT % 7)
    kept = other.read_bytes()
    damage(entry, other)
    again = build(TEXT % 42)
    assert again == entry
    assert stat.S_ISREG(again.lstat().st_mode)
    assert answer(again) == "42"
    assert other.read_bytes() == kept, "what it was linked to is left alone"
    assert sorted(p.name for p in folder.iterdir()) == sorted([entry.name, other.name])


def test_a_sound_entry_is_not_built_again(folder, monkeypatch):
    entry = build(TEXT % 3)
    made = entry.stat().st_ino
    monkeypatch.setattr("sysdyn.compiler.program.build._compile", None)
    assert build(TEXT % 3) == entry
    assert entry.stat().st_ino == made


def test_a_build_that_is_cut_short_leaves_no_entry(folder, monkeypatch):
    monkeypatch.setattr(cache.os, "fsync", lambda handle: (_ for _ in ()).throw(OSError("no room")))
    with pytest.raises(NoCompilerError, match="no room"):
        build(TEXT % 5)
    assert not list(folder.iterdir())


def test_a_cache_without_room_is_done_without(folder, monkeypatch):
    put, tried = cache.put, []

    def full(library, key):
        tried.append(library)
        if library.is_relative_to(folder) or monkeypatch.nowhere:
            raise OSError(errno.ENOSPC, "No space left on device")
        return put(library, key)

    monkeypatch.nowhere = False
    monkeypatch.setattr(cache, "put", full)
    built = build(TEXT % 7)
    assert answer(built) == "7"
    assert not built.is_relative_to(folder)
    assert len(tried) == 2
    assert not list(folder.iterdir())
    monkeypatch.nowhere = True
    with pytest.raises(NoCompilerError, match="No space left"):
        build(TEXT % 8)


def test_the_cache_has_a_limit_and_what_was_used_longest_ago_goes(folder, monkeypatch):
    entries = [build(TEXT % n) for n in range(4)]
    size = entries[0].stat().st_size
    for age, entry in zip((9e3, 4e4, 5e3, 10.0), entries, strict=True):
        past = entry.stat().st_mtime - age
        os.utime(entry, (past, past))
    build(TEXT % 0)  # used again: the one at 9e3 is young now
    monkeypatch.setenv("SYSDYN_CACHE_LIMIT", str(4 * size))
    last = build(TEXT % 99)
    assert {p.name for p in folder.iterdir()} == {p.name for p in (entries[0], entries[2], entries[3], last)}
    monkeypatch.setenv("SYSDYN_CACHE_LIMIT", "1")
    last = build(TEXT % 98)
    left = {p.name for p in folder.iterdir()}
    assert entries[2].name not in left
    assert {entries[0].name, entries[3].name, last.name} <= left, "what may be in use stays"


def test_the_parent_folder_is_checked(tmp_path, monkeypatch):
    parent = tmp_path / "parent"
    parent.mkdir()
    monkeypatch.setenv("SYSDYN_CACHE", str(parent / "cache"))
    assert cache.folder() == parent / "cache"
    parent.chmod(0o777)
    assert cache.folder() != parent / "cache", "anyone could put another folder there"
    parent.chmod(0o1777)
    assert cache.folder() == parent / "cache", "in a sticky folder only the owner can"
    if os.getuid() == 0:
        parent.chmod(0o755)
        os.chown(parent, 12345, -1)
        assert cache.folder() != parent / "cache"


@pytest.mark.parametrize("said", ["{cc} -O0", "  {cc}   -O0 -g ", "{wrap} {cc} -O0", "'{spaced}' {cc} -DX='a b'"])
def test_the_compiler_may_have_options_and_a_launcher(folder, tmp_path, monkeypatch, said):
    cc, log = shutil.which("cc"), tmp_path / "log"
    wrap, spaced = tmp_path / "wrap", tmp_path / "my wrap"
    for path in (wrap, spaced):
        path.write_text(f'#!/bin/sh\necho "$@" >> {log}\nexec "$@"\n')
        path.chmod(0o755)
    monkeypatch.setenv("CC", said.format(cc=cc, wrap=wrap, spaced=spaced))
    command, options = compiler()
    assert command[-1] == cc
    assert options
    assert ctypes.CDLL(str(build(TEXT % 11))).sd_answer() == 11
    if "wrap" in said:
        line = log.read_text().splitlines()[-1]
        assert line.index("-O1") < line.index(options[0]), "what the user says comes last and wins"


def test_a_compiler_that_cannot_be_read_is_said(folder, monkeypatch):
    from sysdyn.compiler.program.build import NoCompilerError

    for said in ("cc 'unclosed", "-O0", "ccache no-such-compiler"):
        monkeypatch.setenv("CC", said)
        with pytest.raises(NoCompilerError):
            build(TEXT % 1)
