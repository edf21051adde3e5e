"""How two outputs of a command differ, said by what they mean rather than by their bytes."""

import difflib
import hashlib
import io
import json
import zipfile
from collections.abc import Iterator
from typing import Any

__all__ = ["differences_of", "member_hashes"]

_MOST = 40  # lines a file
_WIDEST = 220
_BINARY = (".stl", ".png", ".3mf", ".npy")


def differences_of(name: str, before: bytes | None, after: bytes | None) -> list[str]:
    """Return how a file, or a stream, differs: nothing if it does not.

    JSON by its leaves, other texts as a short unified diff, a 3MF by its members, other files by
    size and hash.
    """
    if before == after:
        return []
    if before is None or after is None:
        return [f"{name}: {'new' if before is None else 'no longer there'}"]
    if name == "exit":
        return [f"exit: {before.decode().strip()} -> {after.decode().strip()}"]
    if name.endswith(".3mf"):
        old, new = member_hashes(before), member_hashes(after)
        return [f"{name}: {m}" for m in sorted({*old, *new}) if old.get(m) != new.get(m)]
    if not name.endswith(_BINARY):
        try:
            lines = _of_text(before.decode(), after.decode())
        except UnicodeDecodeError:
            pass
        else:
            return [f"{name}:", *(f"  {line}" for line in _capped(lines))]
    return [f"{name}: {_size(before)} -> {_size(after)}"]


def member_hashes(data: bytes) -> dict[str, str]:
    """Return the hashes of what a 3MF, or another archive, holds (deflate differs by version)."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return {n: hashlib.sha256(archive.read(n)).hexdigest() for n in archive.namelist()}
    except zipfile.BadZipFile:
        return {"no archive": hashlib.sha256(data).hexdigest()}


def _of_text(before: str, after: str) -> list[str]:
    try:
        old, new = json.loads(before), json.loads(after)
    except ValueError:
        lines = difflib.unified_diff(before.splitlines(), after.splitlines(), n=1, lineterm="")
        return list(lines)[2:] or ["line ends differ"]
    return list(_leaves("", old, new)) or ["the same values, set otherwise or in another order"]


def _leaves(path: str, old: Any, new: Any) -> Iterator[str]:
    if isinstance(old, dict) and isinstance(new, dict):
        for key in [*old, *(k for k in new if k not in old)]:
            at = f"{path}.{key}" if path else key
            if key not in new:
                yield f"{at}: {_shown(old[key])} -> (gone)"
            elif key not in old:
                yield f"{at}: (new) -> {_shown(new[key])}"
            else:
                yield from _leaves(at, old[key], new[key])
    elif isinstance(old, list) and isinstance(new, list):
        if len(old) != len(new):
            yield f"{path}: {len(old)} -> {len(new)} items"
        for k, (a, b) in enumerate(zip(old, new, strict=False)):
            yield from _leaves(f"{path}[{k}]", a, b)
    elif old != new or type(old) is not type(new):
        yield f"{path or '(document)'}: {_shown(old)} -> {_shown(new)}"


def _shown(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= _WIDEST // 2 else text[: _WIDEST // 2] + "..."


def _capped(lines: list[str]) -> list[str]:
    short = [line if len(line) <= _WIDEST else line[:_WIDEST] + "..." for line in lines[:_MOST]]
    return [*short, f"and {len(lines) - _MOST} lines more"] if len(lines) > _MOST else short


def _size(data: bytes) -> str:
    return f"{len(data)} bytes, {hashlib.sha256(data).hexdigest()[:16]}"
