"""Values as they are written on the command line: contacts, points, friction, file names."""

from __future__ import annotations

import argparse
import math
import re
from pathlib import Path

from regrasp_lp.contact import Contact, Grasp
from regrasp_lp.errors import OptionError
from regrasp_lp.planning.objective import Objective

PICTURES = (".png", ".svg", ".pdf")
ANIMATION = ".gif"


def grasp_text(grasp: Grasp, digits: int | None = None) -> str:
    """Return a grasp in the form that ``--start`` takes: exactly, or with so many digits.

    Examples
    --------
    >>> grasp_text(Grasp([(4, 0.25), (0, 1 / 3)]))
    '4:0.25,0:0.3333333333333333'
    >>> grasp_text(Grasp([(4, 0.25), (0, 1 / 3)]), digits=4)
    '4:0.25,0:0.3333'
    """
    named = [""] * len(grasp) if grasp.fingers is None else [f"{k}@" for k in grasp.fingers]
    entries = zip(named, grasp.edges.tolist(), grasp.positions.tolist(), strict=True)
    return ",".join(
        f"{name}{edge}:" + (repr(u).removesuffix(".0") if digits is None else f"{u:.{digits}g}")
        for name, edge, u in entries
    )


def grasp(text: str) -> Grasp:
    """Read contacts: pairs edge:position, separated by commas; each with its finger or none.

    Examples
    --------
    >>> grasp("4:0.25, 0:1.2"), grasp("3@4:0.25, 1@0:1.2")
    (Grasp([(4, 0.25), (0, 1.2)]), Grasp([(4, 0.25), (0, 1.2)], fingers=(3, 1)))
    """
    entries = [pair.strip().rpartition("@") for pair in text.split(",")]
    contacts = [_contact(pair) for _, _, pair in entries]
    if not any(at for _, at, _ in entries):
        return Grasp(contacts)
    fingers = [_whole(finger) for finger, _, _ in entries]
    return Grasp(contacts, [0 if finger is None else finger for finger in fingers])


def points(text: str) -> list[tuple[float, float]]:
    """Read points: pairs x,y, separated by spaces or semicolons.

    Examples
    --------
    >>> points("1,2 3,4.5"), points("-1, 2; 3, 4.5")
    ([(1.0, 2.0), (3.0, 4.5)], [(-1.0, 2.0), (3.0, 4.5)])
    """
    pairs = re.sub(r"\s*,\s*", ",", text.replace(";", " ")).split()
    if not pairs:
        raise argparse.ArgumentTypeError('no point is given; write points as in "0.5,0 2,1.5"')
    return [_point(pair) for pair in pairs]


def friction(text: str) -> float | list[float]:
    """Read friction: one value, or one for each edge separated by commas.

    Examples
    --------
    >>> friction("0.2"), friction("0.2,0.3,0.2")
    (0.2, [0.2, 0.3, 0.2])
    """
    values = []
    for part in text.split(","):
        value = _number(part)
        if value is None or value <= 0:
            raise argparse.ArgumentTypeError(
                f"{part.strip()!r} is no friction coefficient; write one positive number, or one "
                "for each edge as in 0.2,0.3,0.2"
            )
        values.append(value)
    return values[0] if len(values) == 1 else values


def one_friction(text: str) -> float:
    """Read one friction coefficient, the same for all edges."""
    value = friction(text)
    if isinstance(value, list):
        raise argparse.ArgumentTypeError(
            f"{text!r} has several values; write one, for all edges of all polygons"
        )
    return value


def fingers(text: str) -> int:
    """Read the number of fingers, 3 or more."""
    number = _whole(text)
    if number is None or number < 3:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no number of fingers to regrasp with; it takes at least 3"
        )
    return number


def edges(text: str) -> int:
    """Read a number of edges, 3 or more."""
    number = _whole(text)
    if number is None or number < 3:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of edges; polygons have 3 or more")
    return number


def edge_numbers(text: str) -> list[int]:
    """Read numbers of edges, separated by commas.

    Examples
    --------
    >>> edge_numbers("3, 4")
    [3, 4]
    """
    numbers = [_whole(part) for part in text.split(",")]
    if None in numbers:
        raise argparse.ArgumentTypeError(
            f"{text!r} does not name edges; write their numbers separated by commas, as in 3,4"
        )
    return [number for number in numbers if number is not None]


def finger_numbers(text: str) -> list[int]:
    """Read numbers of fingers, separated by commas.

    Examples
    --------
    >>> finger_numbers("1, 4")
    [1, 4]
    """
    numbers = [_whole(part) for part in text.split(",")]
    if None in numbers:
        raise argparse.ArgumentTypeError(
            f"{text!r} does not name fingers; write their numbers separated by commas, as in 1,4"
        )
    return [number for number in numbers if number is not None]


def finger_edges(text: str) -> tuple[int, list[int]]:
    """Read the number of a finger and numbers of edges.

    Examples
    --------
    >>> finger_edges("1:3,4")
    (1, [3, 4])
    """
    finger, colon, named = text.partition(":")
    number = _whole(finger)
    if number is None or not colon:
        raise argparse.ArgumentTypeError(
            f"{text!r} does not name a finger and edges; write them as in 1:3,4"
        )
    return number, edge_numbers(named)


def jobs(text: str) -> int:
    """Read a number of processes, 1 or more."""
    number = _whole(text)
    if number is None or number < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of processes; write 1 or more")
    return number


def plans(text: str) -> int:
    """Read a number of plans, 1 or more."""
    number = _whole(text)
    if number is None or number < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of plans; write 1 or more")
    return number


def objective(text: str) -> Objective:
    """Read the name of an objective, or weights by name.

    Examples
    --------
    >>> objective("margin").name
    'margin'
    >>> objective("placements=1, travel=0.2").weights
    (('placements', 1.0), ('travel', 0.2))
    """
    try:
        if "=" not in text:
            return Objective.of(text.strip())
        weights: dict[str, float] = {}
        for part in text.split(","):
            name, equals, weight = (piece.strip() for piece in part.partition("="))
            value = _number(weight)
            if not equals or value is None or name in weights:
                raise argparse.ArgumentTypeError(
                    f"{part.strip()!r} is no weight; write each once, as in placements=1,travel=0.2"
                )
            weights[name] = value
        return Objective.of(weights)
    except OptionError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def length(text: str) -> float:
    """Read a length, 0 or more."""
    value = _number(text)
    if value is None or value < 0:
        raise argparse.ArgumentTypeError(f"{text!r} is no length; write a number of 0 or more")
    return value


def output_file(text: str) -> Path:
    """Read the name of a file to write: its folder has to exist."""
    path = Path(text)
    if not text or path.is_dir():
        raise argparse.ArgumentTypeError(f"{text!r} is no name of a file")
    if not path.parent.is_dir():
        raise argparse.ArgumentTypeError(
            f"cannot write {text!r}: there is no folder {str(path.parent)!r}"
        )
    return path


def picture_file(text: str) -> Path:
    """Read the name of a picture to write: its suffix says the format."""
    path = output_file(text)
    if path.suffix.lower() not in PICTURES:
        raise argparse.ArgumentTypeError(
            f"{text!r} has no suffix of a picture that can be written; use one of "
            + ", ".join(PICTURES)
        )
    return path


def animation_file(text: str) -> Path:
    """Read the name of an animation to write."""
    path = output_file(text)
    if path.suffix.lower() != ANIMATION:
        raise argparse.ArgumentTypeError(f"{text!r} has to end in {ANIMATION}")
    return path


def _contact(pair: str) -> Contact:
    edge_text, colon, position_text = pair.partition(":")
    edge, position = _whole(edge_text), _number(position_text)
    if not colon or edge is None or edge < 0 or position is None:
        raise argparse.ArgumentTypeError(
            f"{pair!r} is no contact; write contacts as edge:position separated by commas, as in "
            "4:0.3,0:1.2"
        )
    return Contact(edge, position)


def _point(pair: str) -> tuple[float, float]:
    numbers = [_number(part) for part in pair.split(",")]
    if len(numbers) != 2 or numbers[0] is None or numbers[1] is None:
        raise argparse.ArgumentTypeError(
            f"{pair!r} is no point; write points as x,y separated by spaces or semicolons, as in "
            '"0.5,0 2,1.5"'
        )
    return numbers[0], numbers[1]


def _whole(text: str) -> int | None:
    return int(text) if re.fullmatch(r"\s*\d{1,18}\s*", text, re.ASCII) else None


def _number(text: str) -> float | None:
    """Return a finite number, or None; words and underscores that Python takes are none."""
    if not re.fullmatch(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*", text, re.ASCII):
        return None
    value = float(text)
    return value if math.isfinite(value) else None
