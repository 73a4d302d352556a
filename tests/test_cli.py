"""The command line: what it prints, what it writes, and how it ends."""

from __future__ import annotations

import csv
import io
import itertools
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from conftest import REPOSITORY

import regrasp_lp as rl
from regrasp_lp.cli import _discard_output, main, values
from regrasp_lp.cli.arguments import build_parser
from regrasp_lp.cli.far_apart import chosen_grasp, far_apart
from regrasp_lp.cli.progress import ProgressBar
from regrasp_lp.cli.wording import _OPTIONS
from regrasp_lp.planning.search import fewest_placements, placements_from

COMMANDS = ("plan", "graph", "table", "show", "check")
RECTANGLE = ["plan", "parts.geojson", "--name", "rectangle", "--friction", "0.4"]
TWO_GRASPS = ["--start", "0:30,2:30", "--goal", "1:15,3:15"]

Result = tuple[int, str, str]
Run = Callable[..., Result]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Carry out a command line in a folder of its own: exit code, output, errors."""
    shutil.copy(REPOSITORY / "models" / "workpieces.geojson", tmp_path / "parts.geojson")
    shutil.copy(REPOSITORY / "models" / "stars.geojson", tmp_path / "stars.geojson")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")

    def run(*arguments: str) -> Result:
        capsys.readouterr()
        code = main(arguments)
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


def in_process_of_its_own(*arguments: str, **options: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "regrasp_lp", *arguments]
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    settings: dict[str, object] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    settings |= {"text": True, "env": environment, "timeout": 60, "check": False} | options
    return subprocess.run(command, **settings)  # type: ignore[call-overload, no-any-return]


def assert_one_line(errors: str) -> None:
    assert errors.startswith("regrasp-lp")
    assert errors.endswith("\n")
    assert errors.count("\n") == 1, errors


# --- help ---------------------------------------------------------------------------------------


def test_help_lists_all_commands_and_exit_codes(run: Run) -> None:
    code, out, err = run("--help")
    assert (code, err) == (0, "")
    for name in COMMANDS:
        assert re.search(rf"^    {name}  +\w", out, re.MULTILINE)
    assert "exit codes:" in out


@pytest.mark.parametrize("command", [(), *((name,) for name in COMMANDS)])
def test_help_fits_a_terminal(run: Run, command: Sequence[str]) -> None:
    code, out, _ = run(*command, "--help")
    assert code == 0
    assert max(map(len, out.splitlines())) < 80
    assert "examples:" in out


def test_help_of_plan_names_every_option(run: Run) -> None:
    out = run("plan", "--help")[1]
    options = "name friction start start-xy goal goal-xy tolerance fingers sets aligning solver"
    for option in [*options.split(), "objective", "sensitivity", "json", "plot"]:
        assert re.search(rf"^  --{option}\b", out, re.MULTILINE), option


def example_lines() -> list[str]:
    parser = build_parser()
    (commands,) = (
        action.choices for action in parser._actions if isinstance(action.choices, Mapping)
    )
    texts = [parser.epilog or "", *(commands[name].epilog for name in COMMANDS)]
    joined = "\n".join(texts).replace("\\\n", " ")
    return [line.strip() for line in joined.splitlines() if line.startswith("  regrasp-lp ")]


def test_examples_of_the_help_texts_work(run: Run) -> None:
    lines = example_lines()
    assert len(lines) >= 10
    for line in lines:  # in this order: one writes the plan that another checks
        code, _, err = run(*shlex.split(line)[1:])
        assert (code, err) == (0, ""), line


def test_version(run: Run) -> None:
    assert run("--version") == (0, f"regrasp-lp {rl.__version__}\n", "")


def test_help_loads_nothing_heavy() -> None:
    program = (
        "import sys; from regrasp_lp.cli import main; code = main(['plan', '--help']); "
        "heavy = {'cvxpy', 'networkx', 'matplotlib', 'shapely', 'regrasp_lp.cli.commands'}; "
        "sys.exit(code or len(heavy & set(sys.modules)))"
    )
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, b"")


# --- plan ---------------------------------------------------------------------------------------


def test_plan_prints_an_account(run: Run) -> None:
    code, out, err = run(*RECTANGLE, *TWO_GRASPS)
    assert (code, err) == (0, "")
    assert out.startswith("Regrasp of rectangle: 4 steps, 2 placements")
    assert "release finger 2" in out
    assert out.endswith("It has passed an exact check.\n")
    assert max(map(len, out.splitlines())) <= 80


def test_plan_prints_its_sensitivity_when_asked(run: Run) -> None:
    code, out, err = run(*RECTANGLE, *TWO_GRASPS, "--sensitivity")
    assert (code, err) == (0, "")
    account, sensitivity = out.split("\nWhat limits the regrasp of rectangle\n")
    assert run(*RECTANGLE, *TWO_GRASPS)[1] == account
    assert "the plan holds under any friction" in " ".join(sensitivity.split())
    assert max(map(len, out.splitlines())) <= 80


def test_plan_takes_points_with_negative_coordinates(run: Run, tmp_path: Path) -> None:
    (tmp_path / "block.wkt").write_text("POLYGON ((-3 -1, 3 -1, 3 1, -3 1, -3 -1))")
    common = ["plan", "block.wkt", "--friction", "0.4", "--goal", "1:1,3:1"]
    expected = run(*common, "--start", "0:2,2:4")
    assert expected[0] == 0
    for points in ("-1,-1 -1,1", "-1,-1;-1,1", "-1, -1; -1, 1", "-1.0001,-1.001 -1,1.003"):
        assert run(*common, "--start-xy", points)[:2] == (0, expected[1]) or "1.003" in points
        assert run(*common, f"--start-xy={points}")[0] == 0
    code, _, err = run(*common, "--start-xy", "-1,-1.01 -1,1")
    assert code == 2
    assert "--start-xy: point 0" in err
    assert "--tolerance" in err
    assert run(*common, "--start-xy", "-1,-1.01 -1,1", "--tolerance", "0.02")[0] == 0
    assert run(*common, "--start-xy", "-1,-1.001 -1,1", "--tolerance", "0")[0] == 2


@pytest.mark.parametrize(
    "options",
    [
        ["--solver", "highs"],
        ["--fingers", "5"],
        ["--sets", "chapter"],
        ["--aligning", "regrip"],
        ["--friction", "0.4,0.4,0.4,0.5"],
    ],
)
def test_plan_options(run: Run, options: list[str]) -> None:
    code, out, err = run(*RECTANGLE, *options, *TWO_GRASPS, "--json", "plan.json")
    assert (code, err) == (0, "")
    assert out.endswith("wrote plan.json\n")
    assert rl.check_plan("plan.json").ok


def test_friction_hand_and_alignment_reach_the_plan(run: Run) -> None:
    one = ["--friction", "0.3,0.4,0.5,0.6", "--fingers", "6", "--json", "plan.json"]
    assert run(*RECTANGLE, *one, *TWO_GRASPS)[0] == 0
    plan = rl.read_plan("plan.json")
    np.testing.assert_array_equal(plan.friction, [0.3, 0.4, 0.5, 0.6])
    assert plan.hand.fingers == 6
    apart = ["--start", "0:5,2:55", "--goal", "0:50,2:10", "--json", "plan.json"]
    for aligning, slides in (("slide", True), ("regrip", False)):
        assert run(*RECTANGLE, *apart, "--aligning", aligning)[0] == 0
        steps = rl.read_plan("plan.json").steps
        assert any(isinstance(step, rl.Slide) for step in steps) == slides


@pytest.mark.parametrize("solver", ["highs", pytest.param("clarabel", marks=pytest.mark.slow)])
def test_the_objective_reaches_the_plan_and_its_account(run: Run, solver: str) -> None:
    apart = ["--start", "0:5,0:40,2:40", "--goal", "1:15,3:15", "--solver", solver]
    polygon = next(p for p in rl.read_polygons("parts.geojson") if p.name == "rectangle")
    graph = rl.build_switching_graph(polygon, 0.4, solver=solver)
    grasps = [(0, 5), (0, 40), (2, 40)], [(1, 15), (3, 15)]
    accounts = set()
    for text, objective in (
        ("margin", "margin"),
        ("travel", "travel"),
        ("placements=1, travel=0.2", {"placements": 1, "travel": 0.2}),
    ):
        code, out, err = run(*RECTANGLE, *apart, "--objective", text, "--json", "plan.json")
        assert (code, err) == (0, "")
        plan = graph.plan(*grasps, objective=objective)
        assert out.startswith(f"{plan}\n")
        assert rl.read_plan("plan.json") == plan
        accounts.add(next(line for line in out.splitlines() if line.startswith("objective ")))
    assert len(accounts) == 3
    code, out, _ = run(*RECTANGLE, *apart, "--objective", "margin", "--alternatives", "3")
    assert code == 0
    assert "3 plans, the best:" in out
    code, _, err = run(*RECTANGLE, *apart, "--objective", "travel", "--alternatives", "3")
    assert code == 2
    assert "alternatives are found for" in err


def test_the_only_polygon_of_a_file_needs_no_name(run: Run, tmp_path: Path) -> None:
    (tmp_path / "only.wkt").write_text("POLYGON ((0 0, 60 0, 60 30, 0 30, 0 0))")
    assert run("plan", "only.wkt", "--friction", "0.4", *TWO_GRASPS)[0] == 0
    assert run("show", "only.wkt", "--list")[0] == 0


# --- grasps that are far apart ------------------------------------------------------------------


def chosen_options(out: str) -> list[str]:
    found = re.findall(r"^  (--(?:start|goal)) +(\S+)$", out, re.MULTILINE)
    return [word for option in found for word in option]


@pytest.mark.parametrize(
    ("file", "name"), [("parts.geojson", "l_bracket"), ("stars.geojson", "star_15")]
)
def test_chosen_grasps_are_said_and_can_be_given(run: Run, file: str, name: str) -> None:
    common = ["plan", file, "--name", name, "--friction", "0.3"]
    code, out, err = run(*common)
    assert (code, err) == (0, "")
    assert "far apart in the graph" in out
    assert run(*common)[1] == out
    options = chosen_options(out)
    assert options[::2] == ["--start", "--goal"]
    again = run(*common, "--solver", "highs", *options)
    assert again[0] == 0
    head = out.index("Regrasp of")
    assert again[1].splitlines()[0] == out[head:].splitlines()[0]


@pytest.mark.parametrize("role", ["start", "goal"])
def test_one_grasp_may_be_left_out(run: Run, role: str) -> None:
    code, out, err = run(*RECTANGLE, f"--{role}", "0:30,2:30", "--json", "plan.json")
    assert (code, err) == (0, "")
    other = "goal" if role == "start" else "start"
    assert f"No {other} given; this one is far from the {role}" in out
    assert chosen_options(out)[0] == f"--{other}"
    plan = rl.read_plan("plan.json")
    given = plan.goal if role == "goal" else rl.Grasp(plan.start.values())
    assert sorted(given.edges.tolist()) == [0, 2]


def test_placements_to_all_sets_are_those_of_single_searches(
    workpieces: dict[str, rl.Polygon],
) -> None:
    graph = rl.build_switching_graph(workpieces["t_block"], 0.3, rl.Hand(3))
    sets = graph.sets
    problem = (sets.contacts, sets.margins, graph.switches, graph.hand)
    found = placements_from(*problem, {0: 0})
    for target in range(len(graph)):
        path = fewest_placements(*problem, {0: 0}, {target: 0})
        if path is None:
            assert found[target] == -1
            continue
        steps = itertools.pairwise(path)
        placed = [int(sets.contacts[j]) - (graph.held(i, j) or 0) for i, j in steps]
        assert found[target] == sum(placed)
    assert (found == -1).any()
    near = placements_from(*problem, {0: 0}, most=1)
    assert set(np.flatnonzero(near >= 0)) == {0, *graph.neighbors(0)}


def test_chosen_grasps_are_as_far_apart_as_can_be(workpieces: dict[str, rl.Polygon]) -> None:
    graph = rl.build_switching_graph(workpieces["l_bracket"], 0.3)
    sets = graph.sets
    problem = (sets.contacts, sets.margins, graph.switches, graph.hand)
    distances = np.array([placements_from(*problem, {i: 0}) for i in range(len(graph))])
    start, goal = far_apart(graph)
    (one,), (other,) = (
        [i for i in graph.locate(g) if len(sets[i].edges) == len(g)] for g in (start, goal)
    )
    assert distances[one, other] == distances.max()
    # towards a goal: what a plan from each set would place
    given = sets.witness(5)
    begin, end = far_apart(graph, goal=given)
    assert end is given
    located = graph.locate(given)
    needed = [
        min(int(distances[i, j]) + len(given) - int(sets.contacts[j]) for j in located)
        for i in range(len(graph))
    ]
    assert max(needed[i] for i in graph.locate(begin)) == max(needed)
    assert far_apart(graph, start, goal) == (start, goal)


def test_chosen_grasps_are_inside_their_edges(stars: dict[str, rl.Polygon]) -> None:
    polygon = stars["star_25"]
    for grasp in far_apart(rl.build_switching_graph(polygon, 0.2)):
        assert all(1e-3 < contact.fraction < 1 - 1e-3 for contact in polygon.resolve(grasp))
        assert len(values.grasp_text(grasp)) < 40
        assert rl.is_force_closure(polygon, grasp, 0.2)


def test_graphs_too_large_to_store(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    import regrasp_lp.build

    monkeypatch.setattr(regrasp_lp.build, "STORE_LIMIT", 0)
    monkeypatch.setattr("regrasp_lp.cli.far_apart._LOOK_AT", 3)
    code, out, err = run("plan", "stars.geojson", "--name", "star_15", "--friction", "0.3")
    assert (code, err) == (0, "")
    assert "far apart" in out


def test_chosen_grasps_keep_the_margin_of_their_sets(stars: dict[str, rl.Polygon]) -> None:
    for friction in (0.05, 0.5):
        graph = rl.build_switching_graph(stars["star_15"], friction)
        for index in range(0, len(graph), 3):
            grasp = chosen_grasp(graph, index)
            assert index in graph.locate(grasp)
            best = rl.margin(graph.polygon, graph.sets.witness(index), friction)
            assert rl.margin(graph.polygon, grasp, friction) >= 0.9 * best


def test_digits_are_kept_where_the_margin_needs_them() -> None:
    width = 2 / 3  # fingers have to be opposite each other to a part in 10^13
    polygon = rl.Polygon([(0, 0), (width, 0), (width, 1), (0, 1)], name="slippery")
    graph = rl.build_switching_graph(polygon, 1e-13)
    index = next(i for i, found in enumerate(graph.sets) if found.edges == (0, 2))
    grasp = chosen_grasp(graph, index)
    assert index in graph.locate(grasp)
    assert len(values.grasp_text(grasp)) > 20


# --- no plan: exit code 1 -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ([*TWO_GRASPS, "--fingers", "3"], "the start is in component 0"),
        ([*TWO_GRASPS, "--fingers", "3", "--solver", "highs"], "the start is in component 0"),
        (
            [
                "--start",
                "0:1,0:59,2:30",
                "--goal",
                "1:15,3:15",
                "--sets",
                "chapter",
                "--friction",
                "0.1",
            ],
            "the start is in none of the 2 chapter sets",
        ),
        (
            ["--start", "0:1,0:59,2:30", "--sets", "chapter", "--friction", "0.1"],
            "the start is in none of the 2",
        ),
        (["--name", "wedge", "--friction", "0.1"], "there is only one grasp set at this friction"),
    ],
)
def test_no_plan(run: Run, options: list[str], reason: str) -> None:
    code, out, err = run(*RECTANGLE, *options, "--json", "plan.json", "--plot", "plan.png")
    assert (code, out) == (1, "")
    line, *explanation = err.splitlines()
    assert line.startswith("regrasp-lp plan: no ")
    assert reason in line
    # the full explanation, where start and goal are known
    assert [text[:9] for text in explanation[:1]] == ["No plan: "] * ("--goal" in options)
    assert not Path("plan.json").exists()
    assert not Path("plan.png").exists()


def test_what_would_help_is_said(run: Run) -> None:
    code, out, err = run(*RECTANGLE, *TWO_GRASPS, "--fingers", "3")
    assert (code, out) == (1, "")
    _, found = err.split("\n", 1)
    labels = [line[:10].rstrip() for line in found.splitlines()[2:] if line[0] != " "]
    assert labels == ["start", "goal", "switch", "friction", "fingers"]
    assert "with 4 there is a plan of 2 placements" in found
    polygon = next(p for p in rl.read_polygons("parts.geojson") if p.name == "rectangle")
    friction = RECTANGLE[RECTANGLE.index("--friction") + 1]
    start, goal = (values.grasp(TWO_GRASPS[i]) for i in (1, 3))
    assert found == f"{rl.explain(polygon, start, goal, float(friction), rl.Hand(3))}\n"


def test_the_search_for_what_would_help_is_shown(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    original = ProgressBar.__init__
    monkeypatch.setattr("regrasp_lp.cli.progress._REDRAW", 0.001)
    monkeypatch.setattr(ProgressBar, "__init__", lambda bar: original(bar, terminal, after=0.0))
    code, out, err = run(*RECTANGLE, *TWO_GRASPS, "--fingers", "3")
    assert (code, out) == (1, "")
    assert "times the friction" in terminal.getvalue()
    assert "\r" not in err


def test_no_grasp_at_all(run: Run, tmp_path: Path) -> None:
    code, out, _ = run(
        "graph", "parts.geojson", "--name", "wedge", "--friction", "0.1", "--min-margin", "1000"
    )
    assert code == 0
    assert "components  0" in out
    graph = rl.build_switching_graph(rl.read_polygons("parts.geojson")[0], 0.1, min_margin=1000)
    with pytest.raises(rl.NoPlanFound, match="has no grasp set"):
        far_apart(graph)


@pytest.mark.parametrize(
    ("options", "others", "blamed"),
    [
        ("--max-span 5", {}, "--max-span 5"),
        ("--max-span 5 --edge-clearance 2", {"edge_clearance": 2.0}, "--max-span 5"),
        ("--max-span 4 --avoid-edges 3", {"reachable": {3: None}}, "--max-span 4"),
        ("--max-span 30 --avoid-edges 0,1,2,3,4", {"max_span": 30}, "--avoid-edges"),
    ],
)
def test_the_limit_of_a_hand_that_is_to_blame(
    run: Run, options: str, others: dict[str, object], blamed: str
) -> None:
    """What a hand without this limit could do is counted by building its graph."""
    plan = ["plan", "parts.geojson", "--name", "l_bracket", "--friction", "0.3"]
    code, out, err = run(*plan, *options.split())
    assert (code, out) == (1, "")
    assert_one_line(err)
    assert "l_bracket has no grasp set at this friction within the limits of the hand" in err
    polygon = next(p for p in rl.read_polygons("parts.geojson") if p.name == "l_bracket")
    sets = len(rl.build_switching_graph(polygon, 0.3, rl.Hand(**others)).sets)
    assert sets > 0
    assert err.endswith(f"there would be {sets} without {blamed}\n")


def test_limits_of_a_hand_that_are_to_blame_together(run: Run) -> None:
    plan = ["plan", "parts.geojson", "--name", "l_bracket", "--friction", "0.3"]
    err = run(*plan, "--max-span", "5", "--avoid-edges", "0,1,2,3,4")[2]
    assert re.search(r"there would be \d+ without all of these, none with one less\n$", err)


def test_the_friction_that_joins_sets_is_said(run: Run) -> None:
    err = run("plan", "parts.geojson", "--name", "wedge", "--friction", "0.05")[2]
    found = re.search(r"two sets are joined from a friction of ([\d.]+), not yet at ([\d.]+);", err)
    assert found
    wedge = next(p for p in rl.read_polygons("parts.geojson") if p.name == "wedge")
    joined = [rl.build_switching_graph(wedge, float(mu)).n_switches > 0 for mu in found.groups()]
    assert joined == [True, False]


@pytest.mark.parametrize(
    ("fingers", "reason"),
    [
        ("1,2,3,4", "and there are no others: give a start"),
        ("1,2,3", "with the others alone there is no grasp set: give a start"),
        ("1,2", "with the others alone no two grasp sets are joined: give a start"),
    ],
)
def test_fingers_that_only_slide_need_a_start(run: Run, fingers: str, reason: str) -> None:
    code, out, err = run(*RECTANGLE, "--only-slide", fingers)
    assert (code, out) == (1, "")
    assert_one_line(err)
    assert "fingers that only slide (--only-slide) hold from a given start on" in err
    assert err.endswith(f"{reason}\n")


def test_fingers_that_only_slide_from_a_given_start(run: Run) -> None:
    options = [*RECTANGLE, *TWO_GRASPS[:2], "--only-slide"]
    for fingers in ("1", "1,2", "1,2,3,4"):
        code, out, err = run(*options, fingers)
        assert (code, err) == (0, "")
        assert "No goal given" in out
        assert "release finger 1" not in out
    code, out, err = run(*RECTANGLE, *TWO_GRASPS[2:], "--only-slide", "1,2,3,4")
    assert (code, out) == (1, "")
    assert err.endswith("and there are no others: give a start\n")


def test_messages_name_options(run: Run, tmp_path: Path) -> None:
    """Every option that a message may name is one of the command line."""
    known = set(re.findall(r"--[a-z-]+", "".join(run(name, "--help")[1] for name in COMMANDS)))
    assert set(_OPTIONS.values()) <= known
    (tmp_path / "max_span.wkt").write_text("POINT (1 2)")
    assert "error: max_span.wkt: " in run("show", "max_span.wkt")[2]
    err = run(*RECTANGLE, "--start-xy", "30,1 30,30")[2]
    assert err.endswith("(pass --tolerance to accept more)\n")
    err = run(*RECTANGLE, *TWO_GRASPS, "--only-slide", "1")[2]
    assert "finger 1 only slides (--only-slide): it stays on edge 0" in err
    assert "without --only-slide there is a plan of 2 placements" in err
    assert "only_slide" not in err


def test_explanations_that_fail_do_not_hide_the_answer(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise rl.SolverError("the solver left it open (max_span=3)")

    monkeypatch.setattr("regrasp_lp.why_not.explain", fail)
    code, out, err = run(*RECTANGLE, *TWO_GRASPS, "--fingers", "3")
    answer, more = err.splitlines()
    assert (code, out) == (1, "")
    assert "the start is in component 0" in answer
    assert more.endswith("what would help is not known: the solver left it open (--max-span 3)")


# --- errors: exit code 2, one line --------------------------------------------------------------

OBJECTIVES = '"placements", "margin", "tolerance", "travel"'
CONTACTS_FORM = "write contacts as edge:position separated by commas, as in 4:0.3,0:1.2"
PARTS = ["plan", "parts.geojson", "--friction", "0.3"]
FOCUS = ["table", "parts.geojson", "--switching", "focus"]


@pytest.mark.parametrize(
    ("arguments", "fragment"),
    [
        ([], "required: COMMAND"),
        (["plam"], "invalid choice: 'plam'"),
        (["plan"], "required: FILE, --friction"),
        (["plan", "parts.geojson"], "required: --friction"),
        (["graph", "parts.geojson"], "required: --friction"),
        (["table"], "required: PATH"),
        (["show"], "required: FILE"),
        (["check"], "required: FILE"),
        ([*RECTANGLE, "--frobnicate"], "unrecognized arguments: --frobnicate"),
        ([*RECTANGLE, "--tol", "1"], "unrecognized arguments: --tol 1"),
        ([*RECTANGLE, "--start"], "argument --start: expected one argument"),
        ([*RECTANGLE, "--start", ""], f"'' is no contact; {CONTACTS_FORM}"),
        ([*RECTANGLE, "--start", "0:1,"], "'' is no contact"),
        ([*RECTANGLE, "--start", "0-1"], "'0-1' is no contact"),
        ([*RECTANGLE, "--start", "0:1,2:3o"], "'2:3o' is no contact"),
        ([*RECTANGLE, "--start", "0:1 2:3"], "'0:1 2:3' is no contact"),
        ([*RECTANGLE, "--goal", "0.5:1"], "'0.5:1' is no contact"),
        ([*RECTANGLE, "--goal", "0:nan"], "'0:nan' is no contact"),
        ([*RECTANGLE, "--goal", "0:1e999"], "'0:1e999' is no contact"),
        ([*RECTANGLE, "--goal=-1:1"], "'-1:1' is no contact"),
        ([*RECTANGLE, "--start-xy", "1,2,3,4"], "'1,2,3,4' is no point"),
        ([*RECTANGLE, "--start-xy", "1 2"], "'1' is no point"),
        ([*RECTANGLE, "--start-xy", " "], "no point is given"),
        ([*RECTANGLE, "--start-xy", "-1,x"], "'-1,x' is no point"),
        ([*RECTANGLE, "--start-xy", "--goal", "0:1,2:1"], "--start-xy: expected one argument"),
        ([*RECTANGLE, "--start", "0:1", "--start-xy", "1,2"], "not allowed with"),
        ([*RECTANGLE, "--start", "0:30"], "the start must have 2 or 3 contacts, got 1"),
        ([*RECTANGLE, "--start", "0:30,2:90"], "start: position 90.0 is not on edge 2"),
        ([*RECTANGLE, "--goal", "0:30,7:1"], "goal: there is no edge 7"),
        ([*RECTANGLE, "--goal", "0:30,0:30"], "two contacts at one point"),
        ([*RECTANGLE, "--goal", "0:30,2:1"], "is not in force closure: it would be at"),
        ([*RECTANGLE, "--start-xy", "30,1 30,30"], "point 0, (30, 1), is 1 from the boundary"),
        ([*RECTANGLE, "--tolerance", "-1"], "'-1' is no length"),
        ([*RECTANGLE, "--friction", "rubber"], "'rubber' is no friction coefficient"),
        ([*RECTANGLE, "--friction", "0"], "'0' is no friction coefficient"),
        ([*RECTANGLE, "--friction", "0.1,,0.2"], "'' is no friction coefficient"),
        ([*RECTANGLE, "--friction", "1e300"], "friction must be"),
        ([*RECTANGLE, "--friction", "0.1,0.2"], "--friction has 2 values, but 'rectangle' has 4"),
        (["graph", "parts.geojson", "--friction", "0.1,0.2"], "but 'rectangle' has 4 edges"),
        (["graph", "parts.geojson", "--friction", "1", "--min-margin", "x"], "'x' is no length"),
        (["graph", "parts.geojson", "--friction", "1", "--switching", "x"], "'contact', 'focus'"),
        ([*RECTANGLE, "--fingers", "2"], "it takes at least 3"),
        ([*RECTANGLE, "--fingers", "four"], "'four' is no number of fingers"),
        ([*RECTANGLE, "--sets", "all"], "choose from 'complete', 'chapter'"),
        ([*RECTANGLE, "--solver", "glpk"], "choose from 'clarabel', 'highs'"),
        ([*RECTANGLE, "--aligning", "jump"], "choose from 'slide', 'regrip'"),
        ([*RECTANGLE, "--objective", "speed"], f"must be one of {OBJECTIVES}, got 'speed'"),
        ([*RECTANGLE, "--objective", "travl=1"], f"must be one of {OBJECTIVES}, got 'travl'"),
        ([*RECTANGLE, "--objective", "margin=1,travel"], "'travel' is no weight; write each once"),
        ([*RECTANGLE, "--objective", "margin=1,margin=2"], "'margin=2' is no weight"),
        ([*RECTANGLE, "--objective", "margin=x"], "'margin=x' is no weight"),
        ([*RECTANGLE, "--objective", "margin=-1"], "the weight of 'margin' must be a number >= 0"),
        ([*RECTANGLE, "--objective", "margin=0"], "all weights of the objective are 0"),
        (PARTS, "parts.geojson holds 8 polygons: choose one with --name, of rectangle, l_br"),
        (["show", "parts.geojson"], "holds 8 polygons"),
        ([*PARTS, "--name", "Hexnut"], "no polygon named 'Hexnut'; it has hex_nut, "),
        ([*PARTS, "--name", "zzz"], "it has rectangle, l_bracket"),
        (["plan", "none.geojson", "--friction", "1"], "none.geojson: cannot be read: No such"),
        (["show", "."], ".: cannot be read"),
        (["show", "notes.txt"], "notes.txt: is neither GeoJSON"),
        (["show", "bow.wkt"], "bow.wkt:"),
        ([*RECTANGLE, "--plot", "plan.jpg"], "use one of .png, .svg, .pdf"),
        ([*RECTANGLE, "--plot", "png"], "use one of .png, .svg, .pdf"),
        ([*RECTANGLE, "--json", "no/plan.json"], "there is no folder 'no'"),
        ([*RECTANGLE, "--json", "."], "'.' is no name of a file"),
        ([*RECTANGLE, "--json", ""], "'' is no name of a file"),
        ([*RECTANGLE, "--json", "parts.geojson"], "parts.geojson is the file that is read"),
        ([*RECTANGLE, "--json", "a.png", "--plot", "a.png"], "a.png cannot be written twice"),
        (["graph", "parts.geojson", "--friction", "1", "--save", "g"], "--save takes one graph"),
        (["table", "none.wkt"], "regrasp-lp table: error: none.wkt: cannot be read: No such"),
        (["table", "notes.txt"], "notes.txt: is neither GeoJSON"),
        (["table", "bow.wkt"], "bow.wkt:"),
        (["table", "empty"], "empty: holds no file *.geojson or *.wkt"),
        (["table", "parts.geojson", "--friction", "0.1,0.2"], "'0.1,0.2' has several values"),
        (["table", "parts.geojson", "--friction", "-1"], "'-1' is no friction coefficient"),
        (["table", "parts.geojson", "--friction", "1e300"], "friction must be"),
        (["table", "parts.geojson", "--max-edges", "2"], "'2' is no number of edges"),
        (["table", "parts.geojson", "--jobs", "0"], "'0' is no number of processes"),
        (["table", "parts.geojson", "--jobs", "2.5"], "'2.5' is no number of processes"),
        (["table", "parts.geojson", "--jobs", "2", "--friction", "1e300"], "friction must be"),
        (["table", "stars.geojson", "--max-edges", "14"], "no polygon has 14 edges or fewer"),
        (["table", "parts.geojson", "--switching", "x"], "choose from 'contact', 'focus'"),
        ([*FOCUS, "--sets", "complete"], "the chapter's sets"),
        (["table", "parts.geojson", "--format", "html"], "'text', 'csv', 'markdown'"),
        (["table", ".", "-o", "parts.geojson"], "parts.geojson is the file that is read"),
        (["table", "parts.geojson", "-o", "no/t.csv"], "there is no folder 'no'"),
        (["check", "none.json"], "regrasp-lp check: error: none.json: cannot be read: No such"),
        (["check", "notes.txt"], "notes.txt is no JSON text"),
        (
            ["check", "parts.geojson"],
            'parts.geojson: this is no plan, which has "format": "regrasp-plan", but GeoJSON',
        ),
        ([*RECTANGLE, "--only-place", "7"], "error: --only-place names fingers from 1 to 4, not 7"),
        ([*RECTANGLE, "--max-span", "1", "--fingertip-separation", "2"], "--max-span 1 must be"),
        (
            [*RECTANGLE, *TWO_GRASPS, "--objective", "travel", "--alternatives", "2"],
            "for 'travel': ask for --alternatives 1, or",
        ),
        ([*FOCUS, "--sets", "complete"], "use --sets chapter, or --switching contact"),
    ],
)
def test_errors(run: Run, tmp_path: Path, arguments: list[str], fragment: str) -> None:
    (tmp_path / "notes.txt").write_text("buy milk\n")
    (tmp_path / "bow.wkt").write_text("POLYGON ((0 0, 1 1, 1 0, 0 1, 0 0))")
    (tmp_path / "empty").mkdir()
    before = sorted(tmp_path.iterdir())
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert_one_line(err)
    assert "error: " in err
    assert fragment in err
    assert sorted(tmp_path.iterdir()) == before


def test_usage_errors_point_to_the_help_of_their_command(run: Run) -> None:
    assert run("graph")[2].endswith("(see regrasp-lp graph --help)\n")
    assert run()[2].endswith("(see regrasp-lp --help)\n")


def test_long_lists_of_names_are_cut(run: Run, tmp_path: Path) -> None:
    square = "POLYGON ((0 0, 1 0, 1 1, 0 1, 0 0))\n"
    (tmp_path / "many.wkt").write_text(square * 40)
    err = run("show", "many.wkt")[2]
    assert err.endswith("many_11 and 28 more\n")
    assert "it has many_39, " in run("show", "many.wkt", "--name", "many39")[2]


def test_outputs_are_refused_before_any_work(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def work(*_: object, **__: object) -> None:
        raise AssertionError("work was done")

    monkeypatch.setattr(rl, "read_polygons", work)
    assert run(*RECTANGLE, "--plot", "plan.gif")[0] == 2
    assert run(*RECTANGLE, "--json", "no/plan.json")[0] == 2
    assert run("show", "parts.geojson", "-o", "a.bmp")[0] == 2


def test_missing_matplotlib_is_said_before_any_work(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [n for n in sys.modules if n.startswith("regrasp_lp.plotting")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for arguments in ([*RECTANGLE, "--plot", "a.png"], ["show", "parts.geojson", "-o", "a.png"]):
        code, out, err = run(*arguments)
        assert (code, out) == (2, "")
        assert_one_line(err)
        assert "regrasp_lp[plot]" in err
    assert run("show", "parts.geojson", "--name", "wedge", "--list")[0] == 0
    assert run(*RECTANGLE, *TWO_GRASPS)[0] == 0


def test_a_write_that_fails_leaves_the_old_file(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    Path("plan.json").write_text("old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("regrasp_lp.files.os.replace", full)
    before = sorted(os.listdir())
    for option in ("--json=plan.json", "--plot=plan.pdf"):
        code, out, err = run(*RECTANGLE, *TWO_GRASPS, option)
        assert code == 2
        assert "wrote" not in out
        assert_one_line(err)
        assert "cannot be written: No space left on device" in err
    assert Path("plan.json").read_text() == "old"
    assert sorted(os.listdir()) == before


@pytest.mark.parametrize(
    ("failure", "code", "message"),
    [
        (KeyboardInterrupt(), 130, "interrupted"),
        (MemoryError(), 2, "not enough memory"),
        (rl.SolverError("the solver\nstopped early"), 2, "error: the solver stopped early"),
        (OSError(5, "Input/output error"), 2, "error: Input/output error"),
        (BrokenPipeError(), 141, None),
    ],
)
def test_failures_on_the_way(
    run: Run,
    monkeypatch: pytest.MonkeyPatch,
    failure: BaseException,
    code: int,
    message: str | None,
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise failure

    monkeypatch.setattr(rl, "plan_regrasp", fail)
    monkeypatch.setattr("regrasp_lp.cli._discard_output", lambda: None)
    found = run(*RECTANGLE, *TWO_GRASPS)
    assert found[:2] == (code, "")
    if message is None:
        assert found[2] == ""
    else:
        assert_one_line(found[2])
        assert message in found[2]


# --- graph --------------------------------------------------------------------------------------


def test_graph_prints_summaries(run: Run) -> None:
    code, out, err = run("graph", "parts.geojson", "--name", "u_channel", "--friction", "0.2")
    assert (code, err) == (0, "")
    assert out.startswith("u_channel: 8 edges\n")
    assert re.search(r"^three_finger +\d+ +\d+ +1$", out, re.MULTILINE)
    assert "switches" in out


def test_graph_takes_all_polygons_of_a_file(run: Run, tmp_path: Path) -> None:
    squares = [f"POLYGON ((0 0, {n} 0, {n} {n}, 0 {n}, 0 0))" for n in (1, 2)]
    (tmp_path / "squares.wkt").write_text("\n".join(squares))
    out = run("graph", "squares.wkt", "--friction", "0.5")[1]
    assert re.findall(r"^squares_\d: 4 edges$", out, re.MULTILINE) == [
        "squares_0: 4 edges",
        "squares_1: 4 edges",
    ]
    assert "\n\nsquares_1" in out
    assert not out.endswith("\n\n")


def test_graph_options_and_file(run: Run) -> None:
    options = [
        "--sets",
        "chapter",
        "--fingers",
        "3",
        "--min-margin",
        "1",
        "--solver",
        "highs",
        "--save",
        "graph.npz",
    ]
    code, out, _ = run("graph", "parts.geojson", "--name", "hex_nut", "--friction", "0.2", *options)
    assert code == 0
    assert "concurrent" in out
    assert out.endswith("wrote graph.npz\n")
    graph = rl.load_graph("graph.npz")
    assert graph.hand.fingers == 3
    assert graph.sets.margins.min() > 1
    assert (graph.friction == 0.2).all()


def test_graph_by_the_rule_of_the_chapter(run: Run) -> None:
    common = ["graph", "stars.geojson", "--name", "star_15", "--friction", "0.2"]
    counts = []
    for switching in ("contact", "focus"):
        code, out, err = run(*common, "--sets", "chapter", "--switching", switching)
        assert (code, err) == (0, "")
        counts += [int(re.findall(r"^switches +(\d+)$", out, re.MULTILINE)[0])]
    assert counts[0] > counts[1]
    assert run(*common, "--switching", "contact")[0] == 0
    code, _, err = run(*common, "--switching", "focus")
    assert code == 2
    assert_one_line(err)


def test_certificates_of_a_graph(run: Run) -> None:
    common = ["graph", "parts.geojson", "--name", "hex_nut", "--friction", "0.2"]
    code, out, err = run(*common, "--certificates", "nut.proof")
    assert (code, err) == (0, "")
    assert out.endswith("wrote nut.proof\n")
    code, out, err = run("check", "nut.proof")
    assert (code, err) == (0, "")
    assert out.startswith("nut.proof: accepted: 'hex_nut', 18 edges")
    content = Path("nut.proof").read_bytes()
    Path("nut.proof").write_bytes(content.replace(b'"yes"', b'"no" ', 1))
    code, out, err = run("check", "nut.proof")
    assert (code, err) == (1, "")
    assert out.startswith("nut.proof: rejected: line 1:")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--sets", "chapter", "--switching", "focus"], "are for --switching contact"),
        (["--min-margin", "1"], "are for --min-margin 0"),
        (["--save", "nut.proof"], "cannot be written twice"),
    ],
)
def test_graphs_without_certificates(run: Run, options: list[str], message: str) -> None:
    common = ["graph", "parts.geojson", "--name", "hex_nut", "--friction", "0.2"]
    code, out, err = run(*common, *options, "--certificates", "nut.proof")
    assert (code, out) == (2, "")
    assert_one_line(err)
    assert message in err
    assert not Path("nut.proof").exists()


# --- table --------------------------------------------------------------------------------------

SQUARES = [f"POLYGON ((0 0, {n} 0, {n} {n}, 0 {n}, 0 0))" for n in (1, 2)]


def rows_of(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(text.splitlines()))


def test_table_of_a_folder(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "b.wkt").write_text("\n".join(SQUARES))
    (folder / "a.geojson").symlink_to(tmp_path / "parts.geojson")
    (folder / "notes.txt").write_text("buy milk")
    code, out, err = run("table", "folder", "--format", "csv", "--max-edges", "20")
    assert code == 0
    assert err == "regrasp-lp table: 1 polygon with more than 20 edges left out\n"
    names = [polygon.name for polygon in rl.read_polygons("parts.geojson") if polygon.n_edges <= 20]
    assert [row["name"] for row in rows_of(out)] == [*names, "b_0", "b_1"]
    again = run("table", "folder/a.geojson", "folder/b.wkt", "--max-edges=20", "--format=csv")
    without_seconds = [
        re.sub(r",[\d.]+$", "", text, flags=re.MULTILINE) for text in (out, again[1])
    ]
    assert without_seconds[0] == without_seconds[1]


@pytest.mark.parametrize(
    ("options", "sets", "switching", "friction"),
    [
        ([], "chapter", "focus", np.tan(np.pi / 18)),
        (["--switching", "contact", "--friction", "0.3"], "chapter", "contact", 0.3),
        (["--sets", "complete"], "complete", "contact", np.tan(np.pi / 18)),
    ],
)
def test_table_counts_the_graphs_that_are_asked_for(
    run: Run, options: list[str], sets: str, switching: str, friction: float
) -> None:
    code, out, err = run("table", "parts.geojson", "stars.geojson", "--format", "csv", *options)
    assert (code, err) == (0, "")
    rows = {row["name"]: row for row in rows_of(out)}
    assert len(rows) == 11
    for polygon in rl.read_polygons("stars.geojson")[:2]:
        graph = rl.build_switching_graph(polygon, friction, sets=sets, switching=switching)
        row, summary = rows[polygon.name], graph.summary()
        assert int(row["sets"]) == len(graph)
        assert int(row["switches"]) == graph.n_switches
        assert int(row["components"]) == len(graph.components())
        for kind, counts in summary.kinds.items():
            assert int(row[f"{kind}_components"]) == counts.components


def test_table_fits_and_is_text_by_default(run: Run) -> None:
    code, out, err = run("table", "parts.geojson", "stars.geojson")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert len(lines) == 2 + 11
    assert "--- concurrent ---" in lines[0]
    assert max(map(len, lines)) <= 120
    assert len(set(map(len, lines[1:]))) == 1


@pytest.mark.parametrize(
    ("file", "options", "start"),
    [
        ("t.csv", [], "name,edges,"),
        ("t.md", [], "| name | edges |"),
        ("t.txt", [], "     "),
        ("t", ["--format", "csv"], "name,edges,"),
        ("t.CSV", ["--format", "markdown"], "| name | edges |"),
        ("t.CSV", [], "name,edges,"),
    ],
)
def test_table_writes_a_file(run: Run, file: str, options: list[str], start: str) -> None:
    code, out, err = run("table", "parts.geojson", "--max-edges", "8", "-o", file, *options)
    assert (code, out) == (0, f"wrote {file}\n")
    assert "left out" in err
    text = Path(file).read_bytes().decode()
    assert text.startswith(start)
    assert text.endswith("\n")
    assert "\r" not in text


def test_table_goes_on_after_a_polygon_that_fails(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    failures = {
        "l_bracket": rl.SolverError("the solver\nstopped early"),
        "push_t": MemoryError(),
        "u_channel": ZeroDivisionError("division by zero"),
        "wedge": rl.PolygonError("is no good"),
    }
    original = rl.build_switching_graph

    def build(polygon: rl.Polygon, *rest: object, **options: object) -> rl.SwitchingGraph:
        if polygon.name in failures:
            raise failures[polygon.name]
        return original(polygon, *rest, **options)

    monkeypatch.setattr("regrasp_lp.many.build_switching_graph", build)
    code, out, err = run("table", "parts.geojson", "--max-edges", "10", "-o", "t.csv")
    assert (code, out) == (2, "wrote t.csv\n")
    assert err.splitlines() == [
        "regrasp-lp table: 2 polygons with more than 10 edges left out",
        "regrasp-lp table: error: l_bracket: the solver stopped early",
        "regrasp-lp table: error: u_channel: ZeroDivisionError: division by zero",
        "regrasp-lp table: error: push_t: not enough memory",
        "regrasp-lp table: error: wedge: is no good",
    ]
    names = [row["name"] for row in rows_of(Path("t.csv").read_text())]
    assert names == ["rectangle", "t_block"]


def test_table_goes_on_after_a_file_that_cannot_be_read(run: Run, tmp_path: Path) -> None:
    (tmp_path / "bow.wkt").write_text("POLYGON ((0 0, 1 1, 1 0, 0 1, 0 0))")
    (tmp_path / "good.wkt").write_text(SQUARES[0])
    code, out, err = run("table", "none.wkt", "bow.wkt", "good.wkt", "--format", "csv")
    assert code == 2
    assert [line.split(":")[2] for line in err.splitlines()] == [" none.wkt", " bow.wkt"]
    assert [row["name"] for row in rows_of(out)] == ["good_0"]


def test_table_of_nothing_is_not_written(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise rl.SolverError("stopped early")

    monkeypatch.setattr("regrasp_lp.many.build_switching_graph", fail)
    Path("t.csv").write_text("old")
    code, out, err = run("table", "stars.geojson", "-o", "t.csv")
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 3
    assert Path("t.csv").read_text() == "old"


def test_a_folder_that_cannot_be_listed(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: Path) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "iterdir", refuse)
    code, out, err = run("table", ".")
    assert (code, out) == (2, "")
    assert err == "regrasp-lp table: error: .: cannot be read: Permission denied\n"


# --- show ---------------------------------------------------------------------------------------

MAGIC = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}


def test_show_draws_to_a_file_of_the_name_of_the_object(run: Run) -> None:
    code, out, err = run("show", "stars.geojson", "--name", "star_15")
    assert (code, err) == (0, "")
    assert out.startswith("star_15: 15 edges, ")
    assert out.endswith("wrote star_15.png\n")
    assert Path("star_15.png").read_bytes().startswith(MAGIC[".png"])


def test_show_cleans_the_name_of_the_file(run: Run, tmp_path: Path) -> None:
    square = {"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]]}
    names = {"../a/b c": "a_b_c.png", "???": "polygon.png", "größe.2": "größe.2.png"}
    for name, file in names.items():
        feature = {"type": "Feature", "properties": {"name": name}, "geometry": square}
        (tmp_path / "odd.geojson").write_text(json.dumps(feature))
        assert f"wrote {file}" in run("show", "odd.geojson")[1]
        assert (tmp_path / file).exists()


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf", ".PDF"])
def test_pictures_are_the_same_every_time(run: Run, suffix: str) -> None:
    contents = []
    for _ in range(2):
        path = Path(f"wedge{suffix}")
        assert run("show", "parts.geojson", "--name", "wedge", "-o", str(path))[0] == 0
        contents.append(path.read_bytes())
        time.sleep(0.01)
    assert contents[0] == contents[1]
    assert contents[0].startswith(MAGIC[suffix.lower()])


def test_plan_draws_a_filmstrip(run: Run) -> None:
    code, out, _ = run(*RECTANGLE, *TWO_GRASPS, "--plot", "plan.svg", "--json", "plan.json")
    assert code == 0
    assert out.endswith("wrote plan.json\nwrote plan.svg\n")
    assert Path("plan.svg").read_bytes().startswith(MAGIC[".svg"])


def test_show_lists_edges(run: Run) -> None:
    code, out, _ = run("show", "parts.geojson", "--name", "two_hole_plate", "--list")
    assert code == 0
    lines = out.splitlines()
    assert lines[0].startswith("two_hole_plate: 36 edges, 2 holes, 100 wide, 50 high, area ")
    assert lines[2].split() == ["edge", "from", "to", "length"]
    assert lines[3].split() == ["0", "(0,", "0)", "(100,", "0)", "100"]
    assert lines[-1].endswith("hole 2")
    assert len(lines) == 3 + 36
    assert not list(Path().glob("*.png"))
    assert run("show", "parts.geojson", "--name", "wedge", "--list", "-o", "w.png")[0] == 0
    assert Path("w.png").exists()


# --- check --------------------------------------------------------------------------------------


@pytest.fixture
def plan_file(run: Run) -> Path:
    assert run(*RECTANGLE, *TWO_GRASPS, "--json", "plan.json")[0] == 0
    return Path("plan.json")


def test_check_says_how_much_was_checked(run: Run, plan_file: Path) -> None:
    code, out, err = run("check", "plan.json")
    assert (code, err) == (0, "")
    assert out == "plan.json: ok, 5 grasps and 0 slides checked exactly\n"


def test_check_names_the_fault(run: Run, plan_file: Path) -> None:
    document = json.loads(plan_file.read_text())
    document["steps"].pop(0)
    plan_file.write_text(json.dumps(document))
    code, out, err = run("check", "plan.json")
    assert (code, err) == (1, "")
    assert out.startswith("plan.json: faulty, step 2 (release finger 1): no force closure")
    assert out.endswith("(2 grasps and 0 slides before that passed)\n")


def test_check_of_a_damaged_file_is_an_error(run: Run, plan_file: Path) -> None:
    text = plan_file.read_text()
    damaged = [text[: len(text) // 2], text.replace('"version": 1', '"version": 2'), "[]", ""]
    document = json.loads(text)
    document["polygon"]["exterior"] = [[0, 0], [1, 1], [1, 0], [0, 1]]
    damaged.append(json.dumps(document))
    document = json.loads(text)
    document["friction"] = [-1]
    damaged.append(json.dumps(document))
    for content in damaged:
        plan_file.write_text(content)
        code, out, err = run("check", "plan.json")
        assert (code, out) == (2, ""), content
        assert_one_line(err)
        assert err.startswith("regrasp-lp check: error: plan.json")


# --- progress -----------------------------------------------------------------------------------


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def wait_for(stream: io.StringIO, text: str) -> None:
    end = time.monotonic() + 5
    while text not in stream.getvalue() and time.monotonic() < end:
        time.sleep(0.005)
    assert text in stream.getvalue()


def test_progress_is_drawn_on_a_terminal_and_wiped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("regrasp_lp.cli.progress._REDRAW", 0.01)
    terminal = Terminal()
    with ProgressBar(terminal, after=0.0) as bar:
        bar("three_finger margins", 1, 2)
        wait_for(terminal, " 50 %")
        bar("planning", 0, 0)
        wait_for(terminal, "planning")
    text = terminal.getvalue()
    assert "three-finger margins  [####################....................]   50 %  0 s" in text
    assert "\n" not in text
    assert max(map(len, text.split("\r"))) < 80
    *_, wiped, last = text.split("\r")
    assert (wiped.strip(), last) == ("", "")
    assert len(wiped) >= len("planning  0 s")


@pytest.mark.parametrize("columns", [10, 30])
def test_progress_fits_a_narrow_terminal(monkeypatch: pytest.MonkeyPatch, columns: int) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    terminal = Terminal()
    with ProgressBar(terminal, after=0.0) as bar:
        bar("three_finger margins", 3, 2)
        wait_for(terminal, "three-fin")
    assert max(map(len, terminal.getvalue().split("\r"))) < columns


def test_progress_is_silent_for_short_work_and_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    short, file, dumb, closed = Terminal(), io.StringIO(), Terminal(), io.StringIO()
    closed.close()
    with ProgressBar(short) as bar:
        bar("sets", 1, 2)
    with ProgressBar(file, after=0.0) as one, ProgressBar(closed, after=0.0) as other:
        one("sets", 1, 2)
        other("sets", 1, 2)
        time.sleep(0.05)
    monkeypatch.setenv("TERM", "dumb")
    with ProgressBar(dumb, after=0.0) as bar:
        bar("sets", 1, 2)
        time.sleep(0.05)
    assert short.getvalue() == file.getvalue() == dumb.getvalue() == ""


def test_progress_survives_a_terminal_that_goes_away(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("regrasp_lp.cli.progress._REDRAW", 0.001)

    class Gone(Terminal):
        def write(self, _: str) -> int:
            raise OSError(5, "Input/output error")

    with ProgressBar(Gone(), after=0.0) as bar:
        bar("sets", 1, 4)
        time.sleep(0.05)


def test_progress_without_standard_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", None)
    with ProgressBar(after=0.0) as bar:
        bar("sets", 0, 1)


def test_progress_on_a_real_terminal() -> None:
    pty = pytest.importorskip("pty")
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "w") as terminal:
        with ProgressBar(terminal, after=0.0) as bar:
            bar("sets", 1, 4)
            time.sleep(0.3)
        drawn = ""
        while not drawn.endswith("\r"):  # a redraw may come in two parts
            drawn += os.read(ours, 10_000).decode()
    os.close(ours)
    assert " 25 %" in drawn
    assert drawn.endswith("\r")


def test_plan_shows_progress_of_long_work(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    original = ProgressBar.__init__
    monkeypatch.setattr("regrasp_lp.cli.progress._REDRAW", 0.001)
    monkeypatch.setattr(ProgressBar, "__init__", lambda bar: original(bar, terminal, after=0.0))
    code, out, err = run("plan", "stars.geojson", "--name", "star_25", "--friction", "0.2")
    assert (code, err) == (0, "")
    assert "planning" in terminal.getvalue()
    assert "\r" not in out


def test_table_shows_which_polygon_is_being_done(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    original = ProgressBar.__init__
    monkeypatch.setattr("regrasp_lp.cli.progress._REDRAW", 0.001)
    monkeypatch.setattr(ProgressBar, "__init__", lambda bar: original(bar, terminal, after=0.0))
    code, out, err = run("table", "stars.geojson", "--sets", "complete")
    assert (code, err) == (0, "")
    drawn = terminal.getvalue()
    assert "star_40 (3 of 3): switches  [" in drawn
    assert max(map(len, drawn.split("\r"))) < 80
    assert "\r" not in out


# --- as a process -------------------------------------------------------------------------------


def test_module_runs(tmp_path: Path) -> None:
    shutil.copy(REPOSITORY / "models" / "workpieces.geojson", tmp_path / "parts.geojson")
    done = in_process_of_its_own(*RECTANGLE, *TWO_GRASPS, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "goal reached" in done.stdout
    done = in_process_of_its_own(*RECTANGLE, *TWO_GRASPS, "--fingers", "3", cwd=tmp_path)
    assert done.returncode == 1
    assert (done.stdout, done.stderr.count("\nNo plan: ")) == ("", 1)
    assert done.stderr.startswith("regrasp-lp plan: no plan exists")


def test_a_reader_that_is_gone_is_no_error(tmp_path: Path) -> None:
    read, write = os.pipe()
    os.close(read)
    models = str(REPOSITORY / "models" / "workpieces.geojson")
    arguments = ("show", models, "--name", "two_hole_plate", "--list")
    done = in_process_of_its_own(*arguments, stdout=write, cwd=tmp_path)
    os.close(write)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_a_full_device_is_one_line(tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "PYTHONUNBUFFERED": ""}
    with open("/dev/full", "w") as full:
        done = in_process_of_its_own("--version", stdout=full, cwd=tmp_path, env=environment)
    assert done.returncode == 2
    assert_one_line(done.stderr)
    assert "No space left" in done.stderr


def test_names_that_the_terminal_cannot_write(tmp_path: Path) -> None:
    square = {"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]]}
    feature = {"type": "Feature", "properties": {"name": "größe"}, "geometry": square}
    (tmp_path / "odd.geojson").write_text(json.dumps(feature))
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "PYTHONIOENCODING": "ascii"}
    done = in_process_of_its_own("show", "odd.geojson", "--list", cwd=tmp_path, env=environment)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("gr\\xf6\\xdfe: 4 edges")


def test_output_that_cannot_be_written_is_discarded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with open(tmp_path / "out.txt", "w") as file:
        monkeypatch.setattr(sys, "stdout", file)
        print("still in the buffer")
        _discard_output()
        file.flush()
    assert (tmp_path / "out.txt").read_text() == ""
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    _discard_output()


def test_without_standard_output(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stderr", None)
    assert main(["check", "nothing.json"]) == 2
