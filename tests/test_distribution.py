"""What is built and installed: its files, its extras, its public names."""

from __future__ import annotations

import difflib
import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import REPOSITORY
from public_api import public_api

import regrasp_lp as rl

PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
ACCEPT = "python tests/public_api.py > tests/public_api.txt"
CORE = """test_polygon test_contact test_files test_torque test_planning test_plan test_cli
test_curves test_outlines test_simplified test_display""".split()  # noqa: SIM905
"""Tests that are run against the installed wheel."""


def test_public_names_and_signatures_are_as_agreed() -> None:
    path = REPOSITORY / "tests" / "public_api.txt"
    agreed, found = path.read_text(encoding="utf-8"), public_api()
    changes = difflib.unified_diff(
        agreed.splitlines(), found.splitlines(), "agreed", "found", lineterm="", n=0
    )
    words = "\n".join(changes)
    assert agreed == found, f"public names differ; to accept: {ACCEPT}\n{words}"


# --- extras -------------------------------------------------------------------------------------

DRAW = "rl.Polygon([(0, 0), (4, 0), (4, 3)]).plot()"
READ = "import tempfile, pathlib; p = pathlib.Path(tempfile.mkdtemp()) / 'x'; p.write_text({!r})\n"
USES = {
    "plot": ("matplotlib", DRAW),
    "dxf": ("ezdxf", READ.format("0\nSECTION\n0\nEOF\n") + "rl.read_polygons(p)"),
    "svg": ("svgpathtools", READ.format("<svg/>") + "rl.read_polygons(p)"),
}
"""Extras that something of ours imports: a package, and a line that needs it."""
OWN = {"geo", "dask"}
"""Extras of packages that users hand us objects of, and import themselves."""
DEVELOPMENT = {"notebooks", "test", "bench", "dev", "docs"}


def test_every_extra_is_known() -> None:
    assert set(USES) | OWN <= set(EXTRAS) <= set(USES) | OWN | DEVELOPMENT


@pytest.mark.parametrize("extra", USES)
def test_a_missing_extra_is_named_when_it_is_needed(extra: str) -> None:
    package, line = USES[extra]
    code = f"import sys\nsys.modules[{package!r}] = None\nimport regrasp_lp as rl\n{line}"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    last = run.stderr.splitlines()[-1]
    assert last.startswith("regrasp_lp.errors.MissingExtraError: ")
    assert last.endswith(
        f'needs {package}, which is not installed: pip install "regrasp_lp[{extra}]"'
    )
    assert any(requirement.startswith(package) for requirement in EXTRAS[extra])


# --- wheel and sdist ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[set[str], set[str], Path]]:
    """Files in the wheel and in the sdist, as hatchling builds them, and where these are."""
    from hatchling.builders.sdist import SdistBuilder
    from hatchling.builders.wheel import WheelBuilder

    folder = tmp_path_factory.mktemp("dist")
    for builder in (WheelBuilder, SdistBuilder):
        assert list(builder(str(REPOSITORY)).build(directory=str(folder)))
    (wheel,), (sdist,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    with zipfile.ZipFile(wheel) as archive, tarfile.open(sdist) as tape:
        stem = sdist.name.removesuffix(".tar.gz")
        source = {name.removeprefix(f"{stem}/") for name in tape.getnames()}
        yield set(archive.namelist()), source, folder


def package_files() -> set[str]:
    """The files of the package, but for what Python makes of them."""
    found = (p for p in (REPOSITORY / "regrasp_lp").rglob("*") if p.is_file())
    return {str(p.relative_to(REPOSITORY)) for p in found if "__pycache__" not in p.parts}


def test_the_wheel_holds_the_package_and_nothing_else(
    built: tuple[set[str], set[str], Path],
) -> None:
    wheel, _, _ = built
    inside = {name for name in wheel if not name.startswith(f"regrasp_lp-{rl.__version__}.")}
    assert inside == package_files()
    assert "regrasp_lp/py.typed" in inside
    names = {name.split("/", 1)[1] for name in wheel - inside}
    assert {"METADATA", "RECORD", "WHEEL", "entry_points.txt", "licenses/LICENSE"} <= names


def test_the_sdist_holds_what_the_tests_need(built: tuple[set[str], set[str], Path]) -> None:
    _, sdist, folder = built
    assert package_files() <= sdist
    for name in ("README.md", "CHANGELOG.md", "LICENSE", "pyproject.toml", "CITATION.cff"):
        assert name in sdist
    for part in ("tests", "models"):
        files = {p for p in (REPOSITORY / part).rglob("*") if p.is_file()}
        kept = {str(p.relative_to(REPOSITORY)) for p in files if "__pycache__" not in p.parts}
        assert kept <= sdist
    assert not any("__pycache__" in name or name.endswith(".pyc") for name in sdist)
    assert sum(path.stat().st_size for path in folder.glob("*.tar.gz")) < 12e6


def test_only_tested_versions_of_python_are_claimed() -> None:
    claimed = {
        line.removeprefix("Programming Language :: Python :: ")
        for line in PROJECT["classifiers"]
        if line.startswith("Programming Language :: Python :: ")
    }
    assert min(claimed, key=lambda v: int(v.split(".")[1])) == PROJECT["requires-python"][2:]
    running = f"{sys.version_info.major}.{sys.version_info.minor}"
    assert running in claimed, f"the tests run on {running}, which is not claimed"


@pytest.mark.slow
def test_wheel_and_sdist_install_and_pass_the_core_tests(tmp_path: Path) -> None:
    """Built by `build`, from the sdist; installed where the source tree is not in sight."""
    pip = [sys.executable, "-m", "build", "--outdir", str(tmp_path / "dist"), str(REPOSITORY)]
    subprocess.run(pip, check=True, capture_output=True)
    (wheel,) = (tmp_path / "dist").glob("*.whl")
    subprocess.run([sys.executable, "-m", "venv", str(tmp_path / "venv")], check=True)
    python = tmp_path / "venv" / ("Scripts" if os.name == "nt" else "bin") / "python"
    install = [str(python), "-m", "pip", "install", "--quiet", f"{wheel}[test]"]
    subprocess.run(install, check=True)
    for part in ("tests", "models"):
        shutil.copytree(REPOSITORY / part, tmp_path / "apart" / part)
    shutil.copy(REPOSITORY / "pyproject.toml", tmp_path / "apart")
    where = "import regrasp_lp; print(regrasp_lp.__file__)"
    found = subprocess.run(
        [str(python), "-c", where], cwd=tmp_path / "apart", capture_output=True, text=True
    )
    assert str(tmp_path / "venv") in found.stdout
    files = [f"tests/{name}.py" for name in CORE]
    subprocess.run([str(python), "-m", "pytest", "-q", *files], cwd=tmp_path / "apart", check=True)
