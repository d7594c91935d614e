"""The shape of the code: imports go one way, one jit, light entry points, files one can read."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]

# Rooms from the bottom up; a module imports from rooms below its own, or from its own room.
ROOMS: list[tuple[str, ...]] = [
    ("kernels",),
    (
        "crowd.errors",
        "crowd.types",
        "crowd.tree",
        "crowd.posing",
        "crowd.resampling",
        "crowd.progress",
        "crowd.cache_folder",
        "crowd.output_folder",
        "crowd.host_arrays",
    ),
    ("crowd.scenario*",),
    (
        "crowd.characters",
        "crowd.analysis",
        "crowd.placement",
        "crowd.drag_mesh",
        "crowd.curves",
        "crowd.tracks",
        "crowd.courses",
        "crowd.ground*",
        "crowd.wave_components",
        "crowd.river_flow",
    ),
    ("crowd.scene", "crowd.styles", "crowd.clip_tables"),
    (
        "crowd.layout",
        "crowd.assets",
        "crowd.params",
        "crowd.state",
        "crowd.stride_assets",
        "crowd.herd_assets",
        "crowd.mesh_assets",
        "crowd.herd_responses",
        "crowd.leg_responses",
        "crowd.water_assets",
        "crowd.stride_assets",
        "crowd.initial",
        "crowd.fluid_build",
        "crowd.build",
    ),
    ("crowd.components",),
    ("crowd.step",),
    ("crowd.unpack", "crowd.pace"),
    ("crowd.advance",),
    (
        "crowd.simulate",
        "crowd.live",
        "crowd.rollouts",
        "crowd.compile_cache",
        "crowd.kept_memory",
        "crowd.compiler_options",
        "crowd.one_compile",
    ),
    ("crowd.record*", "crowd.stances", "crowd.metrics*", "crowd.footfalls"),
    ("crowd.view",),
    ("crowd.report*", "crowd.export", "crowd.triangle_statistics", "crowd.drag_error"),
    ("crowd.tuning", "crowd.figures"),
    ("crowd.analyze", "crowd.tune", "crowd.check*", "crowd.doctor", "crowd.run", "crowd.rig"),
    ("crowd.cli", "crowd.__main__"),
]
MODULES = {
    ".".join(path.relative_to(REPOSITORY).with_suffix("").parts).removesuffix(".__init__"): path
    for room in ("kernels", "crowd")
    for path in (REPOSITORY / room).rglob("*.py")
}
HEAVY = ("jax", "numpy", "scipy", "matplotlib", "zarr", "trimesh", "optax", "pydantic", "ruamel", "PIL", "xarray")


def room(module: str) -> int:
    for index, names in enumerate(ROOMS):
        for name in names:
            stem = name.removesuffix("*")
            if module == name or module.startswith(stem if name.endswith("*") else f"{name}."):
                return index
    raise AssertionError(f"{module} has no room; say in ROOMS where it belongs")


def imports(path: Path) -> Iterator[str]:
    """Modules of this project that a file imports, at its top or inside functions, but not for types only."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    typing_only = {
        child
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING")
        for child in ast.walk(node)
    }
    for node in ast.walk(tree):
        if node in typing_only:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            for alias in node.names:
                submodule = f"{node.module}.{alias.name}"
                yield submodule if submodule in MODULES else str(node.module)


@pytest.mark.parametrize("module", sorted(set(MODULES) - {"crowd"}))
def test_imports_go_one_way(module: str) -> None:
    for imported in imports(MODULES[module]):
        if imported in MODULES and imported != "crowd":
            assert room(imported) <= room(module), f"{module} imports {imported}, which is above it"


def test_no_import_cycles() -> None:
    graph = {module: {name for name in imports(path) if name in MODULES} for module, path in MODULES.items()}
    done: set[str] = set()

    def visit(module: str, above: tuple[str, ...]) -> None:
        assert module not in above, " -> ".join((*above[above.index(module) :], module))
        if module not in done:
            for imported in graph[module]:
                visit(imported, (*above, module))
            done.add(module)

    for module in graph:
        visit(module, ())


def test_kernels_import_jax_only() -> None:
    maths = {"jax", "jaxtyping", "numpy", "kernels"}
    standard = {"__future__", "typing", "dataclasses", "collections", "functools", "math"}
    for module, path in MODULES.items():
        if module.startswith("kernels"):
            assert {name.split(".")[0] for name in imports(path)} <= maths | standard, module


def test_one_jit() -> None:
    """Only simulate.py compiles, and for gradients the rollouts of `crowd.tuning`; a wall is a call within them."""
    users = set()
    for module, path in MODULES.items():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            called = ast.unparse(node) if isinstance(node, ast.Attribute | ast.Name) else ""
            if called in ("jax.jit", "jit", "jax.pmap", "pmap"):
                users.add(module)
    assert users == {"crowd.simulate", "crowd.tuning.rollout", "kernels.wall"}


@pytest.mark.parametrize("path", sorted(MODULES.values()), ids=lambda path: str(path.relative_to(REPOSITORY)))
def test_files_can_be_read_in_one_sitting(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 400


def loaded_by(program: str) -> set[str]:
    """Top-level packages in sys.modules after running a program."""
    show = "print('\\nMODULES', *sorted({name.split('.')[0] for name in sys.modules}))"
    code = f"import sys, runpy\n{program}\n{show}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=REPOSITORY, check=True)
    return set(done.stdout.splitlines()[-1].split()[1:])


def test_import_crowd_is_light() -> None:
    assert not loaded_by("import crowd; dir(crowd)") & set(HEAVY)


def test_help_is_light() -> None:
    run = "sys.argv = ['crowd', '--help']\ntry: runpy.run_module('crowd', run_name='__main__')\nexcept SystemExit: pass"
    assert not loaded_by(run) & set(HEAVY)


def test_scenarios_load_without_jax() -> None:
    assert "jax" not in loaded_by("from crowd.scenario import load; load('configs/wade.yaml')")


def test_version_is_the_same_everywhere() -> None:
    import tomllib

    import crowd

    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    assert project["version"] == crowd.__version__
    assert f"version: {crowd.__version__}\n" in (REPOSITORY / "CITATION.cff").read_text()


def test_locks_pin_every_dependency_without_addresses() -> None:
    import re
    import tomllib

    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    asked = project["dependencies"] + [name for extra in project["optional-dependencies"].values() for name in extra]
    names = {re.split(r"[\[<>=]", line)[0].lower() for line in asked}
    for lock in (REPOSITORY / "requirements").glob("*.txt"):
        lines = [line for line in lock.read_text().splitlines() if not line.startswith("#")]
        assert all(re.fullmatch(r"[A-Za-z0-9_.\-]+==[A-Za-z0-9_.+\-]+", line) for line in lines)
        assert names <= {line.split("==")[0].lower() for line in lines}
