"""The package as a whole: who imports whom, what is public, what stays unloaded."""

from __future__ import annotations

import ast
import importlib
import inspect
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
from conftest import REPOSITORY

import regrasp_lp as rl

ROOT = REPOSITORY / "regrasp_lp"

TEXT = """
check_certificates
errors  display
contact  rings  ring_checks  polygon  wkt
outlines  outlines.curves  outlines.drawing  outlines.dxf
outlines.svg_elements  outlines.svg_shapes  outlines.svg  outlines.simplification  files
directions  friction  wrenches  force_closure  random_grasps  grasp_samples
circuits  torque  margins
linear_sets
lp.solver  lp.ladder  lp.margin_lp  lp.highs_solver  lp.clarabel_solver  lp.exact_solver
lp.linear_program  lp.prices  lp
exact_margins  completion  polytopes
grasp_sets  grasp_sets.candidates  grasp_sets.families  grasp_sets.pieces  grasp_sets.spacing
grasp_sets.set_pieces  grasp_sets.vertices  grasp_sets.spaced
grasp_sets.sweeps  grasp_sets.focus  grasp_sets.double_cones  grasp_sets.parallel
grasp_sets.grasp_set  grasp_sets.collection
quality.grasps  quality.stability  quality.hulls  quality.friction_needed  quality.volumes
quality.wrenches  quality.focus  quality.regions  quality.metrics  quality.epsilon_bounds
quality.best_grasps  quality.maps
quality
planning  planning.touching  planning.hand  planning.relaxations  planning.reach
planning.stuck
remedies  planning.steps  planning.objective
shadows  switching  joins  contact_rule  couplings  handovers  focus_rule  switches
planning.plan_document  planning.limit_checks  planning.verification  planning.along
planning.plan  planning.plan_file
planning.regions  planning.limits  planning.plan_program  planning.friction_change
planning.sensitivity  planning.account
planning.branches  planning.search  planning.steering
planning.aligning  planning.path_lp
planning.path_optimum  planning.staying  planning.regrip  planning.hops
planning.fingers  planning.clearing  planning.execution  planning.performance
planning.shortest_slide  planning.set_rows  planning.route_lp  planning.costs
planning.route_search  planning.shortest
planning.levels  planning.moves  planning.ends  planning.bottleneck  planning.widest
planning.alternatives  planning.widest_routes  planning.set_path
planning.requests  planning.planner  planning.on_demand  planning.growing  planning.nearby
planning.hit_and_run  planning.layers  planning.path_choices  planning.path_steps
planning.path_model
planning.path_set  planning.path_sets
summary  tables  structure  graph_options  refusals  queries  switching_graph  networks  existence
certification  certificates
build  graph_file  nearest_switch  connection  explanation  why_not
workers  many
membership  sampling  completeness
colors  graph_layout
viewer.page  viewer.plans  viewer.graphs  viewer
plotting.palette  plotting.placement  plotting.frame  plotting.sight  plotting.outline
plotting.fingers  plotting.grasps
plotting.sets  plotting.scene  plotting.focus_cells  plotting.focus_switch  plotting.parallel_sets
plotting.friction_cones  plotting.quality
plotting.regions  plotting.contact_space  plotting.normals  plotting.graph
plotting.filmstrip  plotting.animation  plotting
__init__
cli.progress  cli.values  cli.wording  cli.hand_options  cli.object_options
cli.no_choice  cli.far_apart  cli.alternatives  cli.tables  cli.arguments  cli.commands
cli
__main__
"""
ORDER = TEXT.split()
"""Every module; at module level each imports only modules that stand before it."""


@cache
def modules() -> dict[str, ast.Module]:
    """The syntax trees of all modules, by name within the package."""
    found = {}
    for path in sorted(ROOT.rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        name = ".".join(parts[:-1] if len(parts) > 1 and parts[-1] == "__init__" else parts)
        found[name] = ast.parse(path.read_text(encoding="utf-8"))
    return found


def imports(body: list[ast.stmt]) -> set[str]:
    """The modules of the package that statements import when they are run."""
    found: set[str] = set()
    for node in body:
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        if isinstance(node, (ast.If, ast.Try, ast.With)):
            found |= imports([n for n in ast.iter_child_nodes(node) if isinstance(n, ast.stmt)])
        elif isinstance(node, ast.ClassDef):
            found |= imports(node.body)
        elif isinstance(node, ast.Import):
            found |= {package_name(alias.name) for alias in node.names if is_ours(alias.name)}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            if node.module and is_ours(node.module):
                inner = [f"{node.module}.{alias.name}" for alias in node.names]
                found |= {
                    package_name(name if package_name(name) in modules() else node.module)
                    for name in inner
                }
    return found


def is_ours(name: str) -> bool:
    return name.split(".")[0] == "regrasp_lp"


def package_name(name: str) -> str:
    return name.removeprefix("regrasp_lp").removeprefix(".") or "__init__"


def reached(name: str) -> set[str]:
    """All modules that a module imports, directly or not."""
    found: set[str] = set()
    pending = [name]
    while pending:
        for other in imports(modules()[pending.pop()].body) - found:
            found.add(other)
            pending.append(other)
    return found


def test_every_module_has_its_place() -> None:
    assert sorted(ORDER) == sorted(modules())
    assert len(set(ORDER)) == len(ORDER)


@pytest.mark.parametrize("name", ORDER)
def test_imports_point_upwards(name: str) -> None:
    above = set(ORDER[: ORDER.index(name)])
    allowed = above | ({o for o in ORDER if o.startswith(f"{name}.")} if name == "lp" else set())
    assert imports(modules()[name].body) <= allowed


def test_the_exact_checks_share_nothing_with_the_planner() -> None:
    geometry = {"errors", "contact", "rings", "ring_checks", "polygon", "directions", "friction"}
    geometry |= {"wrenches", "display"}
    assert reached("force_closure") <= geometry
    assert reached("planning.verification") <= geometry | {
        "force_closure",
        "planning.plan_document",
        "planning.limit_checks",
    }


def test_parts_know_only_what_they_need() -> None:
    assert reached("linear_sets") == {"errors"}
    assert reached("lp") <= {"errors", "linear_sets"} | {n for n in ORDER if n.startswith("lp.")}
    for name in ORDER:
        if name.startswith("grasp_sets"):
            graph = {"shadows", "switching", "switches", "joins", "handovers", "switching_graph"}
            assert not reached(name) & graph
            assert not any(other.startswith("planning") for other in reached(name))


@pytest.mark.parametrize("name", [name for name in ORDER if name != "check_certificates"])
def test_modules_are_short(name: str) -> None:
    """Of all but the certificate checker, which is one file by intent."""
    source = ROOT.joinpath(*name.split("."))
    path = source / "__init__.py" if source.is_dir() else source.with_suffix(".py")
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 420


@pytest.mark.parametrize("name", ORDER)
def test_only_the_command_line_prints(name: str) -> None:
    calls = [
        node
        for node in ast.walk(modules()[name])
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "print"
    ]
    # the certificate checker is a script of its own
    assert not calls or name.startswith("cli") or name == "check_certificates"


@pytest.mark.parametrize("name", ORDER)
def test_no_bare_except_and_no_global_state(name: str) -> None:
    for node in ast.walk(modules()[name]):
        assert not (isinstance(node, ast.ExceptHandler) and node.type is None)
        assert not isinstance(node, ast.Global)


def test_importing_loads_no_optional_package() -> None:
    heavy = ["cvxpy", "networkx", "matplotlib", "shapely", "pandas", "dask", "distributed"]
    heavy += ["PIL", "ezdxf", "svgpathtools", "scipy", "clarabel", "highspy"]
    code = f"import sys, regrasp_lp; print([m for m in {heavy} if m in sys.modules])"
    found = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=REPOSITORY, check=True
    )
    assert found.stdout.strip() == "[]"


def test_public_names_are_where_they_are_imported_from() -> None:
    """What type checkers read in the package is what it does when a name is asked for."""
    (block,) = (n for n in modules()["__init__"].body if isinstance(n, ast.If))
    read = {
        alias.name: node.module.removeprefix("regrasp_lp").removeprefix(".")
        for node in block.body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }
    assert read.pop("quality") == ""
    assert read == rl._HOMES
    assert sorted([*read, "quality"]) == sorted(rl.__all__)
    for name, home in read.items():
        assert getattr(rl, name) is getattr(importlib.import_module(f"regrasp_lp.{home}"), name)
    assert sorted(dir(rl)) == sorted([*rl.__all__, "__version__"])
    with pytest.raises(AttributeError, match="no attribute 'toleranse'"):
        rl.toleranse  # noqa: B018


# --- public names -------------------------------------------------------------------------------


def test_public_names() -> None:
    assert list(rl.__all__) == sorted(rl.__all__)
    for name in rl.__all__:
        assert hasattr(rl, name)
    promised = """read_polygons Polygon Contact Grasp build_switching_graph Hand GraspSet load_graph
    plan_regrasp Place Release Slide NoPlanFound RegraspError read_plan check_plan is_force_closure
    margin tolerance"""
    assert set(promised.split()) <= set(rl.__all__)


@pytest.mark.parametrize(
    ("owner", "names"),
    [
        (
            rl.Polygon([(0, 0), (1, 0), (0, 1)]),
            "n_edges vertices edge_starts edge_ends edge_lengths input_edge snap plot resolve",
        ),
        (rl.Grasp, "at_fractions"),
        (
            rl.SwitchingGraph,
            "switch neighbors components locate summary to_networkx save plan polygon",
        ),
        (rl.GraspSet, "pieces names"),
        (
            rl.Plan,
            "grasps margins margin tolerance placements path verify plot to_json chosen_margin "
            "chosen_tolerance",
        ),
    ],
)
def test_public_members(owner: object, names: str) -> None:
    for name in names.split():
        assert hasattr(owner, name), name


def test_public_fields() -> None:
    graph = rl.build_switching_graph(rl.Polygon([(0, 0), (4, 0), (4, 3)], name="wedge"), 0.6)
    assert graph.sets
    for name in ("kind", "edges", "center", "margin", "witness", "torque", "pieces"):
        assert hasattr(graph.sets[0], name)
    contact = rl.Contact(edge=1, position=0.3)
    assert (contact.edge, contact.position) == (1, 0.3)
    witness = graph.sets[0].witness
    plan = graph.plan(witness, witness)
    assert plan.steps == ()


@pytest.mark.parametrize(
    ("function", "names"),
    [
        (
            rl.build_switching_graph,
            "polygon friction hand sets switching min_margin solver presolve",
        ),
        (rl.plan_regrasp, "polygon start goal friction hand sets aligning"),
        (rl.SwitchingGraph.plan, "self start goal aligning"),
    ],
)
def test_public_arguments(function: object, names: str) -> None:
    found = list(inspect.signature(function).parameters)
    assert found[: len(names.split())] == names.split()


def test_errors_are_one_family() -> None:
    errors = [
        value
        for name in rl.__all__
        if isinstance(value := getattr(rl, name), type) and issubclass(value, Exception)
    ]
    assert len(errors) >= 10
    assert all(issubclass(error, rl.RegraspError) for error in errors)
    for error in (rl.PolygonError, rl.ContactError, rl.FrictionError, rl.HandError, rl.OptionError):
        assert issubclass(error, ValueError)
    assert rl.NoPlanFound("why").explanation == "why"
    missing = rl.MissingExtraError("matplotlib", "plot", "drawing")
    assert isinstance(missing, ImportError)
    assert 'pip install "regrasp_lp[plot]"' in str(missing)


def test_everything_public_is_documented() -> None:
    for name in rl.__all__:
        value = getattr(rl, name)
        assert inspect.getdoc(value), name
        if inspect.isclass(value):
            for member, entry in vars(value).items():
                if not member.startswith("_") and callable(entry):
                    assert inspect.getdoc(getattr(value, member)), f"{name}.{member}"


def test_citation_names_this_version() -> None:
    lines = (REPOSITORY / "CITATION.cff").read_text(encoding="utf-8").splitlines()
    assert f"version: {rl.__version__}" in lines


def test_package_data() -> None:
    assert (ROOT / "py.typed").exists()
    assert Path(rl.__file__).parent == ROOT
    assert rl.__version__
