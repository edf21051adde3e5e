"""Markdown as how-tos use it, as HTML; no words become markup."""

import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from html import escape

__all__ = ["to_html"]


def to_html(text: str, *, top_level: int = 3) -> str:
    """Return headings, paragraphs, lists, tables and code blocks as HTML.

    Everything is escaped first. Within a line there are code, bold and italic; links show as
    their words.

    Parameters
    ----------
    top_level
        Level of the page's heading under which this stands, plus one: what `#` becomes.
    """
    return "\n".join(_blocks(text.splitlines(), top_level))


_ITEM = re.compile(r"(?:(\d+)[.)]|[-*])\s+(.*)")
_FENCE = "```"


def _blocks(lines: Sequence[str], top_level: int) -> Iterator[str]:
    at = 0
    while at < len(lines):
        first = lines[at].strip()
        stop = at + 1
        if not first:
            pass
        elif first.startswith(_FENCE):
            stop = _end(lines, stop, lambda line: not line.strip().startswith(_FENCE))
            yield f"<pre>{escape(chr(10).join(lines[at + 1 : stop]))}</pre>"
            stop += 1
        elif heading := re.match(r"(#{1,6})\s+(.*)", first):
            level = min(6, top_level - 1 + len(heading[1]))
            yield f"<h{level}>{_inline(heading[2])}</h{level}>"
        elif first.startswith("|"):
            stop = _end(lines, stop, lambda line: line.strip().startswith("|"))
            yield from _table([line.strip() for line in lines[at:stop]])
        elif _ITEM.match(first):
            stop = _end(lines, stop, _lists)
            yield from _list(lines[at:stop])
        else:
            stop = _end(lines, stop, _continues)
            yield f"<p>{_inline(' '.join(line.strip() for line in lines[at:stop]))}</p>"
        at = stop


def _end(lines: Sequence[str], start: int, goes_on: Callable[[str], bool]) -> int:
    """Return the place of the first line, from a place on, that does not go on with a block."""
    return next((at for at in range(start, len(lines)) if not goes_on(lines[at])), len(lines))


def _continues(line: str) -> bool:
    """Tell whether a line goes on with the paragraph before it."""
    plain = line.strip()
    return bool(plain) and not plain.startswith(("|", "#", _FENCE)) and not _ITEM.match(plain)


def _lists(line: str) -> bool:
    """Tell whether a line goes on with the list before it."""
    plain = line.strip()
    return bool((plain and line.startswith("  ")) or _ITEM.match(plain)) or _continues(line)


def _list(lines: Sequence[str]) -> Iterator[str]:
    items: list[list[str]] = []
    for line in lines:
        found = _ITEM.match(line.strip())
        if found:
            items.append([found[2]])
        else:
            items[-1].append(line.strip())
    first = _ITEM.match(lines[0].strip())
    kind = "ol" if first and first[1] else "ul"
    yield f"<{kind}>"
    yield from (f"<li>{_inline(' '.join(words))}</li>" for words in items)
    yield f"</{kind}>"


def _table(lines: Sequence[str]) -> Iterator[str]:
    rows = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip("|"))] for line in lines]
    head, body = rows[0], [row for row in rows[1:] if set("".join(row)) - set("-: ")]
    yield '<div class="wide" tabindex="0" role="group" aria-label="table"><table>\n<thead><tr>'
    yield "".join(f'<th scope="col">{_inline(cell)}</th>' for cell in head)
    yield "</tr></thead>\n<tbody>"
    for row in body:
        yield f"<tr>{''.join(f'<td>{_inline(cell)}</td>' for cell in row)}</tr>"
    yield "</tbody>\n</table></div>"


def _inline(text: str) -> str:
    """Return words with code, bold, italic and the words of links; all else escaped."""
    pieces = re.split(r"`([^`]+)`", text)
    return "".join(
        f"<code>{escape(piece)}</code>" if inside else _emphasis(escape(piece))
        for piece, inside in zip(pieces, itertools.cycle((False, True)), strict=False)
    )


def _emphasis(escaped: str) -> str:
    escaped = re.sub(r"\[([^\]]+)\]\([^)\s]*\)", r"\1", escaped)
    escaped = re.sub(r"\*\*(\S(?:.*?\S)?)\*\*", r"<strong>\1</strong>", escaped)
    escaped = re.sub(r"(?<![*\w])\*(\S(?:[^*]*?\S)?)\*(?![*\w])", r"<em>\1</em>", escaped)
    return re.sub(r"\\(&lt;|[(|])", r"\1", escaped)  # as `planner.glance.as_words` writes them
