"""One page from its parts: template, styles, scripts and data, all in one text.

Whatever comes from a user, such as the name of an object, is escaped: in text as HTML, in data so
that no character can end the script element that holds it.
"""

from __future__ import annotations

import base64
import html
import json
import math
import re
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regrasp_lp import colors
from regrasp_lp.files import write_atomically
from regrasp_lp.polygon import Polygon

_COLORS = ["INK", "GREY", "MATERIAL", "BLUE", "VERMILLION", "SKY"]
_COLORS += ["GREEN", "ORANGE", "PURPLE", "SET"]
_UNSAFE = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026", "\u2028": "\\u2028", "\u2029": "\\u2029"}
"""Characters of JSON texts that HTML or scripts might take for the end of something."""


def build_page(
    kind: str, title: str, document: Mapping[str, Any], texts: Mapping[str, str] | None = None
) -> str:
    """Return a page as text.

    Parameters
    ----------
    kind : str
        Which template, ``assets/KIND.html``, and script, ``assets/KIND.js``, on top of those that
        all pages share.
    title : str
    document : mapping
        What the script draws: dicts, lists, strings, booleans, finite numbers and None.
    texts : mapping of str to str, optional
        Further texts of the template.

    Returns
    -------
    str
    """
    escaped = {name: html.escape(text) for name, text in (texts or {}).items()}
    parts = {
        **escaped,
        "title": html.escape(title),
        "style": f"{_color_variables()}\n{_asset('style.css')}",
        "script": f"{_asset('scene.js')}\n{_asset(f'{kind}.js')}",
        "data": data_text(document),
    }
    # in one pass, so that nothing that was put in is looked at again
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], _asset(f"{kind}.html"))


def data_text(document: Mapping[str, Any]) -> str:
    r"""Return a document as JSON that is safe inside a script element.

    Examples
    --------
    >>> print(data_text({"name": "</script>"}))
    {"name":"\u003c/script\u003e"}
    """
    text = json.dumps(document, allow_nan=False, separators=(",", ":"))
    return re.sub("[<>&\u2028\u2029]", lambda found: _UNSAFE[found[0]], text)


def save_page(page: str, path: str | Path | None) -> str:
    """Return a page, and write it, whole or not at all, if there is a path."""
    if path is not None:
        write_atomically(path, page)
    return page


def packed(values: Any, dtype: str) -> dict[str, str]:
    """Return an array of numbers in little-endian bytes, as text.

    Parameters
    ----------
    values : array_like
        Flat in C order.
    dtype : str
        "u1", "u2", "u4", "i2", "f4" or "f8".

    Examples
    --------
    >>> packed([1, 2, 256], "u2")
    {'type': 'u2', 'data': 'AQACAAAB'}
    """
    array = np.ascontiguousarray(np.asarray(values), dtype=f"<{dtype}")
    return {"type": dtype, "data": base64.b64encode(array.tobytes()).decode("ascii")}


def unpacked(entry: Mapping[str, str]) -> NDArray[Any]:
    """Return the array that `packed` made text of, flat.

    Examples
    --------
    >>> unpacked(packed([1, 2, 256], "u2")).tolist()
    [1, 2, 256]
    """
    return np.frombuffer(base64.b64decode(entry["data"]), dtype=f"<{entry['type']}")


def object_of(polygon: Polygon, friction: Sequence[float]) -> dict[str, Any]:
    """Return what pages draw of an object: its rings as stored, and μ of each edge."""
    return {
        "name": polygon.name,
        "rings": [ring.tolist() for ring in polygon.rings],
        "friction": list(friction),
    }


def finite(value: float) -> float | None:
    """Return a number, or None if it is infinite: JSON has no such numbers."""
    return float(value) if math.isfinite(value) else None


def _asset(name: str) -> str:
    return resources.files("regrasp_lp.viewer").joinpath("assets", name).read_text("utf-8")


def _color_variables() -> str:
    names = "".join(f"--{name.lower()}:{getattr(colors, name)};" for name in _COLORS)
    return f":root{{{names}}}"
