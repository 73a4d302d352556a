"""Pages to look at in a browser: a plan to step through, a switching graph to click in.

A page is one file that needs nothing else: styles, scripts and data are in it, and it asks no
network for anything. `Plan.to_html` and `SwitchingGraph.to_html` write it.
"""

from __future__ import annotations

from regrasp_lp.viewer.graphs import graph_document, graph_page
from regrasp_lp.viewer.plans import plan_document, plan_page

__all__ = ["graph_document", "graph_page", "plan_document", "plan_page"]
