"""Markdown as how-tos use it, as HTML; no words become markup."""

from markdown_it import MarkdownIt

__all__ = ["to_html"]

# No links, references, entities or HTML: what they would take is shown as it is written.
_READER = MarkdownIt("zero").enable(
    ["heading", "list", "fence", "table", "backticks", "emphasis", "escape", "newline", "text_join"]
)


def to_html(text: str, *, top_level: int = 3) -> str:
    """Return headings, paragraphs, lists, tables and code blocks as HTML.

    Within a line there are code, bold and italic. All else is escaped.

    Parameters
    ----------
    top_level
        Level of the page's heading under which this stands, plus one: what `#` becomes.
    """
    tokens = _READER.parse(text)
    for token in tokens:
        if token.type.startswith("heading"):
            token.tag = f"h{min(6, top_level - 1 + int(token.tag[1]))}"
        elif token.type == "th_open":
            token.attrSet("scope", "col")
    html: str = _READER.renderer.render(tokens, _READER.options, {})
    wide = '<div class="wide" tabindex="0" role="group" aria-label="table"><table>'
    return html.strip().replace("<table>", wide).replace("</table>", "</table></div>")
