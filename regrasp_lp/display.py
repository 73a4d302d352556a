"""How objects show themselves in notebooks: as pictures, as tables, else as their text.

IPython asks an object for `_repr_svg_` and `_repr_html_`, and takes None for "I have none": so is a
picture where the extra "plot" is missing. Nowhere else is a missing extra passed over in silence.
"""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from regrasp_lp.errors import MissingExtraError

if TYPE_CHECKING:
    from regrasp_lp.contact import Grasp
    from regrasp_lp.planning.plan import Plan
    from regrasp_lp.switching_graph import SwitchingGraph

__all__ = ["Pictured", "graph_html", "grasp_html", "plan_html", "table"]

_CELL = "text-align:right;padding:0.1em 0.7em"
_WORD = "text-align:left;padding:0.1em 0.7em"


class Pictured:
    """Something whose method `plot` draws it: a notebook shows the drawing."""

    def plot(self) -> Any:
        """Draw it: return a matplotlib figure, or what has one."""
        raise NotImplementedError

    def _repr_svg_(self) -> str | None:
        return _svg(self.plot)


def table(head: Sequence[str], rows: Iterable[Sequence[object]], caption: str = "") -> str:
    """Return an HTML table; the first cell of each row is a word, the others are numbers.

    Examples
    --------
    >>> "&lt;b&gt;" in table(["kind", "sets"], [["<b>", 3]])
    True
    """

    def row(cells: Sequence[object], tag: str) -> str:
        styles = [_WORD, *[_CELL] * (len(cells) - 1)]
        written = (
            f'<{tag} style="{style}">{html.escape(str(cell))}</{tag}>'
            for style, cell in zip(styles, cells, strict=True)
        )
        return f"<tr>{''.join(written)}</tr>"

    title = f'<caption style="{_WORD}">{html.escape(caption)}</caption>' if caption else ""
    body = "".join(row(cells, "td") for cells in rows)
    return f"<table>{title}<thead>{row(head, 'th')}</thead><tbody>{body}</tbody></table>"


def grasp_html(grasp: Grasp) -> str:
    """Return the contacts of a grasp as a table; what is not known of a contact is left empty."""

    def number(value: float | None) -> str:
        return "" if value is None else f"{value:.6g}"

    rows = [
        [f"{k}", contact.edge, number(contact.position), number(contact.fraction)]
        for k, contact in enumerate(grasp, start=1)
    ]
    return table(["contact", "edge", "position", "fraction"], rows)


def plan_html(plan: Plan) -> str:
    """Return a plan's filmstrip and its account, and, folded, the page to step through it."""
    picture = _svg(plan.plot) or ""
    account = html.escape(str(plan))
    page = html.escape(plan.to_html(), quote=True)
    # its script is to reach nothing of the notebook
    frame = "loading='lazy' sandbox='allow-scripts' "
    frame += 'style="width:100%;height:48em;border:1px solid #ccc"'
    return (
        f'<div style="max-width:72em">{_scaled(picture)}<pre>{account}</pre><details><summary>step '
        f'through it</summary><iframe {frame} srcdoc="{page}"></iframe>'
        "</details></div>"
    )


def graph_html(graph: SwitchingGraph) -> str:
    """Return the counts of a switching graph as a table, and a small picture of it."""
    summary = graph.summary()
    rows: list[list[object]] = [
        [kind.replace("_", "-"), counts.candidates, counts.sets, counts.components]
        for kind, counts in summary.kinds.items()
    ]
    rows.append(["all", "", summary.n_sets, len(summary.components)])
    name = summary.name or "unnamed polygon"
    caption = f"{name}: {summary.n_edges} edges, {summary.n_switches} switches"
    counts = table(["kind", "candidates", "sets", "components"], rows, caption)
    picture = _png(lambda: _graph_picture(graph)) if len(graph) else None
    style = "display:flex;flex-wrap:wrap;align-items:flex-start"
    return f'<div style="{style}">{counts}{picture or ""}</div>'


def _graph_picture(graph: SwitchingGraph) -> Any:
    from regrasp_lp.plotting import plot_graph

    return plot_graph(graph)


def _drawn(draw: Callable[[], Any]) -> Any | None:
    """The figure that is drawn, or None without matplotlib."""
    try:
        import regrasp_lp.plotting  # noqa: F401  (says what is missing)
    except MissingExtraError:
        return None
    drawn = draw()
    return getattr(drawn, "figure", None) or drawn


def _svg(draw: Callable[[], Any]) -> str | None:
    """A picture as SVG, the same bytes for the same picture."""
    figure = _drawn(draw)
    if figure is None:
        return None
    import matplotlib

    data = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "regrasp_lp"}):
        figure.savefig(data, format="svg", metadata={"Date": None})
    text = data.getvalue()
    return text[text.index("<svg") :]


def _scaled(svg: str) -> str:
    """The picture as wide as there is room: not wider than it was drawn."""
    return svg.replace("<svg ", '<svg style="max-width:100%;height:auto" ', 1)


def _png(draw: Callable[[], Any]) -> str | None:
    """A picture of pixels as an HTML image."""
    figure = _drawn(draw)
    if figure is None:
        return None
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=72)
    encoded = base64.b64encode(data.getvalue()).decode()
    return f'<img alt="switching graph" src="data:image/png;base64,{encoded}">'
